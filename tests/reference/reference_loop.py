"""A second implementation of the closed loop, written from the theory and not from the software.

Where the theory offers two forms this one takes the printed form: the observer keeps the state
`z` of (11) with its matrices (F, T, L, H) formed explicitly; the response to the disturbance is
a weighted least-squares fit solved anew at each tick from its normal equations; the leverage uses
the inverse of the database's Gram matrix. Equality with the software to rounding is thus evidence.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

import record
import scenario

VARIANTS = ("ftc", "no_ftc", "told_the_fault")


@dataclass
class DisturbanceFit:
    """Weighted least squares of one mode's response to the periodic disturbance.

    Minimises sum keep^age |d - theta' h|^2 + keep^count |theta|^2 / variance.
    """

    information: np.ndarray
    moment: np.ndarray
    keep: float
    samples: int = 0

    @classmethod
    def empty(cls, harmonics: dict, outputs: int) -> DisturbanceFit:
        """Returns a fit that has seen no sample."""
        size = 2 * harmonics["count"]
        return cls(
            np.eye(size) / harmonics["initial_variance"],
            np.zeros((size, outputs)),
            1.0 - 1.0 / max(harmonics["memory"], 2.0),
        )

    @property
    def known(self) -> bool:
        """Whether there are four samples or more for each coefficient."""
        return self.samples >= 4 * len(self.information)

    @property
    def theta(self) -> np.ndarray:
        """The coefficients: sine and cosine of each harmonic in turn, one column per output."""
        return np.linalg.solve(self.information, self.moment)

    def response(self, h: np.ndarray) -> np.ndarray:
        """Returns the fitted response to regressor `h`."""
        return h @ self.theta

    def carry_over(self, other: DisturbanceFit, ratios: list[np.ndarray], deviations: np.ndarray) -> None:
        """Starts from another mode's fit: the phasor of each harmonic times the ratio of the modes' responses.

        A tenth of the result, in noise deviations of the sensor where it is largest, is added as doubt.
        """
        phasors = other.theta[0::2] + 1j * other.theta[1::2]
        carried = np.array([ratio @ phasor for ratio, phasor in zip(ratios, phasors, strict=True)])
        theta = np.empty_like(other.theta)
        theta[0::2], theta[1::2] = carried.real, carried.imag
        doubt = 0.1 * (np.linalg.norm(theta, axis=0) / deviations).max()
        self.information = np.linalg.inv(np.linalg.inv(other.information) + doubt**2 * np.eye(len(theta)))
        self.moment = self.information @ theta

    def replace(self, sensor: int, theta: np.ndarray) -> None:
        """Sets the coefficients of one output."""
        self.moment[:, sensor] = self.information @ theta

    def leverage(self, h: np.ndarray) -> float:
        """Returns the response's variance in units of the noise variance."""
        return float(h @ np.linalg.solve(self.information, h))

    def learn(self, h: np.ndarray, d: np.ndarray) -> None:
        """Adds a healthy sample: `d` is what the disturbance added to the outputs."""
        self.information = self.keep * self.information + np.outer(h, h)
        self.moment = self.keep * self.moment + np.outer(h, d)
        self.samples += 1


def disturbance_response(mode: record.Mode, angle: float) -> np.ndarray:
    """Returns the frequency response from disturbance to output, C (zI - A)^-1 E + F at z = exp(j angle)."""
    z = np.exp(1j * angle)
    return mode.C @ np.linalg.solve(z * np.eye(len(mode.A)) - mode.A, mode.E) + mode.F


@dataclass
class Validity:
    """How much a residual says: by how much thresholds widen, whether it clears, whether it teaches."""

    widening: float
    clears: bool
    teaches: bool

    def factor(self, *, flagged: bool) -> float:
        """Returns what a threshold is multiplied by."""
        return 1.0 if flagged and not self.clears else self.widening


