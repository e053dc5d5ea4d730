"""The controller in a NumPy loop is the one that was simulated.

promise: python-same
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    import ftc_fmu as ftc


def test_commands_are_those_of_the_simulation(paper: ftc.Design) -> None:
    """Bit for bit, with faults and a switch, with fault tolerance and without; the plant is NumPy's own."""
    run = paper.simulate()
    for variant, enabled in (("ftc", True), ("no_ftc", False)):
        controller = paper.controller()
        controller.ftc_enabled = enabled
        for k, mode in enumerate(run["mode"].astype(int)):
            u = controller.step(run[f"{variant}.y"][k], run["y_ref"][k], mode)
            assert u.tobytes() == run[f"{variant}.u"][k].tobytes(), (variant, k)
            assert controller.f_hat.tobytes() == run[f"{variant}.f_hat"][k].tobytes()
            assert controller.x_hat.tobytes() == run[f"{variant}.x_hat"][k].tobytes()
        np.testing.assert_array_equal(controller.fault, run[f"{variant}.fault"][-1].astype(bool))
        np.testing.assert_array_equal(controller.residual, run[f"{variant}.residual"][-1])


def test_a_copy_goes_its_own_way(paper: ftc.Design) -> None:
    """And a reset begins anew."""
    controller = paper.controller()
    first = controller.step([0.1, 0.2], [0.5, 0.5])
    other = controller.copy()
    np.testing.assert_array_equal(controller.step([0.3, 0.1], [0.5, 0.5]), other.step([0.3, 0.1], [0.5, 0.5]))
    other.step([9.0, 9.0], [0.5, 0.5])
    assert not np.array_equal(controller.u, other.u)
    controller.reset()
    np.testing.assert_array_equal(controller.step([0.1, 0.2], [0.5, 0.5]), first)


def test_a_reading_that_is_no_number_is_a_fault(paper: ftc.Design) -> None:
    """The command stays finite."""
    controller = paper.controller()
    for _ in range(100):
        controller.step([0.0, 0.0], [0.5, 0.5])
    assert np.isfinite(controller.step([np.nan, 0.0], [0.5, 0.5])).all()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (([0.1], [0.5, 0.5]), "y has 1 values: give 2"),
        (([0.1, 0.2], [0.5]), "y_ref has 1 values: give 2"),
        (([0.1, 0.2], [0.5, 0.5], 3), "mode is 3: give one of 1 to 2"),
        (([0.1, 0.2], [np.inf, 0.5]), "give a finite number"),
        (([0.1, 0.2], [0.5, 0.5], 1.5), "mode is 1.5: give a whole number"),
        (([0.1, 0.2], [0.5, 0.5], "closed"), "mode is 'closed': give a whole number"),
        (("ab", [0.5, 0.5]), "y is no array of numbers"),
        (([0.1, 0.2], [0.5j, 0.5]), "y_ref has complex entries"),
    ],
)
def test_wrong_sizes_are_refused(paper: ftc.Design, arguments: tuple, says: str) -> None:
    """And leave the controller as it was."""
    controller = paper.controller()
    with pytest.raises(ValueError, match=says):
        controller.step(*arguments)
    np.testing.assert_array_equal(controller.u, paper.controller().u)
