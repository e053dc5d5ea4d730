"""Sensor-fault-tolerant control of switched plants: design, proof, FMUs, simulation.

import ftc_fmu as ftc

plant = ftc.Plant([sys1, sys2], sample_time=5.0, disturbance_inputs=[2])
design = ftc.design(plant, name="tank", tracked=["level 1", "level 2"], decay=0.97)
run = design.simulate()
design.export("out")
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ftc_fmu import _core
from ftc_fmu._place import HOME
from ftc_fmu.campaigns import Campaign, campaign
from ftc_fmu.controller import Controller
from ftc_fmu.design import Design, design, load
from ftc_fmu.errors import DesignFileError, FtcError, Infeasible, MissingExtra, NoDesign, Uncertified, Unproved
from ftc_fmu.identification import Identification
from ftc_fmu.log import Log
from ftc_fmu.plant import Mode, OperatingPoint, Plant
from ftc_fmu.run import Run

if TYPE_CHECKING:
    from os import PathLike

__version__ = _core.version()


def verify(path: str | PathLike[str], *, key: str | PathLike[str] | None = None, run: bool = True) -> dict[str, Any]:
    """Proves again, from the numbers in an FMU alone, what it promises; nothing is solved.

    Args:
        path: The FMU.
        key: Public key file of minisign; its owner must have signed the FMU.
        run: Also run a controller's binary for this machine, in a process of its own, and compare
            it to the bit with this package's controller; `False` executes no code of the FMU.

    Returns:
        What is proved: stability under which switching, decay, gamma per mode, platforms.

    Raises:
        Unproved: A promise does not hold, the FMU's parts do not belong together, the binary does
            something else, or the key's owner has not signed the FMU as it is.
        DesignFileError: The key cannot be read.
        FtcError: The file is no FMU of this package, or damaged.
    """
    runner = [sys.executable, "-m", "ftc_fmu", "run-binary"] if run else None
    return json.loads(_core.verify(str(path), None if key is None else str(key), runner))


def platforms() -> list[str]:
    """Returns the platforms for which this installation holds FMU binaries, by their FMI 2.0 names."""
    return _core.platforms(HOME)


def examples() -> list[str]:
    """Returns the names of the examples that this installation holds, for `example`."""
    return _core.examples()


def example(name: str, folder: str | PathLike[str] = ".") -> Path:
    """Writes an example: a design file with its logs, or a Python script from physics to FMUs.

    Args:
        name: One of `examples()`.
        folder: Where to; made where there is none. Files of the same names are replaced.

    Returns:
        The file to start from: give it to `load`, or run it.

    Raises:
        DesignFileError: There is no such example.
    """
    files = _core.example(name)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for file, contents in files:
        (folder / file).write_bytes(contents)
    return folder / files[0][0]


__all__ = [
    "Campaign",
    "Controller",
    "Design",
    "DesignFileError",
    "FtcError",
    "Identification",
    "Infeasible",
    "Log",
    "MissingExtra",
    "Mode",
    "NoDesign",
    "OperatingPoint",
    "Plant",
    "Run",
    "Uncertified",
    "Unproved",
    "campaign",
    "design",
    "example",
    "examples",
    "load",
    "platforms",
    "verify",
]