@dataclass
class FaultFlag:
    """A flag that yields only to `debounce` contradicting samples in a row."""

    debounce: int
    up: bool = False
    against: int = 0

    def vote(self, *, faulty: bool, lost: bool) -> None:
        """Counts one sample's verdict; a lost sensor raises the flag at once."""
        self.against = 0 if faulty == self.up else self.against + 1
        if self.against >= self.debounce or (lost and not self.up):
            self.up, self.against = faulty, 0


class Repetition:
    """Silences a sensor that has said the very same thing once too often."""

    def __init__(self, design: dict) -> None:
        """Remembers nothing yet."""
        self.limit = design["controller"]["estimator"]["stuck_after"]
        self.readings: list[np.ndarray] = []

    def screen(self, y: np.ndarray) -> np.ndarray:
        """Returns the readings, nan where the last `limit` were the same before."""
        self.readings = [*self.readings[-self.limit :], y]
        if self.limit == 0 or len(self.readings) <= self.limit:
            return y
        return np.where((np.array(self.readings) == y).all(axis=0), np.nan, y)


class Estimator:
    """Sensor faults from the least-squares predictor of a healthy database, (55)-(60)."""

    def __init__(self, design: dict) -> None:
        """Prepares the estimator of a design record."""
        self.modes = record.modes(design)
        self.settings = design["controller"]["estimator"]
        self.enabled = self.settings["method"] == "reference"
        self.length = self.settings["response_length"]
        self.outputs = len(self.modes[0].y0)
        nominal = [output["nominal"] for output in design["signals"]["outputs"]]
        self.units = 2.0 ** np.round(np.log2(nominal))[:, None]
        self.responses = [np.array(p["response"]) for p in self.settings["predictors"]]
        factors = [np.array(p["factor"]) for p in self.settings["predictors"]]
        self.dispersions = [np.linalg.inv(R.T @ R) for R in factors]
        harmonics = self.settings["harmonics"]
        self.fits = [DisturbanceFit.empty(harmonics, self.outputs) for _ in self.modes] if harmonics else None
        self.flags = [FaultFlag(self.settings["debounce"]) for _ in range(self.outputs)]
        self.past: list[np.ndarray] = []
        self.period_seen: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self.hold = self.length
        self.y_hat = np.zeros(self.outputs)
        self.residual = np.zeros(self.outputs)
        self.f_hat = np.zeros(self.outputs)
        self.judged = np.zeros(self.outputs, dtype=bool)

    def _wave(self, tick: int) -> np.ndarray:
        harmonics = self.settings["harmonics"]
        angle = 2 * math.pi * math.fmod(tick, harmonics["period"]) / harmonics["period"]
        orders = range(1, harmonics["count"] + 1)
        return np.array([part(h * angle) for h in orders for part in (math.sin, math.cos)])

    def enter(self, left: int, mode: int) -> None:
        """Holds until the past inputs are those of the mode entered, which starts from what the mode left taught."""
        self.hold = self.length
        if not (self.fits and self.fits[left].known and not self.fits[mode].known):
            return
        harmonics = self.settings["harmonics"]
        angles = [2 * math.pi * (h + 1) / harmonics["period"] for h in range(harmonics["count"])]
        responses = [[disturbance_response(self.modes[i], angle) for i in (left, mode)] for angle in angles]
        if any(response.any() for pair in responses for response in pair):
            scaled = [[response / self.units for response in pair] for pair in responses]
            ratios = [self.units * (entered @ np.linalg.pinv(was)) / self.units.T for was, entered in scaled]
            self.fits[mode].carry_over(self.fits[left], ratios, np.array(self.settings["thresholds"]) / 6.0)

    def judge(self, tick: int, mode: int, y: np.ndarray) -> None:
        """Predicts the output, takes the residual, decides sensor by sensor and learns when all are healthy."""
        present = np.isfinite(y)
        if not self.enabled:
            self._decide(present, validity=None)
            return
        phi = np.concatenate([u - self.modes[mode].u0 for u in self.past[-self.length :]])
        undisturbed = self.modes[mode].y0 + self.responses[mode] @ phi
        distance = float(phi @ self.dispersions[mode] @ phi)
        self.y_hat, spread = undisturbed, 1.0 + distance
        if self.fits:
            h = self._wave(tick)
            self.y_hat = undisturbed + self.fits[mode].response(h)
            spread += self.fits[mode].leverage(h)
        self.residual = np.where(present, y - self.y_hat, self.residual)
        limit = self.settings["leverage_limit"]
        deviation = np.array(self.settings["predictors"][mode]["deviation"])
        precise = math.sqrt(distance) * deviation <= 0.01 * np.abs(self.y_hat - self.modes[mode].y0)
        self.judged = (self.hold == 0) & (precise | (distance <= limit))
        validity = Validity(math.sqrt(spread), clears=spread <= 1.0 + limit, teaches=distance <= limit)
        healthy = self._decide(present, validity=validity)
        if self.fits:
            corrected = self._reconsider(mode, h, y - undisturbed)
            if healthy and not corrected:
                self.fits[mode].learn(h, y - undisturbed)
        self.hold = max(self.hold - 1, 0)

    def _reconsider(self, mode: int, h: np.ndarray, d: np.ndarray) -> bool:
        """Refits flagged sensors that, over one period without a hold, showed the disturbance and nothing else."""
        if self.hold > 0 or not np.isfinite(d).all():
            self.period_seen.clear()
            return False
        self.period_seen.append((np.concatenate([[1.0], h]), d, np.array([flag.up for flag in self.flags])))
        if len(self.period_seen) < self.settings["harmonics"]["period"]:
            return False
        X, D, up = (np.array(column) for column in zip(*self.period_seen, strict=True))
        self.period_seen.clear()
        fit = np.linalg.solve(X.T @ X + 1e-6 * np.eye(X.shape[1]), X.T @ D)
        limits = 0.5 * np.array(self.settings["thresholds"])
        unbiased = (np.abs(fit[0]) <= limits) | (self.fits[mode].samples < self.settings["harmonics"]["period"])
        explained = np.mean((D - X @ fit) ** 2, axis=0) <= limits**2
        cleared = np.flatnonzero(unbiased & explained & up.any(axis=0))
        for sensor in cleared:
            self.fits[mode].replace(sensor, fit[1:, sensor])
        return cleared.size > 0

    def _decide(self, present: np.ndarray, *, validity: Validity | None) -> bool:
        """Votes on each sensor's flag and sets f_hat; says whether every sensor was judged and found healthy."""
        all_well = validity is not None and validity.teaches and bool(present.all() and self.judged.all())
        for i, flag in enumerate(self.flags):
            if present[i] and not self.judged[i]:
                continue
            threshold = self.settings["thresholds"][i]
            factor = validity.factor(flagged=flag.up) if validity else 1.0
            beyond = abs(self.residual[i]) > factor * threshold
            flag.vote(faulty=bool(beyond or not present[i]), lost=not present[i])
            largest = self.settings["largest_fault"][i]
            if not flag.up:
                self.f_hat[i] = 0.0
            elif present[i]:
                self.f_hat[i] = np.clip(self.residual[i], -largest, largest)
            quiet = validity is not None and abs(self.residual[i]) <= 0.5 * validity.widening * threshold
            all_well = all_well and not flag.up and quiet and not beyond
        return all_well


