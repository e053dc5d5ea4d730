"""The demonstration: design, export, co-simulate in fmpy, compare with the native run, show the figures of merit."""

from __future__ import annotations

import argparse
import csv
import sys
import time
from pathlib import Path

import numpy as np

import commands
import fmu_loop

VARIANTS = {"ftc": "fault-tolerant", "no_ftc": "without FTC", "told_the_fault": "told the true fault"}


def _write_csv(loop: dict[str, np.ndarray], path: Path) -> None:
    """Writes a loop's signals, one column per element, each number in its shortest exact form."""
    header = [f"{name}[{i + 1}]" for name, values in loop.items() for i in range(values.shape[1])]
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(np.hstack(list(loop.values())).tolist())


def _print_table(metrics: dict) -> None:
    """Prints mean square error and variance accounted for of the true and the measured outputs."""
    print(f"{'':22}{'output':>8}{'true MSE':>12}{'true VAF':>11}{'measured MSE':>14}{'measured VAF':>14}")
    for key, title in VARIANTS.items():
        mse, vaf = metrics[key]["mse"], metrics[key]["vaf"]
        rows = zip(mse["true"], vaf["true"], mse["measured"], vaf["measured"], strict=True)
        for number, (true_mse, true_vaf, seen_mse, seen_vaf) in enumerate(rows, 1):
            print(f"{title:22}{number:>8}{true_mse:>12.6f}{true_vaf:>10.3f}%{seen_mse:>14.6f}{seen_vaf:>13.3f}%")


def _co_simulate(fmus: commands.Exported, native: commands.Trajectories, folder: Path) -> bool:
    """Runs both FMUs in a loop in fmpy, with FTC and without, and says whether the numbers are the native ones."""
    identical = True
    for variant, enabled in (("ftc", True), ("no_ftc", False)):
        began = time.perf_counter()
        loop = fmu_loop.run(fmus, native.ticks, ftc_enabled=enabled)
        seconds = time.perf_counter() - began
        _write_csv(loop, folder / f"fmpy_{variant}.csv")
        different = fmu_loop.differing(loop, native, variant)
        verdict = (
            f"DIFFERS from the native run in {', '.join(different)}"
            if different
            else "equals the native run bit for bit"
        )
        print(f"  {VARIANTS[variant]}: {native.ticks} steps in {seconds:.1f} s, {verdict}")
        identical = identical and not different
    return identical


def main() -> int:
    """Runs the demonstration and returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("design", type=Path)
    parser.add_argument("out", type=Path)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)

    print(f"== Designing {arguments.design}", flush=True)
    print(commands.ftc_fmu("design", arguments.design))
    print("== Exporting", flush=True)
    fmus = commands.export(arguments.design, arguments.out)
    print(f"  {fmus.controller}\n  {fmus.plant}")
    print("== Simulating natively", flush=True)
    run = commands.simulate(arguments.design, arguments.out)
    print("== Closing the loop of both FMUs in fmpy", flush=True)
    identical = _co_simulate(fmus, run.trajectories, arguments.out)
    print("== Tracking: the true outputs are what the plant does, the measured ones what its sensors say")
    _print_table(run.metrics)
    print("== Written")
    for path in sorted(arguments.out.iterdir()):
        print(f"  {path}")
    return 0 if identical else 1


if __name__ == "__main__":
    sys.exit(main())
