"""The loop a controller closes, written out from the shipped numbers: plant, observer, integral part, latency.

State: the plant's state, the acting command (latency 1), the integral part, the observer's prediction and its pending
injection. Nothing is a difference of estimate and state here, so the equations share no algebra with the program's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from scipy.linalg import block_diag, solve_discrete_lyapunov


@dataclass(frozen=True)
class System:
    """x+ = A x + B w, z = C x + D w."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray

    @property
    def radius(self) -> float:
        """The largest magnitude of an eigenvalue."""
        return float(np.abs(np.linalg.eigvals(self.A)).max())

    def l2_gain(self) -> float:
        """Returns the largest singular value over a grid of frequencies that is dense around every eigenvalue."""
        poles = np.linalg.eigvals(self.A)
        near = [np.clip(np.abs(np.angle(p)) + (1 - abs(p)) * np.linspace(-2, 2, 41), 0, np.pi) for p in poles]
        grid = np.concatenate([np.logspace(-7, 0, 400) * np.pi, np.linspace(0, np.pi, 400), *near])
        eye = np.eye(len(self.A))
        return max(
            np.linalg.norm(self.C @ np.linalg.solve(np.exp(1j * angle) * eye - self.A, self.B) + self.D, 2)
            for angle in grid
        )

    def noise_gain(self) -> float:
        """Returns the root of the summed mean squares of the output under white noise of deviation one."""
        covariance = solve_discrete_lyapunov(self.A, self.B @ self.B.T)
        return float(np.sqrt(np.trace(self.C @ covariance @ self.C.T + self.D @ self.D.T)))


@dataclass(frozen=True)
class Channels:
    """The channels of one mode's loop."""

    disturbance: System
    error_from_sensors: System
    command_from_sensors: System


