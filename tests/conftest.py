"""What all Python tests share: the designs under test, each exported and simulated once."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest

import commands
import design_file
import record

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


@dataclass(frozen=True)
class Case:
    """One design under test: its file, its FMUs, its record and its native run."""

    path: Path
    fmus: commands.Exported
    record: dict
    run: commands.Run


def pytest_addoption(parser: pytest.Parser) -> None:
    """Adds the option under which continuous integration runs."""
    parser.addoption("--nothing-skipped", action="store_true", help="a skipped test is an error")


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Ends with an error if a test was skipped and none may be."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    # A worker of several reports to the process that started it.
    if reporter and session.config.getoption("nothing_skipped") and reporter.stats.get("skipped"):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_sessionstart() -> None:
    """Refuses to start without the program under test."""
    if not commands.PROGRAM.exists():
        pytest.exit(f"{commands.PROGRAM} is missing: run `make build` first", returncode=2)


def _case(path: Path, folder: Path) -> Case:
    fmus = commands.export(path, folder)
    return Case(path, fmus, record.load(fmus.controller), commands.simulate(path, folder))


@pytest.fixture(scope="session")
def make_case(tmp_path_factory: pytest.TempPathFactory) -> Callable[[dict], Case]:
    """Returns a function that exports and simulates a design given as a dictionary."""

    def make(design: dict) -> Case:
        folder = tmp_path_factory.mktemp(design["name"])
        return _case(design_file.write(design, folder), folder)

    return make


@pytest.fixture(scope="session")
def example_case(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Case]:
    """Returns a function that exports and simulates one of the shipped examples, once a session."""

    @functools.cache
    def make(name: str) -> Case:
        return _case(commands.ROOT / "examples" / f"{name}.toml", tmp_path_factory.mktemp(name))

    return make
