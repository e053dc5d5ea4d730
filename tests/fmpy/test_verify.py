"""`verify` runs the binary that ships: it is the design's controller to the bit, and another one is found out.

promise: carried-proof
"""

from __future__ import annotations

import json
import zipfile
from typing import TYPE_CHECKING

import pytest

import commands

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from conftest import Case

EXAMPLES = ["paper", "paper_internal_model", "paper_latency", "tank", "converter", "logged"]


@pytest.mark.parametrize("example", EXAMPLES)
def test_the_binary_is_that_of_the_design(example_case: Callable[[str], Case], example: str) -> None:
    """Both FMUs verify; the controller's binary was run for hundreds of ticks."""
    fmus = example_case(example).fmus
    report = json.loads(commands.ftc_fmu("verify", fmus.controller, "--json"))
    assert report["ran"]["agrees"] >= 300
    assert json.loads(commands.ftc_fmu("verify", fmus.plant, "--json"))["ran"].keys() == {"not_run"}
    unrun = json.loads(commands.ftc_fmu("verify", fmus.controller, "--json", "--no-run"))
    assert unrun["ran"].keys() == {"not_run"}


def test_the_binary_of_another_fmu_is_found_out(example_case: Callable[[str], Case], tmp_path: Path) -> None:
    """The plant's binary in the controller's place, with everything else as it was."""
    fmus = example_case("paper").fmus
    with zipfile.ZipFile(fmus.plant) as plant:
        (other,) = (plant.read(name) for name in plant.namelist() if name.endswith("linux64/paper_plant.so"))
    changed = tmp_path / "changed.fmu"
    with zipfile.ZipFile(fmus.controller) as source, zipfile.ZipFile(changed, "w") as target:
        for name in source.namelist():
            target.writestr(name, other if name.endswith("linux64/paper_controller.so") else source.read(name))
    commands.ftc_fmu("verify", changed, "--no-run")
    with pytest.raises(commands.Refused, match="the binary for linux64"):
        commands.ftc_fmu("verify", changed)
