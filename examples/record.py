"""Make the logs of healthy operation that a design file names under ``[estimator] database``.

Usage: python3 examples/record.py DESIGN.toml

Does what an operator may do: every input jumps at random to one of two values about the operating point, a
nominal value apart. Inputs and noisy outputs are written to one CSV file per mode beside the
design file. The same design always gives the same bytes.
"""

import csv
import math
import random
import sys
import tomllib
from pathlib import Path

SAMPLES = 480


def times(matrix: list[list[float]], vector: list[float]) -> list[float]:
    """Multiply a matrix, given as a list of rows, by a vector."""
    return [sum(a * b for a, b in zip(row, vector, strict=True)) for row in matrix]


def added(*vectors: list[float]) -> list[float]:
    """Add vectors entry by entry."""
    return [sum(entries) for entries in zip(*vectors, strict=True)]


def record(design: dict, mode: dict, seed: int) -> list[list[float]]:
    """Run one mode: rows of time, inputs and outputs, in physical units."""
    draw = random.Random(seed)  # noqa: S311 - a test signal, no secret
    point = mode["operating_point"]
    known, noise = design["disturbance"], design["scenario"]["noise"]
    nominal = [signal["nominal"] for signal in design["signals"]["inputs"]]
    x = [0.0] * len(point["x"])
    rows = []
    for k in range(SAMPLES):
        t = k * design["sample_time"]
        w = [known["amplitude"] * math.sin(math.tau * t / known["period"] + seed)]
        u = [draw.choice((-0.5, 0.5)) * size for size in nominal]
        y = [value + draw.gauss(0.0, noise) for value in times(mode["C"], x)]
        rows.append([t, *added(point["u"], u), *added(point["y"], y)])
        x = added(times(mode["A"], x), times(mode["B"], u), times(mode["E"], w))
    return rows


def main() -> None:
    """Write one log per mode."""
    path = Path(sys.argv[1])
    design = tomllib.loads(path.read_text(encoding="utf-8"))
    signals = design["signals"]
    header = ["t", *(signal["name"] for signal in signals["inputs"] + signals["outputs"])]
    modes = zip(design["mode"], design["estimator"]["database"], strict=True)
    for seed, (mode, name) in enumerate(modes, start=1):
        with path.with_name(name).open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(header)
            writer.writerows([f"{value:.3f}" for value in row] for row in record(design, mode, seed))


if __name__ == "__main__":
    main()
