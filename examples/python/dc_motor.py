"""A DC motor that runs alone or with a flywheel coupled to it: two modes from one set of equations.

    J dw/dt = K i - b w - torque        (rad/s; kg m2, N m/A, N m s)
    L di/dt = v - R i - K w             (A; H, V, ohm)

The speed follows a reference; the tachometer loses part of its gain, the current sensor is biased.

    python examples/python/dc_motor.py --out out/dc_motor
"""

from __future__ import annotations

from pathlib import Path

import study

import control
import ftc_fmu as ftc

RESISTANCE = 0.5  # ohm
INDUCTANCE = 2e-3  # H
CONSTANT = 0.05  # V s/rad and N m/A
FRICTION = 2e-4  # N m s
INERTIA = {"alone": 1e-4, "with flywheel": 3e-4}  # kg m2
SAMPLE_TIME = 5e-3  # s


def motor(inertia: float) -> control.StateSpace:
    """The motor in continuous time: inputs voltage and load torque, outputs speed and current."""
    A = [[-FRICTION / inertia, CONSTANT / inertia], [-CONSTANT / INDUCTANCE, -RESISTANCE / INDUCTANCE]]
    B = [[0.0, -1.0 / inertia], [1.0 / INDUCTANCE, 0.0]]
    names = {"inputs": ["voltage", "load torque"], "outputs": ["speed", "current"], "states": ["speed", "current"]}
    return control.ss(A, B, [[1.0, 0.0], [0.0, 1.0]], [[0.0, 0.0], [0.0, 0.0]], **names)


def design() -> ftc.Design:
    """The speed follows; the load pulsates once in 0.8 s."""
    speed = {"name": "speed", "unit": "rad/s", "nominal": 50.0}
    current = {"name": "current", "unit": "A", "nominal": 2.0}
    plant = ftc.Plant(
        [motor(inertia) for inertia in INERTIA.values()],
        sample_time=SAMPLE_TIME,
        disturbance_inputs=["load torque"],
        inputs=[{"name": "voltage", "unit": "V", "nominal": 5.0, "min": -24.0, "max": 24.0}],
        outputs=[{**speed, "min": -500.0, "max": 500.0}, {**current, "min": -50.0, "max": 50.0}],
        states=[speed, current],
        names=list(INERTIA),
    )
    return ftc.design(
        plant,
        name="dc_motor",
        tracked=["speed"],
        decay=0.96,
        output_weight=0.02,
        integral_weight=0.2,
        input_weight=0.05,
        disturbance={"period": 0.8, "amplitude": 0.02},
        scenario={
            "steps": 2400,
            "noise": [0.3, 0.02],
            "seed": 5,
            "schedule": [{"from": 0.0, "mode": 1}, {"from": 6.0, "mode": 2}],
            "reference": [{"kind": "square", "amplitude": 20.0, "period": 4.0, "offset": 150.0}],
            "events": [
                {"kind": "gain-loss", "sensor": 1, "from": 2.5, "until": 5.0, "loss": 0.2},
                {"kind": "bias", "sensor": 2, "from": 7.0, "until": 8.5, "size": 3.0},
                {"kind": "bias", "sensor": 1, "from": 9.5, "until": 11.0, "size": -25.0},
            ],
            "disturbance": [{"kind": "sine", "amplitude": 0.02, "period": 0.8}],
        },
    )


if __name__ == "__main__":
    study.main(design, Path(__file__))
