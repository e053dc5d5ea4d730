"""The quadruple tank of Johansson (2000): from its physics to FMUs that survive a lying level sensor.

Two pumps feed four tanks; what a pump sends to the lower tanks, two valves divide. With the valves in
one position the plant is easy (minimum phase), in the other hard (a zero in the right half plane):
two modes of one controller. Levels in cm, pump voltages in V, time in s.

    python examples/python/quadruple_tank.py --out out/quadruple_tank
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import study

import ftc_fmu as ftc

AREA = np.array([28.0, 32.0, 28.0, 32.0])  # cm2, of each tank
OUTLET = np.array([0.071, 0.057, 0.071, 0.057])  # cm2
GRAVITY = 981.0  # cm/s2
SAMPLE_TIME = 5.0  # s

MODES = {
    "minimum phase": {"h": [12.4, 12.7, 1.8, 1.4], "v": [3.0, 3.0], "k": [3.33, 3.35], "gamma": [0.70, 0.60]},
    "non-minimum phase": {"h": [12.6, 13.0, 4.8, 4.9], "v": [3.15, 3.15], "k": [3.14, 3.29], "gamma": [0.43, 0.34]},
}


def linearised(h: list[float], k: list[float], gamma: list[float]) -> tuple[np.ndarray, ...]:
    """Linearises the tanks at levels h (cm): states are levels, inputs two voltages and an unknown inflow (cm3/s)."""
    T = AREA / OUTLET * np.sqrt(2.0 * np.array(h) / GRAVITY)
    A = np.diag(-1.0 / T)
    A[0, 2] = AREA[2] / (AREA[0] * T[2])
    A[1, 3] = AREA[3] / (AREA[1] * T[3])
    B = np.array(
        [
            [gamma[0] * k[0] / AREA[0], 0.0],
            [0.0, gamma[1] * k[1] / AREA[1]],
            [0.0, (1.0 - gamma[1]) * k[1] / AREA[2]],
            [(1.0 - gamma[0]) * k[0] / AREA[3], 0.0],
        ]
    )
    rain = np.array([[1.0 / AREA[0]], [1.0 / AREA[1]], [0.0], [0.0]])
    return A, np.hstack([B, rain]), np.eye(2, 4), np.zeros((2, 3)), 0.0


def plant() -> ftc.Plant:
    """Both valve positions as modes, about Johansson's operating points."""
    level = {"unit": "cm", "min": 0.0, "max": 20.0}
    return ftc.Plant(
        [linearised(mode["h"], mode["k"], mode["gamma"]) for mode in MODES.values()],
        sample_time=SAMPLE_TIME,
        disturbance_inputs=[2],
        inputs=[{"name": f"pump {i}", "unit": "V", "nominal": 1.0, "min": 0.0, "max": 10.0} for i in (1, 2)],
        outputs=[{"name": f"level {i}", "nominal": 2.0, **level} for i in (1, 2)],
        states=[{"name": f"level {i}", "nominal": 2.0, "unit": "cm"} for i in (1, 2, 3, 4)],
        operating_points=[{"x": mode["h"], "u": mode["v"], "y": mode["h"][:2]} for mode in MODES.values()],
        names=list(MODES),
    )


def design() -> ftc.Design:
    """Both lower levels follow references; the building's water use disturbs them with a period of 20 min."""
    return ftc.design(
        plant(),
        name="quadruple_tank",
        tracked=["level 1", "level 2"],
        lyapunov="dwell",
        decay=0.98,
        output_weight=0.5,
        integral_weight=0.01,
        input_weight=0.3,
        disturbance={"period": 1200.0, "amplitude": 3.0},
        # The model is exact here, so what it does not explain is a fault, a drift, too. The default trusts a sensor
        # that drifts, since a leak would look the same.
        estimator={"method": "reference"},
        scenario={
            "steps": 1600,
            "noise": 0.02,
            "seed": 7,
            "schedule": [{"from": 0.0, "mode": 1}, {"from": 4000.0, "mode": 2}],
            "reference": [
                {"kind": "steps", "points": [[0, 12.4], [300, 14.0], [5200, 12.6]]},
                {"kind": "steps", "points": [[0, 12.7], [1500, 11.5], [5200, 13.0]]},
            ],
            "events": [
                {"kind": "bias", "sensor": 1, "from": 2000.0, "until": 3200.0, "size": 2.0},
                {"kind": "drift", "sensor": 2, "from": 6000.0, "until": 7400.0, "slope": 0.002},
            ],
            "disturbance": [{"kind": "sine", "amplitude": 3.0, "period": 1200.0}],
        },
    )


if __name__ == "__main__":
    study.main(design, Path(__file__))
