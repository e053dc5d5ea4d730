"""The native run against the second implementation: the same trajectories to 1e-9.

promise: second-implementation
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import design_file
import reference_loop

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Case

SHARED = {"mode", "y_ref", "w", "f"}


def assert_agreement(case: Case) -> None:
    """Runs the second implementation on a case's record and compares every signal of every variant."""
    native = case.run.trajectories
    loop = reference_loop.Loop(case.record, native["noise"])
    for variant in reference_loop.VARIANTS:
        ours = loop.run(variant)
        if variant != "ftc":
            del ours["f"]  # the table has it once: what a stuck sensor adds depends on the run
        for name, values in ours.items():
            column = name if name in SHARED else f"{variant}.{name}"
            np.testing.assert_allclose(values, native[column], rtol=1e-9, atol=1e-9, err_msg=column)


def harsh() -> dict:
    """Returns a design whose run goes through every branch: saturation, debounce, harmonics and all fault kinds."""
    design = design_file.scenario_a(disturbed="state", reference="levels", noise=0.004)
    limits = [{"min": -0.4, "max": 0.6}] * 2
    design["name"] = "harsh"
    design["signals"] = {"inputs": limits}
    design["disturbance"]["harmonics"] = 2
    design["estimator"]["debounce"] = 2
    design["scenario"]["events"] = [
        {"sensor": 1, "kind": "dropout", "from": 450.0, "until": 500.0},
        {"sensor": 2, "kind": "stuck", "from": 480.0, "until": 520.0},
        {"sensor": 2, "kind": "drift", "slope": 0.01, "from": 600.0, "until": 640.0},
        {"sensor": 1, "kind": "gain-loss", "loss": 0.4, "from": 700.0, "until": 750.0},
        {"sensor": 1, "kind": "dropout", "from": 780.0, "until": 830.0},
        {"sensor": 2, "kind": "intermittent", "size": 0.3, "period": 20.0, "from": 850.0, "until": 950.0},
    ]
    return design


def displaced() -> dict:
    """Returns a design linearised about operating points, with more states than sensors and one tracked output."""
    design = design_file.scenario_a(disturbed="output", reference="square", noise=0.002)
    design["name"] = "displaced"
    A = [[[0.6, 0.2, 0.0], [-0.1, 0.5, 0.1], [0.0, 0.2, 0.4]], [[0.5, 0.1, 0.1], [0.0, 0.6, -0.2], [0.1, 0.0, 0.3]]]
    B = [[[1.0, 0.0], [0.2, 0.5], [0.0, 1.0]], [[0.8, 0.1], [0.0, 0.7], [0.3, 1.0]]]
    C = [[1.0, 0.0, 0.5], [0.0, 1.0, 0.0]]
    points = [
        {"x": [1.0, 2.0, -1.0], "u": [0.5, -0.5], "y": [3.0, 4.0]},
        {"x": [2.0, 1.0, 0.0], "u": [0.0, 1.0], "y": [5.0, 1.0]},
    ]
    design["mode"] = [
        {"A": a, "B": b, "C": C, "E": [[0.0]] * 3, "F": [[1.0], [0.5]], "operating_point": point}
        for a, b, point in zip(A, B, points, strict=True)
    ]
    design["controller"] |= {"tracked": [2], "decay": 0.95}
    design["scenario"]["reference"] = [{"kind": "square", "amplitude": 0.6, "period": 400.0, "offset": 3.0}]
    return design


@pytest.mark.parametrize("noise", [0.0, 0.005])
@pytest.mark.parametrize("reference", list(design_file.REFERENCES))
@pytest.mark.parametrize("disturbed", ["state", "output"])
def test_scenario_a(make_case: Callable[[dict], Case], disturbed: str, reference: str, noise: float) -> None:
    """Both disturbance channels, every reference, with and without noise."""
    assert_agreement(make_case(design_file.scenario_a(disturbed=disturbed, reference=reference, noise=noise)))


def bumpless() -> dict:
    """Returns a design whose command does not jump at a mode switch."""
    design = design_file.scenario_a(disturbed="state", reference="sine", noise=0.001)
    design["name"] = "bumpless"
    design["controller"] |= {"bumpless": True}
    return design


def resonant() -> dict:
    """Returns a delayed design with an internal model of two harmonics, whose inputs saturate and switch bumplessly."""
    design = design_file.delayed()
    design["name"] = "resonant"
    design["signals"] = {"inputs": [{"min": -1.5, "max": 1.5}] * 2}
    design["disturbance"]["harmonics"] = 2
    design["controller"] |= {"internal_model": True, "decay": 0.98, "bumpless": True}
    return design


def frozen() -> dict:
    """Returns a design that takes exact repetition for silence, and whose command follows (20) as printed."""
    design = harsh()
    design["name"] = "frozen"
    design["controller"] |= {"feedforward": False}
    design["estimator"] |= {"stuck_after": 3}
    return design


@pytest.mark.parametrize(
    "design",
    [harsh(), displaced(), bumpless(), design_file.delayed(), resonant(), frozen()],
    ids=lambda design: design["name"],
)
def test_every_branch_of_the_on_line_path(make_case: Callable[[dict], Case], design: dict) -> None:
    """Saturation, lost and stuck sensors, harmonics, operating points, unequal sizes, bumpless switching, latency."""
    assert_agreement(make_case(design))


@pytest.mark.parametrize("example", ["paper", "paper_output", "paper_internal_model", "tank"])
def test_shipped_example(example_case: Callable[[str], Case], example: str) -> None:
    """The examples a user copies."""
    assert_agreement(example_case(example))
