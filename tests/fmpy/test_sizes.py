"""Designs of all sizes: each a valid pair of FMUs, and a loop that equals the native one.

promise: all-sizes
"""

from __future__ import annotations

import zipfile
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


def test_an_fmu_is_small(make_case: Callable[[dict], Case]) -> None:
    """An FMU for one platform of a plant of four states, licence texts and documentation included.

    promise: small-fmu
    """
    (four,) = (one for one in sizes.ALL if one.states == 4)
    fmus = make_case(sizes.design(four)).fmus
    for fmu in (fmus.controller, fmus.plant):
        with zipfile.ZipFile(fmu) as archive:
            binaries = [name for name in archive.namelist() if name.startswith("binaries/linux64/")]
            others = sum(e.compress_size for e in archive.infolist() if e.filename.startswith("binaries/"))
            one = sum(archive.getinfo(name).compress_size for name in binaries)
        assert fmu.stat().st_size - others + one < 700_000, fmu


@pytest.mark.parametrize("of", sizes.ALL, ids=str)
def test_a_pair_of_any_size(make_case: Callable[[dict], Case], of: sizes.Sizes) -> None:
    """Both descriptions are valid, and the loop in fmpy is the native run bit for bit."""
    case = make_case(sizes.design(of))
    assert validate_fmu(case.fmus.controller) == []
    assert validate_fmu(case.fmus.plant) == []
    loop = fmu_loop.run(case.fmus, case.run.trajectories.ticks)
    assert fmu_loop.differing(loop, case.run.trajectories, "ftc") == []