def integral_part(feedback: dict, sample_time: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns the autonomous matrix of the integral part and how a tracking error drives it."""
    r = len(feedback["tracked"])
    blocks, drive = [np.eye(r)], [sample_time * np.eye(r)]
    for angle in feedback["resonators"]:
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        for row in range(r):
            blocks.append(turn)
            drive.append(sample_time * np.outer([1.0, 0.0], np.eye(r)[row]))
    return block_diag(*blocks), np.vstack(drive)


def disturbance_of(modes: list[dict], mode: dict) -> tuple[np.ndarray, np.ndarray]:
    """Returns E and F; those of a disturbance at the inputs where no mode knows any."""
    shape = np.array(mode["b"]).shape[1]
    known = any(np.any(np.array(m[key])) for m in modes for key in ("e", "f"))
    if known:
        return np.array(mode["e"]), np.array(mode["f"])
    return np.array(mode["b"]), np.zeros((len(mode["c"]), shape))


def _floats(values: object) -> np.ndarray:
    return np.array(values, dtype=float)


def rationals(values: object) -> np.ndarray:
    """Returns the very numbers that doubles stand for."""
    floats = np.array(values, dtype=float)
    exact = np.empty(floats.shape, dtype=object)
    for at, value in np.ndenumerate(floats):
        exact[at] = Fraction(float(value))
    return exact


def channels(design: dict, index: int, lost: dict | None = None, *, exact: bool = False) -> Channels:
    """Returns the loop of a mode that lasts.

    Args:
        design: The record.
        index: Which mode, from 0.
        lost: An entry of the observer's sets of lost sensors.
        exact: Whether to form it of rational numbers, without rounding.
    """
    numbers = rationals if exact else _floats
    controller = design["controller"]
    plant, feedback, observer = design["plant"], controller["feedback"], controller["observer"]
    mode, gains = plant["modes"][index], feedback["modes"][index]
    A, B, C = (numbers(mode[key]) for key in "abc")
    E, F = map(numbers, disturbance_of(plant["modes"], mode))
    n, m, p = len(A), B.shape[1], len(C)
    tracked, late = feedback["tracked"], feedback["latency"]
    R, J = map(numbers, integral_part(feedback, plant["sample_time"]))
    q = len(R)
    K, G = numbers(gains["state_feedback"]), numbers(gains["integral"])
    V = numbers(np.array(gains["previous_input"]).reshape(m, -1))
    H = numbers(lost["correction"][index] if lost else observer["decoupling"][index][index])
    L = numbers(np.zeros((n, p)) if lost else observer["gains"][index])
    silent = numbers(np.diag([1.0 if lost and k in lost["sensors"] else 0.0 for k in range(p)]))

    # Rows that pick each part of the state [x, acting, Z, prior, injection] and of the inputs [w, v].
    # Without an injection in any mode its part of the state stays zero and is left out.
    injected = not lost and any(np.any(gain) for gain in observer["gains"])
    sizes = [n, m * late, q, n, n if injected else 0]
    whole = numbers(np.eye(sum(sizes) + E.shape[1] + p))
    rows = np.split(whole[: sum(sizes)], np.cumsum(sizes)[:-1])
    x, acting, Z, prior, injection = rows
    inputs = whole[sum(sizes) :]
    w, v = inputs[: E.shape[1]], inputs[E.shape[1] :]

    y = C @ x + F @ w + v
    estimate = prior + H @ (y - C @ prior) + (injection if len(injection) else 0)
    reading = (numbers(np.eye(p)) - silent) @ y + silent @ (C @ estimate)
    u = K @ estimate + G @ Z + (V @ acting if late else 0)
    used = acting if late else u
    following = np.vstack(
        [
            A @ x + B @ used + E @ w,
            u if late else whole[:0],
            R @ Z - J @ reading[tracked],
            A @ estimate + B @ used,
            L @ (y - C @ estimate) if len(injection) else whole[:0],
        ]
    )
    spec = design["proof"]["state_feedback"]
    weight = np.concatenate(
        [spec["integral_weight"], *[np.repeat(spec["integral_weight"], 2)] * len(feedback["resonators"])]
    )
    seen = (C @ x)[tracked]
    z = np.vstack(
        [
            numbers(np.diag(spec["output_weight"])) @ seen,
            numbers(np.diag(weight)) @ Z,
            numbers(np.diag(spec["input_weight"])) @ u,
        ]
    )
    N, s = sum(sizes), E.shape[1]

    def system(output: np.ndarray, first: int, last: int) -> System:
        return System(
            following[:, :N], following[:, N + first : N + last], output[:, :N], output[:, N + first : N + last]
        )

    return Channels(system(z, 0, s), system(seen, s, s + p), system(u, s, s + p))


def observable(A: np.ndarray, C: np.ndarray) -> bool:
    """Whether the rows of C show the whole state (Hautus' test)."""
    n = len(A)
    return all(
        np.linalg.svd(np.vstack([pole * np.eye(n) - A, C]), compute_uv=False)[n - 1] > 1e-8
        for pole in np.linalg.eigvals(A)
    )


def detectable(A: np.ndarray, C: np.ndarray) -> bool:
    """Whether the rows of C show every part of the state that does not vanish by itself."""
    n = len(A)
    return all(
        abs(pole) < 1 or np.linalg.svd(np.vstack([pole * np.eye(n) - A, C]), compute_uv=False)[n - 1] > 1e-8
        for pole in np.linalg.eigvals(A)
    )


@dataclass(frozen=True)
class Measured:
    """x+ = A x + B u + E w, z = H x + D u with the augmented state [x, acting command, integral part], and u = K x."""

    A: np.ndarray
    B: np.ndarray
    E: np.ndarray
    H: np.ndarray
    D: np.ndarray
    K: np.ndarray

    @property
    def closed(self) -> tuple[np.ndarray, np.ndarray]:
        """A + B K and H + D K."""
        return self.A + self.B @ self.K, self.H + self.D @ self.K


def measured(design: dict, index: int) -> Measured:
    """Returns a mode of the augmented model with its gain, in rational numbers."""
    plant, feedback = design["plant"], design["controller"]["feedback"]
    mode, gains = plant["modes"][index], feedback["modes"][index]
    A, B, C = (rationals(mode[key]) for key in "abc")
    E, F = map(rationals, disturbance_of(plant["modes"], mode))
    R, J = map(rationals, integral_part(feedback, plant["sample_time"]))
    tracked, late = feedback["tracked"], feedback["latency"]
    n, m, q = len(A), B.shape[1], len(R)
    none = lambda rows, columns: rationals(np.zeros((rows, columns)))  # noqa: E731
    waiting = m * late
    if late:
        state, command = np.hstack([A, B, none(n, q)]), none(n, m)
    else:
        state, command = np.hstack([A, none(n, q)]), B
    spec = design["proof"]["state_feedback"]
    weight = np.concatenate(
        [spec["integral_weight"], *[np.repeat(spec["integral_weight"], 2)] * len(feedback["resonators"])]
    )
    seen = np.hstack([rationals(np.diag(spec["output_weight"])) @ C[tracked], none(len(tracked), waiting + q)])
    kept = np.hstack([none(q, n + waiting), rationals(np.diag(weight))])
    gain = [rationals(gains["state_feedback"]), rationals(gains["integral"])]
    if late:
        gain.insert(1, rationals(gains["previous_input"]))
    return Measured(
        np.vstack([state, none(waiting, n + waiting + q), np.hstack([-J @ C[tracked], none(q, waiting), R])]),
        np.vstack([command, rationals(np.eye(waiting, m)), none(q, m)]),
        np.vstack([E, none(waiting, E.shape[1]), -J @ F[tracked]]),
        np.vstack([seen, kept, none(m, n + waiting + q)]),
        np.vstack([none(len(tracked) + q, m), rationals(np.diag(spec["input_weight"]))]),
        np.hstack(gain),
    )


def observer_error(design: dict, index: int, following: int) -> np.ndarray:
    """Returns how the observer's error runs from a mode into the next, in rational numbers."""
    observer = design["controller"]["observer"]
    own, entered = (design["plant"]["modes"][k] for k in (index, following))
    A, C = rationals(own["a"]), rationals(own["c"])
    if observer["kind"] == "kalman":
        return A - A @ rationals(observer["decoupling"][index][index]) @ C
    H, L = rationals(observer["decoupling"][index][following]), rationals(observer["gains"][index])
    return A - H @ rationals(entered["c"]) @ A - L @ C
