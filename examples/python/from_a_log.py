"""From a log to an FMU without a model: two reservoirs of which only logs exist.

The two logs were written down in healthy operation, one with the valve between the reservoirs closed,
one with it open (examples/logged_closed.csv, logged_open.csv). A model is identified, a controller
designed, and the controller tried on the plant that made the logs, which identification never saw.

    python examples/python/from_a_log.py --out out/from_a_log
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

import ftc_fmu as ftc

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE if (HERE / "logged.toml").exists() else HERE.parent
WATER = {"period": 600.0}  # s: the building's water consumption, which nobody measures
FAULT = 3.0  # cm, bias of the first level sensor


def logs() -> list[ftc.Log]:
    """Reads the logs, one per position of the valve."""
    frames = [pd.read_csv(EXAMPLES / f"logged_{valve}.csv") for valve in ("closed", "open")]
    return [ftc.Log.from_dataframe(frame, ["pump 1", "pump 2"], ["level 1", "level 2"], time="t") for frame in frames]


def try_on_the_plant(design: ftc.Design) -> np.ndarray:
    """Closes the loop with the plant itself; returns the true error of each level in cm (samples x 2)."""
    modes = ftc.load(EXAMPLES / "logged.toml").record()["plant"]["modes"]
    controller = design.controller()
    random = np.random.default_rng(1)
    reference = np.array([41.0, 31.0])
    x, errors = np.array(modes[0]["operating_point"]["x"]), []
    for k in range(600):
        number = 1 if k < 300 else 2
        mode = modes[number - 1]
        A, B, C = (np.array(mode[key]) for key in "abc")
        x0, u0, y0 = (np.array(mode["operating_point"][key]) for key in "xuy")
        y = C @ (x - x0) + y0
        errors.append(y - reference)
        bias = np.array([FAULT, 0.0]) if 100 <= k < 200 or 450 <= k < 550 else np.zeros(2)
        u = controller.step(y + bias + 0.05 * random.normal(size=2), reference, number)
        x = x0 + A @ (x - x0) + B @ (u - u0)
    return np.array(errors)


def main() -> None:
    """Identifies, designs, tries, exports."""
    parser = argparse.ArgumentParser(description="from_a_log")
    parser.add_argument("--out", type=Path, default=Path("out/from_a_log"))
    arguments = parser.parse_args()

    healthy = logs()
    found = ftc.Plant.identify(healthy, disturbance=WATER)
    print(found)
    design = ftc.design(
        found.plant,
        name="from_a_log",
        tracked=["level 1", "level 2"],
        decay=0.8,
        output_weight=0.2,
        integral_weight=0.05,
        input_weight=0.1,
        disturbance=WATER,
        estimator={"database": healthy, "response_length": 20, "debounce": 1},
    )
    print(design)
    errors = np.abs(try_on_the_plant(design))
    settled = np.r_[50:300, 350:600]
    print(f"largest true error on the plant, while a sensor is off by {FAULT} cm: {errors[settled].max():.2f} cm")
    if errors[settled].max() > FAULT / 3.0:
        raise SystemExit("the controller follows the faulty sensor")
    for path in design.export(arguments.out):
        print(f"wrote {path}")


if __name__ == "__main__":
    main()
