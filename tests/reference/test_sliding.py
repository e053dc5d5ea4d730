"""The sliding window as printed, (41)-(46) and (54), a second time: by a singular value decomposition."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import design_file

if TYPE_CHECKING:
    from collections.abc import Callable

# Directions shorter than this share of the longest carry no information, as in the program.
RANK = 1e-9


def residual(U: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """The last column of `Y (I - U' (U U')^+ U)`: what the window's own inputs leave of the newest output."""
    _, s, Vt = np.linalg.svd(U, full_matrices=False)
    V = Vt[s > RANK * s[0]].T
    newest = np.eye(Y.shape[1])[:, -1]
    return Y @ (newest - V @ (V.T @ newest))


def test_the_residual_is_what_the_windows_inputs_leave(make_case: Callable) -> None:
    """In every full window of the loop the residual equals that of the projection, to 1e-7."""
    design = design_file.scenario_a(disturbed="state", reference="square", noise=0.004)
    design["name"] = "sliding"
    design["estimator"] = {"method": "sliding", "response_length": 12, "threshold": 0.2}
    case = make_case(design)
    estimator = case.record["controller"]["estimator"]
    j, L = estimator["response_length"], estimator["window"]
    run = case.run.trajectories
    u, y, mode = run["ftc.u"], run["ftc.y"], run["mode"][:, 0]
    checked = 0
    for k in range(j + L, run.ticks):
        if len(set(mode[k - j - L : k + 1])) > 1:
            continue
        ticks = range(k - L + 1, k + 1)
        U = np.column_stack([u[t - j : t].ravel() for t in ticks])
        np.testing.assert_allclose(
            run["ftc.residual"][k], residual(U, y[k - L + 1 : k + 1].T), atol=1e-7, err_msg=f"tick {k}"
        )
        checked += 1
    assert checked > run.ticks / 2
