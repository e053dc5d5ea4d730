"""Each FMU by itself, as fmpy sees it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

import record

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from conftest import Case

EXAMPLES = ["paper", "paper_output", "paper_internal_model", "tank"]
pytestmark = pytest.mark.parametrize("example", EXAMPLES)


def _columns(result: np.ndarray, name: str, size: int) -> np.ndarray:
    return np.column_stack([result[f"{name}[{i + 1}]"] for i in range(size)])


def _inputs(te: float, signals: dict[str, np.ndarray]) -> np.ndarray:
    """Returns fmpy's input table: one row per tick, each signal held until the next."""
    ticks = len(next(iter(signals.values())))
    columns = {"time": te * np.arange(ticks)}
    for name, values in signals.items():
        if name == "mode":
            columns["mode"] = values[:, 0].astype(np.int32)
        else:
            columns |= {f"{name}[{i + 1}]": values[:, i] for i in range(values.shape[1])}
    table = np.zeros(ticks, dtype=[(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        table[name] = column
    return table


def _simulate(fmu: Path, case: Case, signals: dict[str, np.ndarray], output: list[str]) -> np.ndarray:
    te = record.sample_time(case.record)
    ticks = case.run.trajectories.ticks
    return fmpy.simulate_fmu(
        fmu,
        start_time=0.0,
        stop_time=te * ticks,
        step_size=te,
        output_interval=te,
        input=_inputs(te, signals),
        output=output,
    )


def test_validation_finds_no_problem(example_case: Callable[[str], Case], example: str) -> None:
    """Both model descriptions hold to the standard's rules."""
    fmus = example_case(example).fmus
    assert validate_fmu(fmus.controller) == []
    assert validate_fmu(fmus.plant) == []


def test_controller_alone_replays_its_commands(example_case: Callable[[str], Case], example: str) -> None:
    """Fed the measurements of the native run, the controller gives the native commands."""
    case = example_case(example)
    native = case.run.trajectories
    size = native["ftc.u"].shape[1]
    signals = {"y": native["ftc.y"], "y_ref": native["y_ref"], "mode": native["mode"]}
    result = _simulate(case.fmus.controller, case, signals, [f"u[{i + 1}]" for i in range(size)])
    np.testing.assert_array_equal(_columns(result, "u", size)[1:], native["ftc.u"])


def test_plant_alone_replays_its_motion(example_case: Callable[[str], Case], example: str) -> None:
    """Fed the commands of the native run, the plant gives the native measurements."""
    case = example_case(example)
    native = case.run.trajectories
    size = native["ftc.y"].shape[1]
    result = _simulate(case.fmus.plant, case, {"u": native["ftc.u"]}, [f"y[{i + 1}]" for i in range(size)])
    np.testing.assert_array_equal(_columns(result, "y", size)[:-1], native["ftc.y"])
