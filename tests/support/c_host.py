"""The C programs of tests/c on exported FMUs, by themselves or under another program such as valgrind."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import fmpy

import commands

SOURCES = commands.ROOT / "tests" / "c"
MEMCHECK = ("valgrind", "--quiet", "--error-exitcode=9", "--leak-check=full", "--show-leak-kinds=all")
STEPS = 60


def build(folder: Path, name: str = "drive") -> Path:
    """Compiles a program, every warning an error."""
    program = folder / name
    flags = [
        "-std=c11",
        "-D_POSIX_C_SOURCE=200809L",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-O1",
        "-g",
        "-pthread",
        "-rdynamic",
    ]
    subprocess.run(["cc", *flags, "-o", program, SOURCES / f"{name}.c", "-ldl"], check=True)
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
            if variable.name == "mode_real" and variable.causality == "input":
                arguments += ["f", str(reference), "1"]
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


def exhaust(program: Path, fmu: Path) -> dict[str, int]:
    """Lets each allocation of an FMU fail in turn.

    Returns:
        How many failures each operation met.
    """
    with tempfile.TemporaryDirectory() as unpacked:
        fmpy.extract(fmu, unpacked)
        (library,) = Path(unpacked, "binaries", "linux64").iterdir()
        guid = fmpy.read_model_description(unpacked).guid
        command = [program, library, guid, Path(unpacked, "resources").as_uri()]
        text = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    return {name: int(met) for name, met in map(str.split, text.splitlines())}


def connections(sides: dict[str, fmpy.model_description.ModelDescription]) -> list[str]:
    """Returns the loop's connections by value reference, Reals only."""
    arguments = []
    for source, target, bases in (("p", "c", ("y", "y_ref", "mode_real")), ("c", "p", ("u",))):
        inputs = {variable.name: variable.valueReference for variable in sides[target].modelVariables}
        for variable in sides[source].modelVariables:
            if variable.name.split("[")[0] in bases and variable.causality == "output":
                arguments += [source, str(variable.valueReference), str(inputs[variable.name])]
    return arguments


def close_in_threads(fmus: commands.Exported, folder: Path) -> str:
    """Closes the loop of a pair in many threads at once and returns what the program says of it."""
    sides, arguments = {}, []
    for side, fmu in (("c", fmus.controller), ("p", fmus.plant)):
        unpacked = folder / f"unpacked_{side}"
        fmpy.extract(fmu, unpacked)
        sides[side] = fmpy.read_model_description(unpacked)
        (library,) = (unpacked / "binaries" / "linux64").iterdir()
        arguments += [library, sides[side].guid, (unpacked / "resources").as_uri()]
    size = str(sides["p"].defaultExperiment.stepSize)
    command = [build(folder, "threads"), *arguments, size, str(STEPS), *connections(sides)]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def main() -> None:
    """Runs valgrind's memcheck over the program on both FMUs of a design."""
    (design,) = sys.argv[1:]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        fmus = commands.export(Path(design), folder)
        program = build(folder)
        for fmu in (fmus.controller, fmus.plant):
            drive(program, fmu, count=STEPS, under=MEMCHECK)
            print(f"{fmu.name}: no error, no leak")


if __name__ == "__main__":
    main()
