"""Running the command line under test, and reading what it writes."""

from __future__ import annotations

import csv
import json
import os
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
# The program that was built, or the one that an installed package brings.
PROGRAM = Path(os.environ.get("FTC_FMU", ROOT / "target" / "release" / "ftc-fmu"))
WORDS = {"true": 1.0, "false": 0.0}


class Refused(RuntimeError):
    """The command line ended with an error; the message is what it said."""


def ftc_fmu(*arguments: str | Path, accept: tuple[int, ...] = (0,)) -> str:
    """Runs `ftc-fmu` and returns its standard output."""
    done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False)
    if done.returncode not in accept:
        raise Refused(done.stderr)
    return done.stdout


@dataclass(frozen=True)
class Exported:
    """The pair of FMUs of one design, and the package that connects them."""

    controller: Path
    plant: Path
    package: Path


def export(design: Path, folder: Path) -> Exported:
    """Exports a design and returns its two FMUs and their package."""
    ftc_fmu("export", design, "--out", folder, "--ssp")
    (controller,), (plant,) = folder.glob("*_controller.fmu"), folder.glob("*_plant.fmu")
    (package,) = folder.glob("*.ssp")
    return Exported(controller, plant, package)


class Trajectories:
    """The table of a run: one array per vector signal, one row per tick."""

    def __init__(self, path: Path) -> None:
        """Reads `trajectories.csv`."""
        with path.open(newline="") as file:
            header, *rows = csv.reader(file)
        values = np.array([[WORDS.get(cell) if cell in WORDS else float(cell) for cell in row] for row in rows])
        self._columns: dict[str, list[np.ndarray]] = {}
        for name, column in zip(header, values.T, strict=True):
            self._columns.setdefault(re.sub(r"\[\d+\]$", "", name), []).append(column)

    def __getitem__(self, signal: str) -> np.ndarray:
        """Returns a signal such as `ftc.y` (ticks x size)."""
        return np.column_stack(self._columns[signal])

    def __contains__(self, signal: str) -> bool:
        """Says whether the table has a signal."""
        return signal in self._columns

    @property
    def ticks(self) -> int:
        """The number of rows."""
        return len(self._columns["t"][0])


@dataclass(frozen=True)
class Run:
    """What `ftc-fmu simulate` leaves behind."""

    trajectories: Trajectories
    metrics: dict


def simulate(design: Path, folder: Path) -> Run:
    """Simulates a design natively, all variants."""
    ftc_fmu("simulate", design, "--out", folder)
    return Run(Trajectories(folder / "trajectories.csv"), json.loads((folder / "metrics.json").read_text()))
