"""The fit to a log against SciPy's least squares with every unknown of every window written out.

promise: fitted-model
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.optimize import least_squares

import commands
import record

if TYPE_CHECKING:
    from pathlib import Path

SAMPLES, WINDOW, HELD_BACK, PERIOD = 400, 40, 4, 60.0
NOISE, MODEL_ERROR, NOMINAL, OF_LARGEST = 0.02, 0.1, 2.0, 0.1
SIGNAL = f'{{{{ name = "{{}}{{}}", nominal = {NOMINAL} }}}}'
N, M, P, S = 2, 1, 3, 1
SHAPES = {"a": (N, N), "b": (N, M), "e": (N, S), "c": (P, N), "f": (P, S)}
MODEL = {
    "a": np.array([[0.8, 0.1], [-0.2, 0.6]]),
    "b": np.array([[0.5], [0.3]]),
    "e": np.array([[0.2], [0.3]]),
    "c": np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]]),
    "f": np.zeros((P, S)),
}


def log(folder: Path, *, sensors_wrong: bool) -> tuple[np.ndarray, np.ndarray]:
    """Writes a log of a plant that is not quite the model; returns its inputs and outputs."""
    random = np.random.default_rng(5)
    plant = {key: matrix.copy() for key, matrix in MODEL.items()}
    plant["a"][0, 0] *= 0.95
    plant["b"][1, 0] *= 1.1
    if sensors_wrong:
        plant["c"][0, 0] *= 1.08
        plant["c"][2, 1] *= 0.93
    x, u = np.zeros(N), np.ones(M)
    inputs, outputs = np.zeros((SAMPLES, M)), np.zeros((SAMPLES, P))
    for k in range(SAMPLES):
        u = np.where(random.random(M) < 0.2, -u, u)
        inputs[k], outputs[k] = u, plant["c"] @ x + NOISE * random.standard_normal(P)
        w = np.array([np.sin(2 * np.pi * k / PERIOD + 0.3)])
        x = plant["a"] @ x + plant["b"] @ u + plant["e"] @ w
    rows = np.column_stack([np.arange(SAMPLES), inputs, outputs])
    header = ",".join(["t", "i0", *(f"o{q}" for q in range(P))])
    np.savetxt(folder / "log.csv", rows, "%.17g", ",", header=header, comments="")
    return inputs, outputs


def fitted(folder: Path) -> dict:
    """Returns what the program fits to the log."""
    mode = ", ".join(f"{key.upper()} = {json.dumps(matrix.tolist())}" for key, matrix in MODEL.items())
    counts = {"inputs": M, "outputs": P, "states": N}
    signals = "".join(
        f"{kind} = [{', '.join(SIGNAL.format(kind[0], number) for number in range(count))}]\n"
        for kind, count in counts.items()
    )
    text = f"""
name = "fitted"
sample_time = 1.0
mode = [{{ {mode} }}]
[signals]
{signals}
[disturbance]
period = {PERIOD}
[controller]
tracked = [1]
decay = 0.95
[estimator]
method = "observer"
database = "log.csv"
model_error = {MODEL_ERROR}
"""
    path = folder / "fitted.toml"
    path.write_text(text)
    design = record.load(commands.export(path, folder).controller)
    (found,) = design["controller"]["estimator"]["hypotheses"]["fitted"]
    return {key: np.array(found[key]).reshape(shape) for key, shape in SHAPES.items()}


def sizes() -> dict:
    """Returns what the error of each entry is relative to; all nominal values are the same."""
    motion = np.maximum(abs(MODEL["a"]).max(1), abs(MODEL["b"]).max(1))[:, None]
    return {
        "a": np.maximum(abs(MODEL["a"]), OF_LARGEST * motion),
        "b": np.maximum(abs(MODEL["b"]), OF_LARGEST * motion),
        "e": np.maximum(abs(MODEL["e"]), OF_LARGEST * abs(MODEL["e"]).max(0)),
        "c": np.maximum(abs(MODEL["c"]), OF_LARGEST * abs(MODEL["c"]).max(1)[:, None]),
    }


@pytest.mark.parametrize("sensors_wrong", [False, True])
def test_the_fit_is_the_least_of_its_sum_of_squares(tmp_path: Path, *, sensors_wrong: bool) -> None:
    """Of the matrices that the program changed; the others are the design's to the bit."""
    inputs, outputs = log(tmp_path, sensors_wrong=sensors_wrong)
    found = fitted(tmp_path)
    free = [key for key in ("a", "b", "e", "c") if (found[key] != MODEL[key]).any()]
    assert ("c" in free) == sensors_wrong
    assert {"a", "b"} <= set(free)
    windows = [at for at in range(SAMPLES // WINDOW) if at % HELD_BACK != HELD_BACK - 1]
    own = N + 3 * S

    def rest(theta: np.ndarray, starts: np.ndarray) -> np.ndarray:
        """Returns what the readings of each window differ by from a simulation of it."""
        matrices, at = dict(MODEL), 0
        for key in free:
            count = MODEL[key].size
            matrices[key] = theta[at : at + count].reshape(SHAPES[key])
            at += count
        of = []
        for window, unknown in zip(windows, starts.reshape(-1, own), strict=True):
            x, (level, sine, cosine) = unknown[:N], unknown[N:]
            for k in range(window * WINDOW, (window + 1) * WINDOW):
                angle = 2 * np.pi * k / PERIOD
                w = level + sine * np.sin(angle) + cosine * np.cos(angle)
                of.append(outputs[k] - matrices["c"] @ x)
                x = matrices["a"] @ x + matrices["b"] @ inputs[k] + matrices["e"][:, 0] * w
        return np.array(of)

    prior = MODEL_ERROR * np.concatenate([sizes()[key].ravel() for key in free])
    design = np.concatenate([MODEL[key].ravel() for key in free])
    ours = np.concatenate([found[key].ravel() for key in free])
    unknown = np.concatenate([ours, np.zeros(len(windows) * own)])
    deviation = np.full(P, NOISE)
    # The deviations are those of what the fit leaves, so they are found along.
    for _ in range(3):

        def cost(z: np.ndarray, deviation: np.ndarray = deviation) -> np.ndarray:
            left = rest(z[: len(ours)], z[len(ours) :]) / deviation
            return np.concatenate([left.ravel(), (z[: len(ours)] - design) / prior])

        unknown = least_squares(cost, unknown, x_scale="jac").x
        left = rest(unknown[: len(ours)], unknown[len(ours) :])
        deviation = np.sqrt((left**2).sum(0) / (len(left) - len(windows) * own / P))
    theirs = unknown[: len(ours)]
    assert abs(theirs - design).max() > 0.02
    worst = (abs(ours - theirs) / prior).max()
    assert worst < 0.02, f"{worst}: {ours} for {theirs}"
