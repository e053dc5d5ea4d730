"""What the tests of the installed package share."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import ftc_fmu as ftc

ROOT = Path(__file__).resolve().parents[3]
EXAMPLES = ROOT / "examples"


@pytest.fixture(scope="session")
def paper() -> ftc.Design:
    """The paper's example, from its design file."""
    return ftc.load(EXAMPLES / "paper.toml")


@pytest.fixture(scope="session")
def tanks() -> ftc.Plant:
    """Two coupled reservoirs in continuous time, with a disturbance as third input."""
    C, D = np.eye(2), np.zeros((2, 3))
    return ftc.Plant(
        [
            ([[-0.1, 0.0], [0.0, -0.14]], [[0.6, 0.0, 0.1], [0.0, 0.7, 0.06]], C, D, 0),
            ([[-0.2, 0.06], [0.06, -0.22]], [[0.6, 0.0, 0.1], [0.0, 0.7, 0.06]], C, D, 0),
        ],
        sample_time=2.0,
        disturbance_inputs=[2],
        inputs=["pump 1", {"name": "pump 2", "unit": "l/min"}],
        outputs=["level 1", "level 2"],
    )
