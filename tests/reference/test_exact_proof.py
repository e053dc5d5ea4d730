"""Claims proved once more in rational arithmetic: the loop formed of the doubles that ship, pivots without rounding.

promise: running-loop
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

import commands
import record
from running_loop import System, channels, rationals

EXAMPLES = ["paper", "paper_output", "paper_latency", "tank", "converter"]


def positive_definite(matrix: np.ndarray) -> bool:
    """Whether a symmetric matrix of fractions is positive definite: Bareiss' elimination, exact."""
    common = math.lcm(*(entry.denominator for entry in matrix.ravel()))
    rows = [[int(entry * common) for entry in row] for row in matrix]
    before = 1
    for k in range(len(rows)):
        pivot = rows[k][k]
        if pivot <= 0:
            return False
        for i in range(k + 1, len(rows)):
            for j in range(i, len(rows)):
                rows[i][j] = (pivot * rows[i][j] - rows[k][i] * rows[k][j]) // before
        before = pivot
    return True


def test_pivots_tell_definite_from_indefinite() -> None:
    """The judge itself."""
    assert positive_definite(rationals([[2.0, 1.0], [1.0, 0.6]]))
    assert not positive_definite(rationals([[2.0, 1.0], [1.0, 0.5]]))
    assert not positive_definite(rationals([[1.0, 2.0], [2.0, 1.0]]))


def bounded_real(loop: System, P: np.ndarray, level: float) -> np.ndarray:
    """Returns [P - A'PA - C'C, -(A'PB + C'D); ., g I - B'PB - D'D] in fractions."""
    n, s = loop.B.shape
    both, signal = np.hstack([loop.A, loop.B]), np.hstack([loop.C, loop.D])
    block = -both.T @ P @ both - signal.T @ signal
    block[:n, :n] += P
    block[n:, n:] += Fraction(level) ** 2 * rationals(np.eye(s))
    return block


def storage(loop: System, level: float) -> np.ndarray:
    """Returns a candidate for the storage function at a level: the Riccati equation of a slightly larger signal."""
    W = solve_discrete_lyapunov(loop.A, loop.B @ loop.B.T / level**2 + 1e-6 * np.eye(len(loop.A)))
    T = np.linalg.cholesky(W)
    A, B = np.linalg.solve(T, loop.A @ T), np.linalg.solve(T, loop.B) / level
    C, D = np.vstack([loop.C @ T, 1e-4 * np.eye(len(T))]), np.vstack([loop.D / level, np.zeros((len(T), B.shape[1]))])
    P = -solve_discrete_are(A, B, -C.T @ C, np.eye(B.shape[1]) - D.T @ D, s=-C.T @ D)
    inverse = np.linalg.inv(T)
    P = inverse.T @ P @ inverse
    return (P + P.T) / 2


@pytest.fixture(scope="module", params=EXAMPLES)
def example(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict:
    """Returns the record of an example."""
    path = commands.ROOT / "examples" / f"{request.param}.toml"
    return record.load(commands.export(path, tmp_path_factory.mktemp(request.param)).controller)


def test_gains_of_the_running_loop(example: dict) -> None:
    """gamma_loop of every mode."""
    for index, level in enumerate(example["proof"]["running_loop"]["gamma_loop"]):
        P = rationals(storage(channels(example, index).disturbance, level * (1 - 1e-5)))
        exact = channels(example, index, exact=True).disturbance
        assert positive_definite(P)
        assert positive_definite(bounded_real(exact, P, level))


def test_gains_below_the_norm_are_not_proved(example: dict) -> None:
    """The judge refuses a level that is too low, whatever the candidate."""
    level = 0.98 * channels(example, 0).disturbance.l2_gain()
    exact = channels(example, 0, exact=True).disturbance
    P = rationals(storage(channels(example, 0).disturbance, 1.1 * level))
    assert not positive_definite(bounded_real(exact, P, level))


def error_maps(design: dict, lost: dict, exact: bool) -> list[np.ndarray]:  # noqa: FBT001
    """Returns A - A H C of every mode for a set of lost sensors."""
    numbers = rationals if exact else np.array
    modes = design["plant"]["modes"]
    parts = [
        (numbers(mode["a"]), numbers(H), numbers(mode["c"])) for mode, H in zip(modes, lost["correction"], strict=True)
    ]
    return [A - A @ H @ C for A, H, C in parts]


def test_observers_without_sensors(example: dict) -> None:
    """One function shrinks under every mode and every served set, where sets may change at each sample."""
    observer = example["controller"]["observer"]
    proof = example["proof"]["observer"]["lost"]
    if observer["minimum_dwell"] > 0 or not observer["lost"]:
        return
    units = np.array(example["proof"]["observer"]["certificate"]["states"])
    P = rationals(np.array(proof["lyapunov"][0][0]) / np.outer(units, units))
    assert positive_definite(P)
    shrink = Fraction(proof["decay"]) ** 2
    for lost in observer["lost"]:
        for error in error_maps(example, lost, exact=True):
            assert positive_definite(shrink * P - error.T @ P @ error)
