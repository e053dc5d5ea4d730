"""What a step of an FMU costs, measured by a C program: nanoseconds, and instructions under callgrind.

The inputs are those of the closed loop, recorded once, so that the controller sees what it sees in use. The
table names three controllers with each of two estimators, three plants, and beside them a C FMU that does
nothing but copy its inputs (tests/c/feedthrough.c); with FEEDTHROUGH=path/to/Feedthrough.fmu the one of the Reference
FMUs, too.

    speed.py                      prints the table
    speed.py --write FILE         writes it between the marks of FILE
    speed.py --renew              writes the instructions of a step to tests/fmpy/instructions.json
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import c_host
import fmpy
import numpy as np

import commands
import fmu_loop

if TYPE_CHECKING:
    from collections.abc import Iterator

BOUNDS = commands.ROOT / "tests" / "fmpy" / "instructions.json"
BEGIN, END = "<!-- steps -->", "<!-- end of steps -->"
EXAMPLES = ("paper", "tank", "converter")
# Where the Reference FMU stands beside: how many times its cost each may take, and is meant to take.
ALLOWED = {
    "paper controller, observer": (2.0, 1.0),
    "tank controller, observer": (2.5, 1.5),
    "converter controller, observer": (3.0, 1.5),
    "paper plant": (2.0, 1.0),
    "converter plant": (10.0, 5.0),
}
STEPS, REPEATS, INSTANCES = 1000, 7, 21
# How often an FMU and the Reference FMU are measured in turns: on a busy machine both slow down.
ROUNDS = 5
# Instructions are counted over these steps: the first ones, which settle, cancel.
FROM, UNTIL = 400, 1000


@dataclass(frozen=True)
class Subject:
    """What is measured: a library, how it is opened, and the inputs of its steps."""

    library: Path
    guid: str
    resources: str
    step: float
    rows: Path
    references: tuple[str, ...]

    def run(self, program: Path, *plan: int, under: tuple[str, ...] = ()) -> subprocess.CompletedProcess:
        """Runs the C program: steps, repeats, instances."""
        count, repeats, instances = map(str, plan)
        arguments = [self.library, self.guid, self.resources, repr(self.step), self.rows, count, repeats, instances]
        command = [*under, program, *arguments, *self.references]
        return subprocess.run(command, check=True, capture_output=True, text=True)

    def time(self, program: Path) -> tuple[float, float]:
        """Returns microseconds to instantiate and nanoseconds a step."""
        instance, step, _ = self.run(program, STEPS, REPEATS, INSTANCES).stdout.split()
        return float(instance), float(step)

    def instructions(self, program: Path) -> float:
        """Returns the instructions of a step: two runs of different length, so that all else cancels."""
        tool = ("valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null")

        def total(count: int) -> int:
            text = self.run(program, count, 1, 0, under=tool).stderr
            return int(re.search(r"Collected : (\d+)", text).group(1))

        return (total(UNTIL) - total(FROM)) / (UNTIL - FROM)


def _subject(fmu: Path, signals: dict[str, np.ndarray], folder: Path) -> Subject:
    unpacked = folder / fmu.stem
    fmpy.extract(fmu, unpacked)
    description = fmpy.read_model_description(unpacked)
    columns, references, count = [], [], {}
    for variable in description.modelVariables:
        name = variable.name.split("[")[0]
        if variable.causality == "output" and variable.type == "Real":
            references += ["o", str(variable.valueReference)]
        elif variable.causality == "input" and name in signals:
            at = count[name] = count.get(name, -1) + 1
            columns.append(signals[name][:, at])
            references += ["i", str(variable.valueReference)]
    rows = folder / f"{fmu.stem}.rows"
    np.column_stack(columns).astype(float).tofile(rows)
    (library,) = (unpacked / "binaries" / "linux64").iterdir()
    step = float(description.defaultExperiment.stepSize or 0.1)
    return Subject(library, description.guid, (unpacked / "resources").as_uri(), step, rows, tuple(references))


def subjects(example: str, fmus: commands.Exported, folder: Path) -> Iterator[tuple[str, Subject]]:
    """Yields the controller and the plant of a design with the signals of their closed loop."""
    loop = fmu_loop.run(fmus, STEPS)
    measured = {"y": loop["y"], "y_ref": loop["y_ref"], "mode_real": loop["mode"]}
    yield f"{example} controller", _subject(fmus.controller, measured, folder)
    yield f"{example} plant", _subject(fmus.plant, {"u": loop["u"]}, folder)


def _copying(folder: Path) -> Subject:
    library, rows = folder / "feedthrough.so", folder / "feedthrough.rows"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC"]
    subprocess.run(["cc", *flags, "-o", library, c_host.SOURCES / "feedthrough.c"], check=True)
    width = 8
    np.arange(STEPS * width, dtype=float).tofile(rows)
    references = [word for at in range(2 * width) for word in ("i" if at < width else "o", str(at))]
    return Subject(library, "guid", "file:///", 1.0, rows, tuple(references))


def _reference(fmu: Path, folder: Path) -> Subject:
    names = {variable.name for variable in fmpy.read_model_description(fmu).modelVariables}
    inputs = {name: np.arange(STEPS, dtype=float)[:, None] for name in names if "continuous_input" in name}
    return _subject(fmu, inputs, folder)


def table(program: Path, folder: Path) -> str:
    """Returns the table, in Markdown."""
    found: list[tuple[str, Subject]] = [("C FMU that copies eight inputs", _copying(folder))]
    reference = os.environ.get("FEEDTHROUGH")
    if reference:
        found.append(("Reference FMU Feedthrough", _reference(Path(reference), folder)))
    for example in EXAMPLES:
        out = folder / example
        out.mkdir()
        found += variants(example, out)
    lines = [
        "| FMU | set + doStep + get, ns | times the Reference FMU | must, aim | instructions | instantiate, us |",
        "|---|---|---|---|---|---|",
    ]
    base = next((subject for name, subject in found if name.startswith("Reference")), None)
    for name, subject in found:
        own, others = [], []
        for _ in range(ROUNDS):
            own.append(subject.time(program))
            others += [base.time(program)[1]] if base else []
        instance, step = statistics.median(made for made, _ in own), min(each for _, each in own)
        times = f"{step / min(others):.1f}" if base else "-"
        must = "{:.1f}, {:.1f}".format(*ALLOWED[name]) if name in ALLOWED else "-"
        count = subject.instructions(program)
        lines.append(f"| {name} | {step:,.0f} | {times} | {must} | {count:,.0f} | {instance:,.1f} |")
    return "\n".join(lines) + "\n"


def variants(example: str, folder: Path) -> Iterator[tuple[str, Subject]]:
    """Yields an example's plant, and its controller with each estimator, the default one first."""
    text = (commands.ROOT / "examples" / f"{example}.toml").read_text()
    for method in ("observer", "reference"):
        chosen, once = re.subn(r'^method = "(reference|observer)"', f'method = "{method}"', text, flags=re.MULTILINE)
        if once != 1:
            raise ValueError(f"{example}.toml does not name its estimator in one line")
        out = folder / method
        out.mkdir()
        design = out / f"{example}.toml"
        design.write_text(chosen)
        for name, subject in subjects(example, commands.export(design, out), out):
            if name.endswith("controller"):
                yield f"{name}, {method}", subject
            elif method == "reference":
                yield name, subject


def counted(program: Path, example: str, folder: Path) -> Iterator[tuple[str, int]]:
    """Yields the instructions of a step of an example's FMUs."""
    for name, subject in variants(example, folder):
        yield name, round(subject.instructions(program))


def measured(program: Path, folder: Path) -> dict[str, int]:
    """Returns them for every example."""
    found = {}
    for example in EXAMPLES:
        out = folder / example
        out.mkdir()
        found |= dict(counted(program, example, out))
    return found


def main() -> None:
    """Prints or writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", type=Path)
    parser.add_argument("--renew", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = c_host.build(folder, "speed")
        if arguments.renew:
            BOUNDS.write_text(json.dumps(measured(program, folder), indent=4) + "\n")
            return
        text = table(program, folder)
    print(text, end="")
    if arguments.write:
        before, rest = arguments.write.read_text().split(BEGIN)
        after = rest.split(END)[1]
        arguments.write.write_text(f"{before}{BEGIN}\n{text}{END}{after}")


if __name__ == "__main__":
    main()
