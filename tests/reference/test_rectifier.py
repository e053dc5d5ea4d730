"""The nonlinear rectifier, integrated a second time: written from its energy balance, by SciPy."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import solve_ivp

import commands

if TYPE_CHECKING:
    from collections.abc import Callable

# The program integrates to 1e-9 and prints every digit; SciPy is asked for a little more.
TOLERANCE = 1e-10
AGREEMENT = 1e-7


def rate(plant: dict, load: float, u: np.ndarray, w: float) -> Callable[[float, np.ndarray], list[float]]:
    """The time derivative of `[i_d, i_q, v]`: grid power less line loss goes into coils, load and capacitor."""
    L, R, C, V = (plant[key] for key in ("inductance", "resistance", "capacitance", "phase_voltage"))

    def derivative(_t: float, x: np.ndarray) -> list[float]:
        i, v = x[:2], x[2]
        di = (u - i) / plant["current_loop"]
        grid = 1.5 * (V * i[0] - R * (i @ i))
        coils = 1.5 * L * (i @ di)
        return [*di, (grid - coils - v * v / load - v * w) / (C * v)]

    return derivative


def test_every_sample_of_the_loop_is_a_solution(example_case: Callable) -> None:
    """From each tick's state the next one follows, under the recorded command, mode and disturbance."""
    case = example_case("converter")
    design = tomllib.loads((commands.ROOT / "examples" / "converter.toml").read_text())
    plant, te = design["plant"], design["sample_time"]
    run = case.run.trajectories
    x, u, w, mode = run["ftc.x"], run["ftc.u"], run["w"][:, 0], run["mode"][:, 0].astype(int)
    # Every tenth tick, and all about the mode switch.
    switch = int(np.flatnonzero(np.diff(mode))[0])
    ticks = sorted({*range(0, run.ticks - 1, 10), *range(switch - 5, switch + 20)})
    for k in ticks:
        derivative = rate(plant, plant["loads"][mode[k] - 1], u[k], w[k])
        found = solve_ivp(derivative, (0.0, te), x[k], method="DOP853", rtol=TOLERANCE, atol=TOLERANCE)
        np.testing.assert_allclose(x[k + 1], found.y[:, -1], rtol=AGREEMENT, atol=AGREEMENT, err_msg=f"tick {k}")
