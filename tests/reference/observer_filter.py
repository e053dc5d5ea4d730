"""One hypothesis of the state-based estimator: a Kalman filter of the joint state, in matrices.

The joint state is s = [x; d; l; g; f]: the plant's state, the exosystem of the known disturbance, loads, relative
errors of the input gains, sensor faults. With u the input that acts,

    x+ = A x + B (1 + g) u + Ed d + G l + a,   d+ = R d,   l, g and f stay but for their random walks,
    y  = C x + Fd d + c + f.

Written from these equations: full transition matrices, one update for all outputs in Joseph's form, `numpy.linalg`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

if TYPE_CHECKING:
    import record

LARGEST = 1e100
NOBODY: frozenset[int] = frozenset()


def bounded(values: np.ndarray) -> np.ndarray:
    """Returns finite values: what is not a number is zero."""
    return np.clip(np.nan_to_num(values, nan=0.0, posinf=LARGEST, neginf=-LARGEST), -LARGEST, LARGEST)


@dataclass(frozen=True)
class Layout:
    """Where the parts of the joint state stand."""

    n: int
    d: int
    loads: int
    m: int
    p: int
    s: int

    def _part(self, start: int, size: int) -> np.ndarray:
        return np.arange(start, start + size)

    @property
    def x(self) -> np.ndarray:
        """The plant's state."""
        return self._part(0, self.n)

    @property
    def wave(self) -> np.ndarray:
        """The exosystem's state."""
        return self._part(self.n, self.d)

    @property
    def load(self) -> np.ndarray:
        """Loads: on each input, on each channel of the disturbance, on each state."""
        return self._part(self.n + self.d, self.loads)

    @property
    def gain(self) -> np.ndarray:
        """Relative errors of the input gains."""
        return self._part(self.n + self.d + self.loads, self.m)

    @property
    def fault(self) -> np.ndarray:
        """Faults of the sensors."""
        return self._part(self.n + self.d + self.loads + self.m, self.p)

    @property
    def size(self) -> int:
        """Entries in all."""
        return self.n + self.d + self.loads + self.m + self.p


@dataclass
class Jump:
    """Loads and gains that jump together, how probable that is, and its size over that of a usual one."""

    log_rate: float
    loads: np.ndarray
    gains: np.ndarray
    scale: float = 1.0


class Plant:
    """One mode as the estimator knows it."""

    def __init__(self, mode: record.Mode, settings: dict, sample_time: float, fitted: dict | None) -> None:
        """Forms matrices and sizes from the design and, where there are logs, from what they say."""
        own = (mode.A, mode.B, mode.C, mode.E, mode.F)
        self.A, self.B, self.C, E, F = (np.array(fitted[key]) for key in "abcef") if fitted else own
        self.x0, self.u0, self.noise = mode.x0, mode.u0, np.array(settings["noise"])
        n, m, p = len(self.A), self.B.shape[1], len(self.C)
        E, F = E.reshape(n, -1), F.reshape(p, -1)
        s = len(settings["disturbance_load"])
        period = settings.get("period") or {"seconds": 1.0, "harmonics": 0}
        turn = 2 * math.pi * sample_time / period["seconds"]
        angles = [(k + 1) * turn for k in range(period["harmonics"])]
        self.angles = np.tile(angles, s)
        self.a = self.x0 - self.A @ self.x0 - self.B @ self.u0
        self.c = mode.y0 - self.C @ self.x0
        # Each harmonic of each channel is a pair of states, of which the first is the channel's signal.
        picks = np.kron(np.eye(s), np.tile([1.0, 0.0], len(angles))).reshape(s, -1)
        self.Ed, self.Fd = E[:, :s] @ picks, F[:, :s] @ picks
        turns = [np.array([[math.cos(v), math.sin(v)], [-math.sin(v), math.cos(v)]]) for v in angles]
        self.R = block_diag(*(turns * s)) if turns and s else np.zeros((0, 0))
        self.G = np.hstack([self.B, E[:, :s], np.eye(n)])
        self.layout = Layout(n, picks.shape[1], m + s + n, m, p, s)

        still = np.eye(n) - self.A
        on_states = np.sqrt(still**2 @ np.square(settings["state_load"]))
        self.load_size = np.concatenate([settings["input_load"], settings["disturbance_load"], on_states])
        walk = settings["load_walk"] * self.load_size
        walk[m : m + s] = settings["disturbance_walk"]
        self.load_walk = walk
        # A quarter of the square of what the states at their nominal values add to the outputs.
        self.spread = 0.25 * self.C**2 @ np.square(settings["state_size"])
        self.output_variance = self.spread * settings["model_error"] ** 2
        self.Bplus = np.linalg.pinv(self.B)

    @cached_property
    def output_map(self) -> np.ndarray:
        """[C Fd 0 0 0]: what healthy sensors read of the joint state."""
        H = np.zeros((self.layout.p, self.layout.size))
        H[:, self.layout.x], H[:, self.layout.wave] = self.C, self.Fd
        return H

    def output(self, x: np.ndarray, wave: np.ndarray) -> np.ndarray:
        """Returns what healthy sensors read."""
        return self.C @ x + self.Fd @ wave + self.c

    def transition(self, u: np.ndarray) -> np.ndarray:
        """Returns the Jacobian of the joint state's motion under input `u`."""
        at = self.layout
        T = np.eye(at.size)
        T[np.ix_(at.x, at.x)] = self.A
        T[np.ix_(at.x, at.wave)] = self.Ed
        T[np.ix_(at.x, at.load)] = self.G
        T[np.ix_(at.x, at.gain)] = self.B * u
        T[np.ix_(at.wave, at.wave)] = self.R
        return T

    def shows_unlike(self, other: Plant) -> bool:
        """Whether the outputs of two modes differ at the same state, by more than rounding."""
        same = all(np.array_equal(own, its) for own, its in ((self.C, other.C), (self.Fd, other.Fd)))
        return not same or bool(np.any(np.abs(self.c - other.c) > 1e-6 * self.noise))

    def jump(self, jump: Jump, u: np.ndarray, gain_error: float) -> np.ndarray:
        """Returns the covariance that a jump before the last sample under `u` leaves: it has acted once."""
        at = self.layout
        columns = [np.zeros((at.size, 0))]
        for k in jump.loads:
            column = np.zeros(at.size)
            column[at.x], column[at.load[k]] = self.G[:, k], 1.0
            columns.append(jump.scale * self.load_size[k] * column[:, None])
        for k in jump.gains:
            column = np.zeros(at.size)
            column[at.x], column[at.gain[k]] = self.B[:, k] * u[k], 1.0
            columns.append(gain_error * column[:, None])
        root = np.hstack(columns)
        return root @ root.T

    def jumps(self, log_rate: float, tuning: dict) -> list[Jump]:
        """What may jump together: all; each input; each disturbance channel; all states, as usual or farther."""
        at = self.layout
        none = np.arange(0)
        every = Jump(tuning["everything"] * log_rate, np.arange(at.loads), np.arange(at.m))
        each = [Jump(log_rate, np.array([j]), np.array([j])) for j in range(at.m)]
        waves = [Jump(log_rate, np.array([j]), none) for j in range(at.m, at.m + at.s)]
        states = Jump(tuning["several"] * log_rate, np.arange(at.m + at.s, at.loads), none)
        rarer = states.log_rate + tuning["large_load_log_rate"]
        return [every, *each, *waves, states, replace(states, log_rate=rarer, scale=tuning["large_load"])]


