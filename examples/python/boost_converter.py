"""A boost converter under two loads, averaged over its switching period and linearised.

    L di/dt = v_in - r i - (1 - d) v          (A; H, V, ohm)
    C dv/dt = (1 - d) i - v / R               (V; F)

The duty cycle d holds the output voltage while the load switches between two resistances and the
supply ripples. Raising d first lowers the voltage: the plant is of non-minimum phase.

    python examples/python/boost_converter.py --out out/boost_converter
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.signal
import study

import ftc_fmu as ftc

SUPPLY = 12.0  # V
OUTPUT = 24.0  # V
INDUCTANCE = 220e-6  # H
COIL = 0.15  # ohm
CAPACITANCE = 470e-6  # F
LOADS = {"light load": 20.0, "full load": 10.0}  # ohm
SAMPLE_TIME = 100e-6  # s: five switching periods at 50 kHz


def operating_point(load: float) -> dict[str, list[float]]:
    """Returns the steady state at 24 V: the larger of the two 1 - d that balance the coil's voltage."""
    coil_drop = COIL * OUTPUT / load
    complement = (SUPPLY + np.sqrt(SUPPLY**2 - 4.0 * OUTPUT * coil_drop)) / (2.0 * OUTPUT)
    current = OUTPUT / (load * complement)
    return {"x": [current, OUTPUT], "u": [1.0 - complement], "y": [current, OUTPUT]}


def converter(load: float) -> scipy.signal.StateSpace:
    """The averaged converter about its steady state: inputs duty cycle and supply ripple."""
    point = operating_point(load)
    (current, voltage), complement = point["x"], 1.0 - point["u"][0]
    A = [
        [-COIL / INDUCTANCE, -complement / INDUCTANCE],
        [complement / CAPACITANCE, -1.0 / (load * CAPACITANCE)],
    ]
    B = [[voltage / INDUCTANCE, 1.0 / INDUCTANCE], [-current / CAPACITANCE, 0.0]]
    return scipy.signal.StateSpace(A, B, np.eye(2), np.zeros((2, 2)))


def design() -> ftc.Design:
    """The voltage follows; the supply ripples at 100 Hz."""
    current = {"name": "coil current", "unit": "A", "nominal": 1.0}
    voltage = {"name": "output voltage", "unit": "V", "nominal": 2.0}
    plant = ftc.Plant(
        [converter(load) for load in LOADS.values()],
        sample_time=SAMPLE_TIME,
        disturbance_inputs=[1],
        inputs=[{"name": "duty cycle", "nominal": 0.1, "min": 0.05, "max": 0.9}],
        outputs=[{**current, "min": -10.0, "max": 30.0}, {**voltage, "min": 0.0, "max": 60.0}],
        states=[current, voltage],
        operating_points=[operating_point(load) for load in LOADS.values()],
        names=list(LOADS),
    )
    return ftc.design(
        plant,
        name="boost_converter",
        tracked=["output voltage"],
        decay=0.98,
        output_weight=0.3,
        integral_weight=30.0,
        input_weight=5.0,
        disturbance={"period": 0.01, "amplitude": 0.3},
        # The model is exact here, so what it does not explain is a fault. The default leaves room for a load.
        estimator={"method": "reference"},
        scenario={
            "steps": 3000,
            "noise": [0.02, 0.03],
            "seed": 11,
            "schedule": [{"from": 0.0, "mode": 1}, {"from": 0.15, "mode": 2}],
            "reference": [{"kind": "steps", "points": [[0.0, 24.0], [0.03, 25.0], [0.22, 24.0]]}],
            "events": [
                {"kind": "bias", "sensor": 2, "from": 0.06, "until": 0.12, "size": 2.0},
                {"kind": "gain-loss", "sensor": 2, "from": 0.2, "until": 0.27, "loss": 0.1},
            ],
            "disturbance": [{"kind": "sine", "amplitude": 0.3, "period": 0.01}],
        },
    )


if __name__ == "__main__":
    study.main(design, Path(__file__))
