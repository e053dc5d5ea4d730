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

import ftc_fmu as ftc
from conftest import EXAMPLES

if TYPE_CHECKING:
    from pathlib import Path


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
    assert figure._repr_png_().startswith(b"\x89PNG"), "a notebook shows it"


def test_what_is_drawn_is_one_of_the_variants(run: ftc.Run) -> None:
    """One needs no list; one that did not run is refused by name."""
    labels = [line.get_label() for line in run.plot("told_the_fault").axes[0].lines]
    assert labels == ["told the true fault", "reference"]
    with pytest.raises(ValueError, match="variants names 'mpc': give some of ftc, no_ftc, told_the_fault"):
        run.plot(["ftc", "mpc"])


def test_one_line(run: ftc.Run, paper: ftc.Design) -> None:
    """For a prompt."""
    assert repr(run) == f"<ftc_fmu.Run: {len(run['t'])} samples, ftc, no_ftc, told_the_fault>"
    assert repr(paper.controller()) == "<ftc_fmu.Controller: 2 sensors, 2 commands, ftc_enabled=True>"


def test_a_missed_fault_is_told() -> None:
    """A drift that could be the plant's is told with what takes it out; where that was done nothing is told."""
    inertia, stiffness, damping = 0.002, 25.0, 0.02

    def drive(load: float) -> tuple:
        A = [
            [-0.03 / inertia, damping / inertia, -stiffness / inertia],
            [damping / load, -0.04 / load, stiffness / load],
            [1.0, -1.0, 0.0],
        ]
        return A, [[1 / inertia, 0.0], [0.0, -1 / load], [0.0, 0.0]], np.eye(2, 3), 0, 0

    plant = ftc.Plant(
        [drive(0.004), drive(0.02)],
        sample_time=0.002,
        disturbance_inputs=[1],
        inputs=[{"name": "torque", "unit": "1", "min": -60.0, "max": 60.0}, "load torque"],
        outputs=[{"name": "motor speed", "nominal": 50.0}, {"name": "load speed", "nominal": 50.0}],
    )
    keys = {"tracked": ["load speed"], "decay": 0.99, "input_weight": 0.3, "scenario": {"noise": 0.05}}
    drift = {"kind": "drift", "sensor": "load speed", "from": 3.0, "until": 4.5, "slope": 5.0}
    scenario = {
        "noise": 0.05,
        "steps": 3000,
        "reference": [{"kind": "steps", "points": [[0.2, 50.0]]}],
        "schedule": [{"from": 0.0, "mode": 1}, {"from": 2.0, "mode": 2}],
        "events": [drift],
    }
    missed = ftc.design(plant, **keys).simulate(scenario)
    (told,) = [warning for warning in missed.warnings if "was missed" in warning]
    assert "a fault of load speed of up to 7.49 was missed in 100.0 %" in told
    assert "trust-model" in told
    assert "on load torque" in str(missed), "the step on a disturbance that has a name"
    assert "model_error" in told
    estimator = {"ambiguous": "trust-model", "model_error": 0.002}
    found = ftc.design(plant, **keys, estimator=estimator).simulate(scenario)
    assert not any("was missed" in warning for warning in found.warnings)
    errors = [run.metrics["ftc"]["mse"]["true"][0] for run in (missed, found)]
    assert errors[1] < 0.95 * errors[0]


def test_another_scenario(paper: ftc.Design) -> None:
    """Same controller, other experiment; a wrong one is refused by key."""
    short = paper.simulate({"steps": 50, "reference": [0.3, 0.3]})
    assert len(short["t"]) == 50
    assert not short["f"].any()
    with pytest.raises(ValueError, match=r"^scenario\.reference has 1 signal:"):
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


def test_the_true_plant_may_be_a_plant(tanks: ftc.Plant) -> None:
    """The same as its matrices, also where the design's file is continuous; another sample time is refused."""
    design = ftc.design(tanks, decay=0.9, scenario={"noise": 0.01, "steps": 60})
    faster = ftc.Plant(
        [(1.1 * mode.A, 0.9 * mode.B, mode.C) for mode in tanks.modes], sample_time=2.0, names=["closed", "open"]
    )
    tables = [{"A": (1.1 * mode.A).tolist(), "B": (0.9 * mode.B).tolist()} for mode in tanks.modes]
    scenario = {"noise": 0.01, "steps": 60}
    runs = [design.simulate(scenario | {"plant": plant}) for plant in (faster, {"mode": tables}, {})]
    found = [run["ftc.y_true"] for run in runs]
    np.testing.assert_array_equal(found[0], found[1])
    assert not np.array_equal(found[0], found[2])
    slow = ftc.Plant([(mode.A, mode.B, mode.C) for mode in tanks.modes], sample_time=4.0)
    with pytest.raises(ftc.DesignFileError, match=r"sample time of 4.0 s, the design one of 2.0 s"):
        design.simulate(scenario | {"plant": slow})


def test_what_happens_too_late_is_said(tanks: ftc.Plant) -> None:
    """A run's own warnings are those of its own scenario."""
    design = ftc.design(tanks, decay=0.9, scenario={"noise": 0.01, "steps": 60})
    late = {"kind": "bias", "sensor": "level 2", "from": 500.0, "size": 1.0}
    run = design.simulate({"noise": 0.01, "steps": 60, "events": [late]})
    assert any("scenario.events[1]: it begins at 500 s" in warning for warning in run.warnings)
    assert not any("scenario.events" in warning for warning in design.warnings)