class Observer:
    """The observer (11): z+ = F z + T B u + L y, x_hat = z + H y, in physical units."""

    def __init__(self, design: dict) -> None:
        """Prepares the observer of a design record."""
        self.modes = record.modes(design)
        settings = design["controller"]["observer"]
        self.K = [np.array(K) for K in settings["gains"]]
        self.H = [[np.array(H) for H in row] for row in settings["decoupling"]]
        self.x_hat = np.zeros(0)
        self.prior = np.zeros(0)
        self.pending: tuple | None = None

    def start(self, mode: int) -> None:
        """Rests at the mode's operating point."""
        self.prior = self.modes[mode].x0

    def correct(self, mode: int, y: np.ndarray) -> None:
        """Takes the measurement that arrives in `mode`: forms z from the sample just ended, then x_hat = z + H y."""
        now = self.modes[mode]
        if self.pending is None:
            H = self.H[mode][mode]
            z = (np.eye(len(now.x0)) - H @ now.C) @ now.x0 - H @ now.c
        else:
            z_old, H_old, left, u, y_old = self.pending
            was = self.modes[left]
            H = self.H[left][mode]
            T = np.eye(len(now.x0)) - H @ now.C
            F = T @ was.A - self.K[left] @ was.C
            L = self.K[left] + F @ H_old
            offset = T @ was.a - self.K[left] @ was.c - H @ now.c
            z = F @ z_old + T @ was.B @ u + L @ y_old + offset
        self.x_hat = z + H @ y
        self.z_and_H = (z, H)

    def advance(self, mode: int, u: np.ndarray, y: np.ndarray) -> None:
        """Notes the input that acts over the coming sample."""
        now = self.modes[mode]
        self.pending = (*self.z_and_H, mode, u, y)
        self.prior = now.A @ self.x_hat + now.B @ u + now.a


