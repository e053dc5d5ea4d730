"""The gain synthesis (T2) written down once more, for cvxpy: the optimum that the design must reach."""

from __future__ import annotations

from dataclasses import dataclass

import cvxpy as cp
import numpy as np


@dataclass(frozen=True)
class Task:
    """A switched plant and what is asked of its state feedback."""

    modes: list[dict[str, np.ndarray]]
    sample_time: float
    tracked: list[int]
    latency: int
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
        A=np.block([[A, np.zeros((n, r))], [-task.sample_time * S @ C, np.eye(r)]]),
        B=np.vstack([B, np.zeros((r, m))]),
        E=np.vstack([E, -task.sample_time * S @ F]),
        H=np.block([[wy * S @ C, np.zeros((r, r))], [np.zeros((r, n)), wz * np.eye(r)], [np.zeros((m, n + r))]]),
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


def _least_gain(models: list[Augmented], decay: float, solver: str, options: dict) -> float:
    N, m = models[0].B.shape
    Q = cp.Variable((N, N), symmetric=True)
    g = cp.Variable()
    constraints = [
        block >> 0 for model in models for block in _blocks(model, decay, Q, cp.Variable((m, N)), g)
    ]
    problem = cp.Problem(cp.Minimize(g), constraints)
    problem.solve(solver=solver, **options)
    if problem.status not in {cp.OPTIMAL, cp.OPTIMAL_INACCURATE}:
        raise cp.SolverError(problem.status)
    return float(np.sqrt(problem.value))


def attenuation(task: Task, lyapunov: str, solver: str, **options: float) -> list[float]:
    """Returns the optimal gamma of every mode under a `common` or a `dwell` certificate."""
    models = [augment(task, mode) for mode in task.modes]
    if lyapunov == "common":
        return [_least_gain(models, task.decay, solver, options)] * len(models)
    return [_least_gain([model], task.decay, solver, options) for model in models]
