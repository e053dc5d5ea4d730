"""A controller that is told no mode: what its FMU offers, and that it closes the loop as the native run does.

promise: estimated-mode
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pytest

import commands
import design_file
import fmu_loop

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from conftest import Case


@pytest.fixture(scope="module")
def case(make_case: Callable[[dict], Case]) -> Case:
    """Scenario A with noise, its mode found from the readings."""
    design = design_file.scenario_a(disturbed="state", reference="sine", noise=0.005)
    design["estimator"] = {"method": "observer", "mode": "estimated"}
    return make_case(design)


def test_the_controller_asks_for_no_mode(case: Case) -> None:
    """In place of the inputs there are outputs, each with a Real twin."""
    controller = fmu_loop.Slave(case.fmus.controller, "controller")
    causality = {v.name: v.causality for v in controller.description.modelVariables}
    assert "mode" not in causality
    assert "mode_real" not in causality
    names = ["mode_hat", "mode_hat_real", "mode_probability[1]", "mode_probability[2]"]
    assert [causality[name] for name in names] == ["output"] * 4


def test_the_loop_is_the_native_run(case: Case) -> None:
    """Bit for bit, the mode found included; and the mode found is nearly always the plant's."""
    native = case.run.trajectories
    loop = fmu_loop.run(case.fmus, native.ticks)
    assert fmu_loop.differing(loop, native, "ftc") == []
    np.testing.assert_array_equal(loop["mode_hat"][:, 0], native["ftc.mode_hat"][:, 0])
    np.testing.assert_array_equal(loop["mode_hat"], loop["mode_hat_real"])
    probability = loop["mode_probability"]
    np.testing.assert_allclose(probability.sum(axis=1), 1.0, rtol=1e-12)
    assert np.sum(loop["mode_hat"] != loop["mode"]) <= 5


@pytest.mark.parametrize(
    ("estimator", "sentence"),
    [
        ({"method": "reference", "mode": "estimated"}, 'mode = "estimated" is for method = "observer" only'),
        ({"mode_length": 300}, "mode_length is given, but the mode is told"),
        ({"mode": "estimated", "mode_length": 1}, "mode_length is 1: give a number from 2 to"),
        ({"mode": "guessed"}, "guessed"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, estimator: dict, sentence: str) -> None:
    """By key."""
    design = design_file.scenario_a(disturbed="state", reference="sine", noise=0.005)
    design["estimator"] = estimator
    with pytest.raises(commands.Refused, match=re.escape(sentence)):
        commands.ftc_fmu("design", design_file.write(design, tmp_path))
