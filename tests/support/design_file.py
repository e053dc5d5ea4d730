"""Design files for the tests: plain dictionaries, written as TOML."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

REFERENCES = {
    "constant": {"kind": "constant", "value": 0.6},
    "square": {"kind": "square", "amplitude": 0.6, "period": 400.0},
    "sine": {"kind": "sine", "amplitude": 0.6, "period": 400.0},
    "levels": {"kind": "steps", "points": [[0.0, 0.4], [300.0, 0.8], [700.0, -0.2], [1200.0, 0.5]]},
}
STEPS = 1600


def _inline(value: object) -> str:
    """Returns a value as TOML; JSON's notation is TOML's but for tables."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_inline(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return json.dumps(value)


def dumps(design: dict) -> str:
    """Returns a design as the text of a TOML file: top-level keys, `[[mode]]`, then the tables."""
    lines = [
        f"{key} = {_inline(value)}" for key, value in design.items() if key != "mode" and not isinstance(value, dict)
    ]
    for mode in design["mode"]:
        lines += ["", "[[mode]]", *(f"{key} = {_inline(value)}" for key, value in mode.items())]
    for name, table in design.items():
        if isinstance(table, dict):
            lines += ["", f"[{name}]", *(f"{key} = {_inline(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def write(design: dict, folder: Path) -> Path:
    """Writes a design into `folder` under its own name."""
    path = folder / f"{design['name']}.toml"
    path.write_text(dumps(design))
    return path


def scenario_a(*, disturbed: str, reference: str = "square", noise: float = 0.0) -> dict:
    """Returns the paper's example A: two modes, a sinusoidal disturbance, two spells of sensor fault.

    Args:
        disturbed: Where the disturbance enters, `state` or `output`.
        reference: A key of `REFERENCES`, for both outputs.
        noise: Standard deviation of the measurement noise.
    """
    on, off = [[1.0], [1.0]], [[0.0], [0.0]]
    E, F = (on, off) if disturbed == "state" else (off, on)
    common = {"C": [[1.0, 0.0], [0.0, 1.0]], "E": E, "F": F}
    period = 2 * math.pi / 0.02
    fault = {"kind": "steps", "points": [[101.0, 0.5], [401.0, 0.0], [1001.0, 0.5]]}
    return {
        "name": f"paper_{disturbed}_{reference}",
        "sample_time": 1.0,
        "mode": [
            {"A": [[0.6, 0.45], [-0.2, 0.3]], "B": [[0.0, 1.0], [1.0, 0.0]], **common},
            {"A": [[0.4, -0.3], [0.11, 0.0]], "B": [[1.0, 0.0], [0.0, 1.0]], **common},
        ],
        "disturbance": {"period": period, "harmonics": 1},
        "controller": {
            "tracked": [1, 2],
            "latency": 0,
            "lyapunov": "common",
            "decay": 0.7,
            "output_weight": 1.0,
            "integral_weight": 0.3,
            "input_weight": 0.1,
        },
        "observer": {"kind": "auto", "decay": 0.7},
        "estimator": {"method": "reference", "database": "commission", "sigmas": 6.0, "debounce": 1},
        "compensation": {"method": "virtual-sensor"},
        "scenario": {
            "steps": STEPS,
            "noise": noise,
            "seed": 42,
            "schedule": [{"from": 0.0, "mode": 1}, {"from": 800.0, "mode": 2}],
            "reference": [REFERENCES[reference]] * 2,
            "fault": [fault] * 2,
            "disturbance": [{"kind": "sine", "amplitude": 0.04, "period": period}],
        },
    }


def delayed() -> dict:
    """Returns example A designed for one sample of delay, which a master that steps both FMUs in parallel adds."""
    design = scenario_a(disturbed="state", reference="levels", noise=0.005)
    design["name"] = "delayed"
    design["controller"] |= {"latency": 1, "lyapunov": "dwell", "decay": 0.9}
    return design
