"""Scenario A, the promise in numbers: with FTC as good as knowing the fault, without it ten times worse.

promise: known-fault
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

import commands
import design_file

if TYPE_CHECKING:
    from pathlib import Path

RUNS = [
    pytest.param(disturbed, reference, noise, id=f"{disturbed}-{reference}-{noise}")
    for disturbed in ("state", "output")
    for reference in design_file.REFERENCES
    for noise in (0.0, 0.005)
]


def _run(folder: Path, disturbed: str, reference: str, noise: float) -> commands.Run:
    design = design_file.scenario_a(disturbed=disturbed, reference=reference, noise=noise)
    return commands.simulate(design_file.write(design, folder), folder)


def _recently(happening: np.ndarray, samples: int) -> np.ndarray:
    """Says of each sample whether `happening` was true in it or in one of the `samples` before it."""
    before = np.zeros((samples, happening.shape[1]), dtype=bool)
    return sliding_window_view(np.vstack([before, happening]), samples + 1, axis=0).any(axis=-1)


@pytest.mark.parametrize(("disturbed", "reference", "noise"), RUNS)
def test_tracking(tmp_path: Path, disturbed: str, reference: str, noise: float) -> None:
    """True mean square error: at most 1.05 times that of a controller told the fault; without FTC at least 10 times."""
    metrics = _run(tmp_path, disturbed, reference, noise).metrics
    ftc, without, told = (np.array(metrics[key]["mse"]["true"]) for key in ("ftc", "no_ftc", "told_the_fault"))
    assert (ftc <= 1.05 * told).all()
    assert (without >= 10 * ftc).all()


@pytest.mark.parametrize(("disturbed", "reference", "noise"), RUNS)
def test_no_false_alarm(tmp_path: Path, disturbed: str, reference: str, noise: float) -> None:
    """No flag while there is no fault, but for two samples after a release, and no miss while there is one."""
    signals = _run(tmp_path, disturbed, reference, noise).trajectories
    faulty = signals["f"] != 0.0
    flagged = signals["ftc.fault"] != 0.0
    assert not (flagged & ~_recently(faulty, 2)).any()
    assert not (~flagged & ~_recently(~faulty, 2)).any()


@pytest.mark.parametrize(("disturbed", "reference"), {run.values[:2]: None for run in RUNS})
def test_estimate_without_noise(tmp_path: Path, disturbed: str, reference: str) -> None:
    """The estimate is within 1 % of the fault from two samples after its onset until its end."""
    signals = _run(tmp_path, disturbed, reference, 0.0).trajectories
    fault, estimate = signals["f"], signals["ftc.f_hat"]
    established = (fault != 0.0) & ~_recently(fault == 0.0, 2)
    assert established.any()
    assert (np.abs(estimate - fault)[established] <= 0.01 * np.abs(fault[established])).all()