@dataclass
class Reading:
    """One sample of the sensors; `valid` are those that gave a number."""

    y: np.ndarray
    valid: np.ndarray
    noise: np.ndarray


@dataclass
class Seen:
    """What a sample says under a hypothesis: innovation, its covariance, its likelihood."""

    r: np.ndarray
    S: np.ndarray
    output: np.ndarray
    H: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    N: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    @cached_property
    def regular(self) -> bool:
        """Whether the covariance is positive definite."""
        try:
            np.linalg.cholesky(self.S)
        except np.linalg.LinAlgError:
            return False
        return True

    @cached_property
    def square(self) -> float:
        """The square of the whitened innovation, r' S^-1 r."""
        return float(self.r @ np.linalg.solve(self.S, self.r)) if self.regular else 1e300

    @cached_property
    def likelihood(self) -> float:
        """Its logarithm, but for a constant."""
        if not self.regular:
            return -1e5
        return max(-0.5 * min(self.square, 1e5) - 0.5 * np.linalg.slogdet(self.S)[1], -1e6)

    def leaves(self, r: np.ndarray, share: float) -> bool:
        """Whether another innovation is about the same."""
        return bool(np.all((self.r - r) ** 2 <= share * np.diag(self.S)))


@dataclass
class Hypothesis:
    """Who is faulty and how, and the estimate under that assumption."""

    z: np.ndarray
    P: np.ndarray
    before: np.ndarray
    mode: int
    moved_by: int
    misfit: float
    additive: frozenset[int] = NOBODY
    stuck: frozenset[int] = NOBODY
    scaled: frozenset[int] = NOBODY
    convinced: bool = True
    plant_changed: bool = False
    score: float = 0.0

    @property
    def flagged(self) -> frozenset[int]:
        """Everybody who is faulty."""
        return self.additive | self.stuck | self.scaled

    @property
    def kinds(self) -> tuple[frozenset[int], ...]:
        """Who is faulty, by kind."""
        return self.additive, self.stuck, self.scaled

    def copy(self) -> Hypothesis:
        """Returns one that can change on its own."""
        return replace(self, z=self.z.copy(), P=self.P.copy(), before=self.before.copy())

    def open(self, k: int, mean: float, variance: float) -> None:
        """Forgets an entry: it has this mean and variance and hangs together with nothing."""
        self.P[k, :] = self.P[:, k] = 0.0
        self.P[k, k] = variance
        self.z[k] = mean

    def has_estimate(self, z: np.ndarray, share: float) -> bool:
        """Whether another estimate is about the same."""
        return bool(np.all((self.z - z) ** 2 <= share * np.diag(self.P)))

    def predict(self, plant: Plant, reading: Reading, *, outputs_may_err: bool) -> Seen:
        """Returns innovation and covariance; a wrong gain is linearised about its estimate."""
        at = plant.layout
        output = plant.output(self.z[at.x], self.z[at.wave])
        H, expected = plant.output_map.copy(), output.copy()
        for q in range(at.p):
            fault = self.z[at.fault[q]]
            if q in self.stuck:
                H[q] = 0.0
                H[q, at.fault[q]], expected[q] = 1.0, fault
            elif q in self.scaled:
                H[q] *= 1.0 + fault
                H[q, at.fault[q]], expected[q] = output[q], (1.0 + fault) * output[q]
            elif outputs_may_err or q in self.additive:
                H[q, at.fault[q]], expected[q] = 1.0, output[q] + fault
        H[~reading.valid] = 0.0
        N = np.diag(np.where(reading.valid, reading.noise**2, 1.0))
        r = np.where(reading.valid, reading.y - expected, 0.0)
        return Seen(r, H @ self.P @ H.T + N, output, H, N)

    def update(self, seen: Seen) -> None:
        """Takes all readings in at once, in Joseph's form."""
        if not seen.regular:
            return
        K = np.linalg.solve(seen.S, seen.H @ self.P).T
        left = np.eye(len(self.z)) - K @ seen.H
        self.P = left @ self.P @ left.T + K @ seen.N @ K.T
        self.P = (self.P + self.P.T) / 2
        self.z = bounded(self.z + K @ seen.r)

    def unmodelled(self, plant: Plant, moved: np.ndarray) -> np.ndarray:
        """Returns the square of what each state changes by, where entries of the matrices are wrong by their size."""
        return plant.A**2 @ (self.z[plant.layout.x] - self.before) ** 2 + plant.B**2 @ moved**2

    def advance(self, plant: Plant, settings: dict, noise: np.ndarray, motion: Motion) -> None:
        """Predicts the next sample."""
        at = plant.layout
        self.moved_by = self.mode
        Q = np.zeros(at.size)
        # The model's error acts as a load that moves as the state and the input move.
        error = settings["changed_error"] ** 2 if self.plant_changed else motion.model_errors[self.mode]
        Q[at.load[at.m + at.s :]] += error * self.unmodelled(plant, motion.moved)
        moved, self.before = (self.z[at.x] - self.before) ** 2, self.z[at.x].copy()
        Q[at.load] += plant.load_walk**2
        Q[at.gain] += settings["gain_walk"] ** 2
        # So does the error of the period as the disturbance turns.
        pairs = self.z[at.wave].reshape(-1, 2)
        sizes = np.array(settings["disturbance_size"])[0::2]
        turning = (settings["period_error"] * plant.angles) ** 2 * (pairs**2).sum(axis=1) + 1e-8 * sizes**2
        Q[at.wave] += np.repeat(turning, 2)
        if motion.outputs_may_err:
            Q[at.fault] += error * plant.C**2 @ moved
        T = plant.transition(motion.u)
        self.P = T @ (self.P + np.diag(Q)) @ T.T
        self.P = (self.P + self.P.T) / 2
        self.P[at.x, at.x] += 1e-12 * np.square(settings["start_elsewhere"])
        x = plant.A @ self.z[at.x] + plant.Ed @ self.z[at.wave] + plant.G @ self.z[at.load] + plant.a
        x += plant.B @ (motion.u * (1.0 + self.z[at.gain]))
        self.z[at.wave] = plant.R @ self.z[at.wave]
        self.z[at.x] = bounded(x)
        # Faults wander.
        abrupt = self.convinced and settings["ambiguous"] == "trust-sensors"
        share = settings["fault_walk" if abrupt else "drift_walk"]
        for q in self.additive:
            self.P[at.fault[q], at.fault[q]] += (share * noise[q]) ** 2
        for q in self.scaled:
            self.P[at.fault[q], at.fault[q]] += 1e-6
        self._limit(plant, settings)

    def _limit(self, plant: Plant, settings: dict) -> None:
        """Keeps each variance below what is thought possible, correlations as they are."""
        at = plant.layout
        most = np.zeros(at.size)
        most[at.x] = 1e8 * np.square(settings["start_elsewhere"])
        most[at.wave] = np.square(settings["disturbance_size"])
        most[at.load] = 36.0 * np.maximum(plant.load_size**2, self.z[at.load] ** 2)
        most[at.gain] = settings["gain_error"] ** 2
        most[at.fault] = plant.output_variance
        for q in self.flagged:
            most[at.fault[q]] = 2.0 * settings["fault_size"][q] ** 2
        variances = np.diag(self.P)
        above = variances > most
        scale = np.where(above, np.sqrt(most / np.where(above, variances, 1.0)), 1.0)
        self.P = self.P * np.outer(scale, scale)


@dataclass
class Motion:
    """What moves the plant over a sample: the input, how it differs from the last, and how wrong each model is."""

    u: np.ndarray
    moved: np.ndarray
    model_errors: list[float]
    outputs_may_err: bool
