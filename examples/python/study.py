"""What every example does with its design: simulate, draw, try at random, export, and run the FMUs in fmpy."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from loop import close_loop

import ftc_fmu as ftc

if TYPE_CHECKING:
    from collections.abc import Callable


# True error (root mean square) with fault tolerance, over that of the loop that is told the fault.
LARGEST_RATIO = 1.05


def main(make: Callable[[], ftc.Design], script: Path) -> None:
    """Runs the study; fails where fault tolerance is not nearly as good as being told the fault."""
    parser = argparse.ArgumentParser(description=script.stem)
    parser.add_argument("--out", type=Path, default=Path("out") / script.stem)
    parser.add_argument("--runs", type=int, default=500, help="random runs of the campaign")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)

    design = make()
    print(design)
    design.save(arguments.out / f"{design.name}.toml")

    run = design.simulate()
    print(run)
    run.plot().savefig(arguments.out / f"{design.name}.svg")
    errors = {key: np.sqrt(run.metrics[key]["mse"]["true"]) for key in ("no_ftc", "ftc", "told_the_fault")}
    print(f"true error (root mean square): {errors}")
    if not (errors["ftc"] <= LARGEST_RATIO * errors["told_the_fault"]).all():
        raise SystemExit("fault tolerance is not as good as being told the fault")
    if not (errors["ftc"] < errors["no_ftc"]).all():
        raise SystemExit("fault tolerance does not improve the true error")

    campaign = ftc.campaign(design, runs=arguments.runs)
    print(campaign)
    campaign.save(arguments.out)

    controller, plant = design.export(arguments.out)
    print(f"wrote {controller} and {plant} for {', '.join(ftc.platforms())}")
    ftc.verify(controller)
    steps = len(run["t"])
    loop = close_loop(controller, plant, steps, design.sample_time)
    for signal in ("y", "y_true", "u", "f_hat"):
        if not np.array_equal(loop[signal], run[f"ftc.{signal}"]):
            raise SystemExit(f"{signal} of the FMUs differs from the simulation's")
    print(f"{steps} steps of both FMUs in fmpy: every signal equals the simulation's, bit for bit")
