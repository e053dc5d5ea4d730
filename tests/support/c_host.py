"""The C program of tests/c on an exported FMU, by itself or under another program such as valgrind."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import fmpy

import commands

SOURCE = commands.ROOT / "tests" / "c" / "drive.c"
VALGRIND = ("valgrind", "--quiet", "--error-exitcode=9", "--leak-check=full", "--show-leak-kinds=all")


def build(folder: Path) -> Path:
    """Compiles the program, every warning an error."""
    program = folder / "drive"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-O1", "-g"]
    subprocess.run(["cc", *flags, "-o", program, SOURCE, "-ldl"], check=True)
    return program


def drive(program: Path, fmu: Path, *, start: float = 0.0, count: int = 400, under: tuple[str, ...] = ()) -> str:
    """Drives an FMU with all its Real inputs and outputs, `count` steps of half a sample time.

    Returns:
        What the program prints: the outputs after each step, in C's hexadecimal notation.
    """
    with tempfile.TemporaryDirectory() as unpacked:
        fmpy.extract(fmu, unpacked)
        description = fmpy.read_model_description(unpacked)
        library = Path(unpacked, "binaries", "linux64", f"{description.coSimulation.modelIdentifier}.so")
        arguments = []
        for variable in description.modelVariables:
            reference = variable.valueReference
            if variable.type != "Real" or variable.name.startswith("mode"):
                continue
            if variable.causality == "input":
                arguments += ["i", str(reference), str(0.001 * (1 + reference))]
            elif variable.causality == "output":
                arguments += ["o", str(reference)]
        step = 0.5 * float(description.defaultExperiment.stepSize)
        plan = [description.guid, Path(unpacked, "resources").as_uri(), repr(start), repr(step), str(count)]
        command = [*under, program, library, *plan, *arguments]
        return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def main() -> None:
    """Runs valgrind's memcheck over the program on both FMUs of a design."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = build(folder)
        fmus = commands.export(Path(sys.argv[1]), folder)
        for fmu in (fmus.controller, fmus.plant):
            drive(program, fmu, count=60, under=VALGRIND)
            print(f"{fmu.name}: no error, no leak")


if __name__ == "__main__":
    main()
