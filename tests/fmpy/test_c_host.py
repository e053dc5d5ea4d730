"""A C program drives the exported FMUs: nothing depends on Rust or Python."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import c_host
import pytest

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from conftest import Case


@pytest.mark.parametrize("which", ["controller", "plant"])
@pytest.mark.parametrize("start", [0.0, -1e9, 1e9])
def test_every_life_of_an_instance(
    tmp_path: Path, example_case: Callable[[str], Case], which: str, start: float
) -> None:
    """Saved, restored, reset, doubled, unloaded and loaded again: the same bits, whatever the start time."""
    fmu = getattr(example_case("paper").fmus, which)
    program = c_host.build(tmp_path)
    lines = c_host.drive(program, fmu, start=start).splitlines()
    assert len(lines) == 400
    assert lines == c_host.drive(program, fmu, start=0.0).splitlines()


def test_eight_threads_at_once(tmp_path: Path, example_case: Callable[[str], Case]) -> None:
    """Loops in eight threads give the bits of one by itself.

    promise: independent-instances
    """
    assert c_host.close_in_threads(example_case("paper").fmus, tmp_path).startswith("8 threads")


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind watches the memory")
@pytest.mark.parametrize("which", ["controller", "plant"])
def test_no_bad_access_and_no_leak(tmp_path: Path, example_case: Callable[[str], Case], which: str) -> None:
    """Memcheck, which ends with an error for either, has nothing to say of the whole run.

    promise: memory-safety
    """
    fmu = getattr(example_case("paper").fmus, which)
    lines = c_host.drive(c_host.build(tmp_path), fmu, count=c_host.STEPS, under=c_host.MEMCHECK)
    assert len(lines.splitlines()) == c_host.STEPS


@pytest.mark.parametrize("which", ["controller", "plant"])
def test_memory_that_runs_out_is_an_answer(tmp_path: Path, example_case: Callable[[str], Case], which: str) -> None:
    """Each allocation fails in turn: NULL or fmi2Error, nothing leaks, and the next call succeeds.

    promise: short-memory
    """
    fmu = getattr(example_case("paper").fmus, which)
    met = c_host.exhaust(c_host.build(tmp_path, "memory"), fmu)
    assert met["instantiate"] > 100
    assert met["save"] > 10
    assert met["deserialize"] > 10
    assert met["refused"] > 5
    assert met["serialize"] == met["reset"] == 0, "these take no memory"
