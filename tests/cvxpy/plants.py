"""Switched plants to design for: the paper's own, and random ones."""

from __future__ import annotations

import numpy as np

from synthesis import Task

PAPER_A = ([[0.6, 0.45], [-0.2, 0.3]], [[0.4, -0.3], [0.11, 0.0]])
PAPER_B = ([[0.0, 1.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 1.0]])


def paper(*, disturbed: str, latency: int, lyapunov: str, decay: float) -> Task:
    """Returns the paper's example A with its one disturbance on the `state` or on the `output`."""
    on, off = np.ones((2, 1)), np.zeros((2, 1))
    E, F = (on, off) if disturbed == "state" else (off, on)
    modes = [
        {"A": np.array(A), "B": np.array(B), "C": np.eye(2), "E": E, "F": F}
        for A, B in zip(PAPER_A, PAPER_B, strict=True)
    ]
    return Task(modes, 1.0, [0, 1], latency, lyapunov, decay, (1.0, 0.3, 0.1))


def random_task(seed: int) -> Task:
    """Returns a stable switched plant of random size whose modes are variations of one another.

    Every state and output is disturbed, which bounds the Lyapunov matrix from below and so makes
    the optimum one that is attained.
    """
    rng = np.random.default_rng(seed)
    n, M = int(rng.integers(1, 7)), int(rng.integers(1, 5))
    m, p = int(rng.integers(1, 4)), int(rng.integers(1, 4))
    r = int(rng.integers(1, min(n, m, p) + 1))
    latency = int(rng.integers(0, 2))
    s = n + int(rng.integers(1, 3))
    A0, B0, C0 = rng.normal(size=(n, n)), rng.normal(size=(n, m)), rng.normal(size=(p, n))
    modes = []
    for _ in range(M):
        A = A0 + 0.2 * rng.normal(size=(n, n))
        A *= rng.uniform(0.5, 0.9) / np.abs(np.linalg.eigvals(A)).max()
        B, C = B0 + 0.2 * rng.normal(size=(n, m)), C0 + 0.2 * rng.normal(size=(p, n))
        modes.append({"A": A, "B": B, "C": C, "E": 0.3 * rng.normal(size=(n, s)), "F": 0.3 * rng.normal(size=(p, s))})
    tracked = sorted(rng.choice(p, r, replace=False).tolist())
    # A command that acts one sample late acts in the next mode: a common Lyapunov matrix seldom exists.
    lyapunov = "dwell" if latency or seed % 2 else "common"
    return Task(modes, float(rng.choice([1.0, 0.1, 0.02])), tracked, latency, lyapunov, 0.98, (1.0, 0.3, 0.1))