class InternalModel:
    """Integrators of the tracking error and resonators beside them: Z+ = M Z + N Te e."""

    def __init__(self, design: dict) -> None:
        """Forms M and N: one integrator per tracked output, then one rotation per resonator and output."""
        feedback = design["controller"]["feedback"]
        r = len(feedback["tracked"])
        turns = [
            np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
            for angle in feedback["resonators"]
        ]
        self.M = block_diag(np.eye(r), *(np.kron(np.eye(r), turn) for turn in turns))
        self.N = np.vstack([np.eye(r), *(np.kron(np.eye(r), [[1.0], [0.0]]) for _ in turns)])


@dataclass
class Loop:
    """The closed loop of a design record, controller first and then plant."""

    design: dict
    noise: np.ndarray

    @cached_property
    def modes(self) -> list[record.Mode]:
        """The modes as designed for."""
        return record.modes(self.design)

    @cached_property
    def true_modes(self) -> list[record.Mode]:
        """The modes of the plant behind the sensors."""
        return record.true_modes(self.design)

    def signals(self, tick: int) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
        """Returns mode (0-based), reference, disturbance and additive fault of a tick."""
        te, plan = record.sample_time(self.design), self.design["scenario"]
        values = [
            np.array([scenario.waveform(s, tick, te) for s in plan[key]])
            for key in ("reference", "disturbance", "fault")
        ]
        return scenario.active_mode(plan["schedule"], tick, te), *values

    def command(self, mode: int, x_hat: np.ndarray, Z: np.ndarray, y_ref: np.ndarray, u_old: np.ndarray) -> np.ndarray:
        """Returns the command before saturation: u0 + K (x_hat - x0) + G Z + N (y_ref - S y0) + V (u_old - u0)."""
        feedback = self.design["controller"]["feedback"]
        gains = feedback["modes"][mode]
        point = self.modes[mode]
        K, G, N, V = (np.array(gains[key]) for key in ("state_feedback", "integral", "feedforward", "previous_input"))
        u = point.u0 + K @ (x_hat - point.x0) + G @ Z
        if N.size:
            u = u + N @ (y_ref - point.y0[feedback["tracked"]])
        return u + V @ (u_old - point.u0) if V.size else u

    def saturate(self, u: np.ndarray) -> np.ndarray:
        """Clamps a command to the input limits."""
        limits = self.design["signals"]["inputs"]
        low = [-math.inf if entry["min"] is None else entry["min"] for entry in limits]
        high = [math.inf if entry["max"] is None else entry["max"] for entry in limits]
        return np.clip(u, low, high)

    def trusted_fault(self, variant: str, f_hat: np.ndarray, f: np.ndarray) -> np.ndarray:
        """Returns the fault that the variant takes out of the loop."""
        if variant == "told_the_fault":
            return f
        compensated = variant == "ftc" and self.design["controller"]["compensation"] != "none"
        return f_hat if compensated else np.zeros_like(f_hat)

    def run(self, variant: str) -> dict[str, np.ndarray]:
        """Runs one variant and returns its signals, one row per tick."""
        te = record.sample_time(self.design)
        feedback = self.design["controller"]["feedback"]
        estimator, observer = Estimator(self.design), Observer(self.design)
        repetition = Repetition(self.design)
        mode = self.signals(0)[0]
        start = self.modes[mode]
        observer.start(mode)
        sensors = scenario.Sensors(self.design["scenario"]["events"], self.true_modes[mode].y0.copy())
        internal = InternalModel(self.design)
        x, u, Z = self.true_modes[mode].x0, start.u0, np.zeros(len(internal.M))
        model_run = start.x0
        transfer, offset, since = feedback["transfer"], np.zeros(len(u)), math.inf
        estimator.past = [u] * estimator.length
        rows: dict[str, list] = {}
        for tick in range(self.design["scenario"]["steps"]):
            left = mode
            mode, y_ref, w, additive = self.signals(tick)
            now = self.true_modes[mode]
            y_true = now.C @ x + now.F @ w + now.c
            y = sensors.read(y_true, self.noise[tick], additive, tick, te)

            if mode != left:
                estimator.enter(left, mode)
            heard = repetition.screen(y)
            estimator.judge(tick, mode, heard)
            modelled = self.modes[mode].C @ model_run + self.modes[mode].c
            substitute = np.where(estimator.judged, estimator.y_hat, modelled)
            fault = self.trusted_fault(variant, estimator.f_hat, sensors.fault)
            used = heard if variant == "ftc" else y
            y_c = np.where(np.isfinite(used), used - fault, substitute)
            held = np.array([flag.up for flag in estimator.flags]) & ~estimator.judged
            if variant == "ftc" and self.design["controller"]["compensation"] == "virtual-sensor":
                far = np.abs(y_c - modelled) > 4.0 * np.array(estimator.settings["thresholds"])
                y_c = np.where(estimator.enabled & held & far, modelled, y_c)
            observer.correct(mode, y_c)
            wanted = self.command(mode, observer.x_hat, Z, y_ref, u)
            since += 1
            if mode != left and transfer and since >= transfer["samples"]:
                offset, since = u - wanted, 0
            wanted = wanted + offset
            u_old, u = u, self.saturate(wanted)
            acting = u_old if feedback["latency"] else u

            unwinding = np.array(feedback["modes"][mode]["anti_windup"])
            Z = internal.M @ Z + internal.N @ (te * (y_ref - y_c[feedback["tracked"]])) + unwinding @ (u - wanted)
            offset = offset * (transfer["decay"] if transfer else 0.0)
            observer.advance(mode, acting, y_c)
            here = self.modes[mode]
            model_run = here.A @ model_run + here.B @ acting + here.a if held.any() else observer.prior
            estimator.past.append(acting)
            for name, value in {
                "mode": [mode + 1],
                "y_ref": y_ref,
                "w": w,
                "f": sensors.fault,
                "y": y,
                "y_true": y_true,
                "x": x,
                "u": u,
                "x_hat": observer.x_hat,
                "f_hat": estimator.f_hat,
                "residual": estimator.residual,
                "fault": [float(flag.up) for flag in estimator.flags],
            }.items():
                rows.setdefault(name, []).append(np.array(value, dtype=float))
            x = now.A @ x + now.B @ acting + now.E @ w + now.a
        return {name: np.array(values) for name, values in rows.items()}
