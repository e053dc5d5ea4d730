"""Two FMUs and a master: the same numbers as the native run, whatever the master's habits.

promise: same-as-native
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import design_file
import fmu_loop
from fmu_loop import Schedule

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Case

EXAMPLES = ["paper", "paper_output", "paper_internal_model", "tank"]


@pytest.mark.parametrize("example", EXAMPLES)
@pytest.mark.parametrize("variant", ["ftc", "no_ftc"])
def test_the_loop_is_the_native_run(example_case: Callable[[str], Case], example: str, variant: str) -> None:
    """Bit for bit, with the compensation on and off."""
    case = example_case(example)
    native = case.run.trajectories
    loop = fmu_loop.run(case.fmus, native.ticks, ftc_enabled=variant == "ftc")
    assert fmu_loop.differing(loop, native, variant) == []


@pytest.mark.parametrize("disturbed", ["state", "output"])
def test_noise_is_the_same_noise(make_case: Callable[[dict], Case], disturbed: str) -> None:
    """The plant FMU draws the very noise of the native run."""
    case = make_case(design_file.scenario_a(disturbed=disturbed, reference="sine", noise=0.005))
    loop = fmu_loop.run(case.fmus, case.run.trajectories.ticks)
    assert fmu_loop.differing(loop, case.run.trajectories, "ftc") == []


def test_parallel_stepping(make_case: Callable[[dict], Case]) -> None:
    """A master that steps both FMUs from the same old signals adds the one sample a latency-1 design expects."""
    case = make_case(design_file.delayed())
    loop = fmu_loop.run(case.fmus, case.run.trajectories.ticks, Schedule(parallel=True))
    assert fmu_loop.differing(loop, case.run.trajectories, "ftc") == []


def test_late_start(example_case: Callable[[str], Case]) -> None:
    """Ticks count from the start time, so a run that starts late is the same run."""
    case = example_case("paper")
    loop = fmu_loop.run(case.fmus, 300, Schedule(start_time=1234.5))
    assert fmu_loop.differing(loop, case.run.trajectories, "ftc") == []


def test_seven_steps_a_sample(example_case: Callable[[str], Case]) -> None:
    """Communication points between ticks change nothing."""
    case = example_case("paper")
    ticks = case.run.trajectories.ticks
    loop = fmu_loop.run(case.fmus, 7 * ticks, Schedule(step=1 / 7))
    at_ticks = {name: values[::7] for name, values in loop.items()}
    assert fmu_loop.differing(at_ticks, case.run.trajectories, "ftc") == []


def test_three_and_a_half_samples_a_step(example_case: Callable[[str], Case]) -> None:
    """A long step is what as many short ones with held inputs are."""
    fmus = example_case("paper").fmus
    long = fmu_loop.run(fmus, 100, Schedule(step=3.5))
    short = fmu_loop.run(fmus, 700, Schedule(step=0.5, exchange_every=7))
    for name, values in long.items():
        np.testing.assert_array_equal(values, short[name], err_msg=name)
