"""A step of the FMUs takes no more instructions than it did, within 15 %.

The figures are in instructions.json beside this file; `tests/support/speed.py --renew` counts them anew.

promise: step-cost
"""

from __future__ import annotations

import json
import shutil
from typing import TYPE_CHECKING

import c_host
import pytest
import speed

if TYPE_CHECKING:
    from pathlib import Path

SLACK = 1.15


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind counts the instructions")
@pytest.mark.parametrize("example", speed.EXAMPLES)
def test_a_step_takes_no_more_instructions(tmp_path: Path, example: str) -> None:
    """Controller and plant in their closed loop, by callgrind, which counts the same every time."""
    bounds = json.loads(speed.BOUNDS.read_text())
    for name, found in speed.counted(c_host.build(tmp_path, "speed"), example, tmp_path):
        assert found <= SLACK * bounds[name], (name, found)
        # A count that is far off tells of a step that was not taken.
        assert found >= 0.2 * bounds[name], (name, found)
