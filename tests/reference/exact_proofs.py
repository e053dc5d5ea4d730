"""Proves the claims of many random plants in rational arithmetic.

Ends with exit code 1 where one is not proved, or no plant is designed.

`make bench` runs it; `test_exact_proof.py` holds the same checks on examples and a few plants.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from test_exact_proof import check_gains, check_lost, check_observer, check_state_feedback, check_switching
from test_running_loop import random_design

import commands
import design_file
import record

CHECKS = (check_state_feedback, check_observer, check_gains, check_switching, check_lost)


def main() -> int:
    """Prints how many plants were designed, and which claims are not proved."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=8000, help="the first seed")
    parser.add_argument("--plants", type=int, default=100)
    arguments = parser.parse_args()
    designed, missed = 0, []
    for seed in range(arguments.first, arguments.first + arguments.plants):
        with tempfile.TemporaryDirectory() as folder:
            path = design_file.write(random_design(seed), Path(folder))
            try:
                design = record.load(commands.export(path, Path(folder)).controller)
            except commands.Refused:
                continue
        designed += 1
        for check in CHECKS:
            try:
                check(design)
            except AssertionError:
                missed.append(f"seed {seed}: {check.__doc__}")
    print(f"{designed} of {arguments.plants} random plants designed; not proved: {missed or 'nothing'}")
    return 1 if missed or not designed else 0


if __name__ == "__main__":
    sys.exit(main())
