"""Designs of all sizes: each a valid pair of FMUs, and a loop that equals the native one.

promise: all-sizes
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import sizes
from fmpy.validation import validate_fmu

import fmu_loop

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Case


def test_every_dimension_varies() -> None:
    """The ten plants are what they are called, and no two of their dimensions go together."""
    assert len(sizes.ALL) == 10
    for one in sizes.ALL:
        counts = (one.states, one.inputs, one.outputs, one.modes)
        assert len(set(counts)) == len(counts)
        assert len(sizes.design(one)["mode"]) == one.modes


@pytest.mark.parametrize("of", sizes.ALL, ids=str)
def test_a_pair_of_any_size(make_case: Callable[[dict], Case], of: sizes.Sizes) -> None:
    """Both descriptions are valid, and the loop in fmpy is the native run bit for bit."""
    case = make_case(sizes.design(of))
    assert validate_fmu(case.fmus.controller) == []
    assert validate_fmu(case.fmus.plant) == []
    loop = fmu_loop.run(case.fmus, case.run.trajectories.ticks)
    assert fmu_loop.differing(loop, case.run.trajectories, "ftc") == []
