"""Simulated experiments as arrays, tables and pictures.

promise: python-same
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest

from conftest import EXAMPLES

if TYPE_CHECKING:
    from pathlib import Path

    import ftc_fmu as ftc


@pytest.fixture(scope="module")
def run(paper: ftc.Design) -> ftc.Run:
    """The paper's experiment."""
    return paper.simulate()


def test_numbers_are_those_of_the_program(run: ftc.Run, tmp_path: Path) -> None:
    """Every column of its table, bit for bit, and its figures of merit."""
    command = [sys.executable, "-m", "ftc_fmu", "--quiet", "simulate", EXAMPLES / "paper.toml", "--out", tmp_path]
    subprocess.run(command, check=True)
    with (tmp_path / "trajectories.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    frame = run.to_pandas()
    for name, column in zip(header, zip(*rows, strict=True), strict=True):
        values = frame.index if name == "t" else frame[name]
        np.testing.assert_array_equal(values.to_numpy(), np.array(column, dtype=float), err_msg=name)
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    tried = json.loads((tmp_path / "robustness.json").read_text())
    assert metrics.pop("warnings") + tried["warnings"] == run.warnings
    assert metrics == run.metrics
    assert all(f"warning: {warning}\n" in str(run) for warning in run.warnings)


def test_xarray(run: ftc.Run) -> None:
    """Variants and channels are dimensions."""
    data = run.to_xarray()
    picked = data["y_true"].sel(variant="ftc", output=2).to_numpy()
    np.testing.assert_array_equal(picked, run["ftc.y_true"][:, 1])
    assert data["u"].dims == ("variant", "t", "input")
    assert data["t"].attrs["units"] == "s"


def test_a_picture_shows_outputs_and_faults(run: ftc.Run, tmp_path: Path) -> None:
    """One panel per tracked output, one for the faults."""
    figure = run.plot()
    assert len(figure.axes) == 3
    drawn = figure.axes[0].lines
    labels = [line.get_label() for line in drawn]
    assert "fault-tolerant" in labels
    assert "reference" in labels
    values = drawn[labels.index("fault-tolerant")].get_ydata()
    np.testing.assert_array_equal(values, run["ftc.y_true"][:, 0])
    figure.savefig(tmp_path / "run.png")


def test_another_scenario(paper: ftc.Design) -> None:
    """Same controller, other experiment; a wrong one is refused by key."""
    short = paper.simulate({"steps": 50, "reference": [0.3, 0.3]})
    assert len(short["t"]) == 50
    assert not short["f"].any()
    with pytest.raises(ValueError, match=r"^scenario\.reference has 1 signals"):
        paper.simulate({"reference": [0.3]})
    assert len(paper.simulate()["t"]) == 1600


def test_an_unknown_signal_is_told_the_known_ones(run: ftc.Run) -> None:
    """By a KeyError."""
    with pytest.raises(KeyError, match=r"ftc\.y_true"):
        run["y_true"]


def test_baselines(paper: ftc.Design) -> None:
    """Two more variants."""
    run = paper.simulate({"steps": 60}, baselines=True)
    assert run.variants == ["ftc", "no_ftc", "told_the_fault", "additive", "mpc"]
    assert "deadbeat_bound" in run.metrics


def test_page(run: ftc.Run) -> None:
    """The report in a notebook."""
    assert "<svg" in run._repr_html_()
    assert "told_the_fault" in str(run)
