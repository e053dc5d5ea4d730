"""The gain synthesis (T2) written down once more, for cvxpy: the optimum that the design must reach.

Two things make the optimum sharp to six digits where a plain solve gives three or four: the
integrator is measured in sample times (Z / Te), and the problem is solved a second time in
coordinates in which the first answer's Lyapunov matrix is the identity. The answer is CVXOPT's
wherever it converges; the software under test uses another solver (Clarabel), to which this
module turns only where CVXOPT and SDPA both give up.
"""

from __future__ import annotations

import contextlib
import math
import warnings
from dataclasses import dataclass

import cvxpy as cp
import numpy as np

OPTIONS = {"CVXOPT": {"kktsolver": "robust"}, "SDPA": {}, "CLARABEL": {}}
# An inaccurate first answer still gives good coordinates; only SDPA's own notion of accuracy is that strict.
ACCEPTED = {
    "CVXOPT": {cp.OPTIMAL},
    "SDPA": {cp.OPTIMAL, cp.OPTIMAL_INACCURATE},
    "CLARABEL": {cp.OPTIMAL},
}


@dataclass(frozen=True)
class Task:
    """A switched plant and what is asked of its state feedback."""

    modes: list[dict[str, np.ndarray]]
    sample_time: float
    tracked: list[int]
    latency: int
    lyapunov: str
    decay: float
    weights: tuple[float, float, float]


@dataclass(frozen=True)
class Augmented:
    """One mode with input memory and integrators: X+ = A X + B u + E w, v = H X + D u."""

    A: np.ndarray
    B: np.ndarray
    E: np.ndarray
    H: np.ndarray
    D: np.ndarray


def augment(task: Task, mode: dict[str, np.ndarray]) -> Augmented:
    """Appends the command still acting (latency 1) and the tracking-error integrals to a mode."""
    A, B, C, E, F = (mode[key] for key in "ABCEF")
    S = np.eye(len(C))[task.tracked]
    (n, m), r, s = B.shape, len(S), E.shape[1]
    if task.latency:
        A = np.block([[A, B], [np.zeros((m, n + m))]])
        B = np.vstack([np.zeros((n, m)), np.eye(m)])
        C = np.hstack([C, np.zeros((len(C), m))])
        E = np.vstack([E, np.zeros((m, s))])
        n += m
    wy, wz, wu = task.weights
    return Augmented(
        A=np.block([[A, np.zeros((n, r))], [-S @ C, np.eye(r)]]),
        B=np.vstack([B, np.zeros((r, m))]),
        E=np.vstack([E, -S @ F]),
        H=np.block(
            [
                [wy * S @ C, np.zeros((r, r))],
                [np.zeros((r, n)), wz * task.sample_time * np.eye(r)],
                [np.zeros((m, n + r))],
            ]
        ),
        D=np.vstack([np.zeros((2 * r, m)), wu * np.eye(m)]),
    )


def _blocks(model: Augmented, decay: float, Q: cp.Variable, R: cp.Variable, g: cp.Variable) -> list[cp.Expression]:
    """Returns the two symmetric blocks of (T2) with G = S = Q."""
    (N, s), v = model.E.shape, len(model.H)
    closed = model.A @ Q + model.B @ R
    seen = model.H @ Q + model.D @ R
    zero = np.zeros
    gain = cp.bmat(
        [
            [Q, zero((N, s)), closed.T, seen.T],
            [zero((s, N)), g * np.eye(s), model.E.T, zero((s, v))],
            [closed, model.E, Q, zero((N, v))],
            [seen, zero((v, s)), zero((v, N)), np.eye(v)],
        ]
    )
    shrink = cp.bmat([[decay**2 * Q, closed.T], [closed, Q]])
    return [(block + block.T) / 2 for block in (gain, shrink)]


class NoSolverConverged(RuntimeError):
    """Every solver gave up on the problem, which is then most likely infeasible."""


def problem(models: list[Augmented], decay: float) -> tuple[cp.Problem, cp.Variable]:
    """Returns (T2) with one Lyapunov matrix Q for these modes, and Q."""
    N, m = models[0].B.shape
    Q = cp.Variable((N, N), symmetric=True)
    g = cp.Variable()
    constraints = [block >> 0 for model in models for block in _blocks(model, decay, Q, cp.Variable((m, N)), g)]
    return cp.Problem(cp.Minimize(g), constraints), Q


def _solve(models: list[Augmented], decay: float, solvers: tuple[str, ...]) -> tuple[float, np.ndarray]:
    """Returns the least g = gamma^2 with its Q, from the first solver that converges."""
    task, Q = problem(models, decay)
    for solver in solvers:
        with warnings.catch_warnings(), contextlib.suppress(cp.SolverError):
            warnings.simplefilter("ignore")  # cvxpy warns of inaccuracy, which the status tells as well
            task.solve(solver=solver, **OPTIONS[solver])
            if task.status in ACCEPTED[solver]:
                return float(task.value), Q.value
    raise NoSolverConverged(task.status)


def in_coordinates(model: Augmented, T: np.ndarray) -> Augmented:
    """Returns the model in the state X' with X = T X'."""
    inverse = np.linalg.inv(T)
    return Augmented(inverse @ model.A @ T, inverse @ model.B, inverse @ model.E, model.H @ T, model.D)


def _least_gain(models: list[Augmented], decay: float) -> float:
    _, Q = _solve(models, decay, ("SDPA", "CLARABEL"))
    values, vectors = np.linalg.eigh(Q)
    T = vectors * np.sqrt(np.maximum(values, 1e-9 * values.max()))
    balanced = [in_coordinates(model, T) for model in models]
    return math.sqrt(_solve(balanced, decay, ("CVXOPT", "SDPA", "CLARABEL"))[0])


def attenuation(task: Task) -> list[float]:
    """Returns the optimal gamma of every mode under the task's certificate, `common` or `dwell`."""
    models = [augment(task, mode) for mode in task.modes]
    if task.lyapunov == "common":
        return [_least_gain(models, task.decay)] * len(models)
    return [_least_gain([model], task.decay) for model in models]


def closed_loop(model: Augmented, gain: np.ndarray) -> Augmented:
    """Returns the model under u = gain X: no input is left."""
    none = np.zeros((len(model.A), 0)), np.zeros((len(model.H), 0))
    return Augmented(model.A + model.B @ gain, none[0], model.E, model.H + model.D @ gain, none[1])
