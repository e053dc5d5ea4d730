"""The C program of tests/c on an exported FMU, by itself or under another program such as valgrind."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import commands

SOURCE = commands.ROOT / "tests" / "c" / "drive.c"
VALGRIND = ["valgrind", "--quiet", "--error-exitcode=9", "--leak-check=full", "--show-leak-kinds=all"]


def build(folder: Path) -> Path:
    """Compiles the program, every warning an error."""
    program = folder / "drive"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-O1", "-g"]
    subprocess.run(["cc", *flags, "-o", program, SOURCE, "-ldl"], check=True)
    return program


def drive(program: Path, fmu: Path, *, start: float = 0.0, step: float = 0.5, count: int = 400, under: list[str]) -> str:
    """Drives an FMU: all its Real inputs and outputs, `count` steps of `step` sample times.

    Returns:
        What the program prints: the outputs after each step, in C's hexadecimal notation.
    """
    with tempfile.TemporaryDirectory() as unpacked:
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(unpacked)
        root = ET.parse(Path(unpacked, "modelDescription.xml")).getroot()
        period = float(root.find("DefaultExperiment").get("stepSize"))
        identifier = root.find("CoSimulation").get("modelIdentifier")
        library = Path(unpacked, "binaries", "linux64", f"{identifier}.so")
        arguments = []
        for variable in root.find("ModelVariables"):
            reference, name = variable.get("valueReference"), variable.get("name")
            if variable.find("Real") is None or name.startswith("mode"):
                continue
            if variable.get("causality") == "input":
                arguments += ["i", reference, str(0.001 * (1 + int(reference)))]
            elif variable.get("causality") == "output":
                arguments += ["o", reference]
        resources = Path(unpacked, "resources").as_uri()
        numbers = [repr(start), repr(step * period), str(count)]
        command = [*under, program, library, root.get("guid"), resources, *numbers, *arguments]
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
