"""Ten designs of all sizes, from one state to twelve, made at random but always the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

RADIUS = 0.8
STEPS = 240


@dataclass(frozen=True)
class Sizes:
    """Numbers of states, inputs, outputs and modes."""

    states: int
    inputs: int
    outputs: int
    modes: int

    def __str__(self) -> str:
        """Returns the sizes as part of a name."""
        return f"n{self.states}_m{self.inputs}_p{self.outputs}_M{self.modes}"


ALL = [
    Sizes(1, 2, 3, 4),
    Sizes(2, 1, 3, 4),
    Sizes(3, 1, 2, 4),
    Sizes(4, 2, 1, 3),
    Sizes(5, 3, 4, 2),
    Sizes(6, 3, 2, 1),
    Sizes(7, 2, 4, 3),
    Sizes(8, 3, 5, 2),
    Sizes(10, 2, 4, 1),
    Sizes(12, 1, 3, 2),
]


def _mode(random: np.random.Generator, sizes: Sizes, output: np.ndarray) -> dict:
    """Returns a stable mode; all modes of a plant have the same sensors."""
    A = random.standard_normal((sizes.states, sizes.states))
    A *= RADIUS / max(abs(np.linalg.eigvals(A)))
    B = random.standard_normal((sizes.states, sizes.inputs))
    E = 0.3 * random.standard_normal((sizes.states, 1))
    return {name: matrix.round(4).tolist() for name, matrix in {"A": A, "B": B, "C": output, "E": E}.items()}


def design(sizes: Sizes, *, latency: int = 0) -> dict:
    """Returns a design of these sizes: one tracked output, a faulty sensor, modes in turn, noise.

    Args:
        sizes: The plant's.
        latency: Samples of delay in the loop.
    """
    random = np.random.default_rng(sizes.states)
    output = random.standard_normal((sizes.outputs, sizes.states))
    te = 0.1 * sizes.states
    schedule = [{"from": 40 * te * k, "mode": 1 + k % sizes.modes} for k in range(STEPS // 40)]
    fault = {"kind": "steps", "points": [[70 * te, 0.8], [150 * te, 0.0]]}
    return {
        "name": f"{sizes}_{latency}",
        "sample_time": te,
        "mode": [_mode(random, sizes, output) for _ in range(sizes.modes)],
        "controller": {"tracked": [1], "latency": latency, "lyapunov": "dwell", "decay": 0.95},
        "observer": {"kind": "luenberger", "decay": 0.95},
        "scenario": {
            "steps": STEPS,
            "noise": 0.002,
            "seed": sizes.states,
            "schedule": schedule,
            "reference": [{"kind": "square", "amplitude": 0.5, "period": 80 * te}],
            "fault": [*[0.0] * (sizes.outputs - 1), fault],
            "disturbance": [{"kind": "sine", "amplitude": 0.02, "period": 30 * te}],
        },
    }
