"""Logs from data frames, and plants identified from them.

promise: identify
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

import ftc_fmu as ftc

if TYPE_CHECKING:
    from pathlib import Path


def healthy(plant: ftc.Plant, samples: int, *, dwell: int, noise: float, seed: int) -> ftc.Log:
    """Moves the plant's inputs about and writes down what its sensors say."""
    random = np.random.default_rng(seed)
    m, p = plant.modes[0].B.shape[1], len(plant.modes[0].C)
    mode = np.arange(samples) // dwell % len(plant.modes)
    u = np.repeat(random.normal(size=(samples // 3 + 1, m)), 3, axis=0)[:samples]
    x, y = np.zeros(len(plant.modes[0].A)), np.empty((samples, p))
    for k in range(samples):
        active = plant.modes[mode[k]]
        y[k] = active.C @ x + noise * random.normal(size=p)
        x = active.A @ x + active.B @ u[k]
    return ftc.Log.from_arrays(
        u, y, plant.sample_time, mode=mode + 1, inputs=["pump 1", "pump 2"], outputs=["level 1", "level 2"]
    )


def test_a_plant_that_was_never_modelled_gets_an_fmu(tanks: ftc.Plant, tmp_path: Path) -> None:
    """Identified from a log, designed, and run on the true plant, which identification never saw."""
    log = healthy(tanks, 6000, dwell=250, noise=0.01, seed=1)
    found = ftc.Plant.identify(log)
    assert found.order == 2
    assert found.coordinates == "switches"
    assert (found.fit > 95.0).all(), str(found)
    assert "<- chosen" in str(found)
    design = ftc.design(found.plant, name="identified", tracked=[1, 2], decay=0.97, estimator={"database": log})
    controller = design.controller()
    random = np.random.default_rng(2)
    x, error = np.zeros(2), []
    for k in range(600):
        mode = 1 + (k // 150) % 2
        active = tanks.modes[mode - 1]
        fault = np.array([2.0, 0.0]) if 250 <= k < 400 else np.zeros(2)
        y_true = active.C @ x
        u = controller.step(y_true + fault + 0.01 * random.normal(size=2), [1.0, -0.5], mode)
        x = active.A @ x + active.B @ u
        error.append(y_true - [1.0, -0.5])
    settled = np.abs(np.array(error))[200:]
    # Without fault tolerance the first level would be off by the fault, 2.
    assert settled.max() < 0.5, settled.max(axis=0)
    assert [path.suffix for path in design.export(tmp_path)] == [".fmu", ".fmu"]


def test_logs_of_one_mode_each(tanks: ftc.Plant) -> None:
    """In their order; states are then the outputs."""
    logs = []
    for number in range(2):
        alone = ftc.Plant([(tanks.modes[number].A, tanks.modes[number].B, tanks.modes[number].C)], tanks.sample_time)
        log = healthy(alone, 800, dwell=800, noise=0.01, seed=number)
        logs.append(ftc.Log(log.u, log.y, log.inputs, log.outputs, log.sample_time))
    found = ftc.Plant.identify(logs, order=2)
    assert found.coordinates == "outputs"
    for mode, truth in zip(found.plant.modes, tanks.modes, strict=True):
        np.testing.assert_allclose(mode.C, np.eye(2), atol=1e-9)
        np.testing.assert_allclose(mode.A, truth.A, atol=0.02)


def test_data_frames(tmp_path: Path) -> None:
    """With seconds or dates, as Parquet and Excel bring them; a log is written as the design reads it."""
    t = np.arange(100) * 0.5
    frame = pd.DataFrame({"Time [s]": t, "valve": np.sin(t), "level": np.cos(t), "gear": 1})
    by_seconds = ftc.Log.from_dataframe(frame, ["valve"], ["level"], time="Time [s]", mode="gear")
    dates = frame.set_index(pd.Timestamp("2024-01-01") + pd.to_timedelta(t, unit="s"))
    by_dates = ftc.Log.from_dataframe(dates, ["valve"], ["level"])
    for log in (by_seconds, by_dates):
        assert log.sample_time == pytest.approx(0.5)
        np.testing.assert_array_equal(log.y[:, 0], frame["level"])
    text = by_seconds.to_csv(tmp_path / "log.csv").read_text().splitlines()
    assert text[0] == "t,mode,valve,level"
    assert len(text) == 101


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda frame: frame.drop(index=40), "after row 40"),
        (lambda frame: frame.assign(level=np.where(frame.index == 7, np.nan, 1.0)), "row 8, level is no number"),
        (lambda frame: frame.rename(columns={"valve": "Valve"}), 'no column "valve"'),
    ],
)
def test_what_a_log_may_not_be(change: object, says: str) -> None:
    """A gap, a hole, a missing column."""
    t = np.arange(100) * 0.5
    frame = pd.DataFrame({"t": t, "valve": np.sin(t), "level": np.cos(t)})
    with pytest.raises(ftc.DesignFileError, match=says):
        ftc.Log.from_dataframe(change(frame), ["valve"], ["level"], time="t")


@pytest.mark.parametrize(
    ("change", "options", "says"),
    [
        (lambda frame: frame.assign(level="1,5"), {"time": "t"}, 'column "level" holds what is no number'),
        (
            lambda frame: frame.assign(gear=1.5),
            {"time": "t", "mode": "gear"},
            'column "gear", row 1 is 1.5: give a whole',
        ),
        (
            lambda frame: frame.assign(gear="a"),
            {"time": "t", "mode": "gear"},
            "row 1 is 'a': give a whole number from 1",
        ),
        (lambda frame: frame.assign(gear=np.nan), {"time": "t", "mode": "gear"}, "row 1 is nan: give a whole number"),
        (lambda frame: frame.drop(columns="t"), {}, "no column tells the time"),
        (lambda frame: frame.rename(columns={"t": "Time [fortnights]"}), {}, "whose unit is not known"),
        (lambda frame: frame.assign(time=frame["t"]), {}, "two columns that may be the time"),
        (lambda frame: frame.assign(t=frame["t"] * 1.05), {"sample_time": 0.5}, "0.525 s apart on average"),
        (lambda frame: frame.assign(t="yesterday"), {}, "the time column is no time"),
        (lambda frame: frame.to_numpy(), {}, r"give a pandas\.DataFrame"),
    ],
)
def test_what_a_data_frame_may_not_be(change: object, options: dict, says: str) -> None:
    """Text for numbers, a mode that is none, a time that is not told or told twice."""
    t = np.arange(100) * 0.5
    frame = pd.DataFrame({"t": t, "valve": np.sin(t), "level": np.cos(t)})
    with pytest.raises(ftc.DesignFileError, match=says):
        ftc.Log.from_dataframe(change(frame), ["valve"], ["level"], **options)


def test_the_time_of_a_data_frame_is_found() -> None:
    """By the usual names, with their units; a column is not passed over for the numbers of rows."""
    t = np.arange(100) * 0.5
    signals = pd.DataFrame({"valve": np.sin(t), "level": np.cos(t)})
    stamps = (pd.Timestamp("2024-01-01") + pd.to_timedelta(t, unit="s")).astype(str)
    frames = [
        signals.assign(**{"Time [s]": t}),
        signals.assign(**{"time (ms)": 1000.0 * t}),
        signals.assign(Timestamp=stamps),
        signals.set_index(t),
    ]
    for frame in frames:
        log = ftc.Log.from_dataframe(frame, "valve", "level")
        assert log.sample_time == pytest.approx(0.5)
    assert ftc.Log.from_dataframe(signals, "valve", "level", sample_time=2).sample_time == 2.0


@pytest.mark.parametrize("order", [0, -1, 1.5, "two"])
def test_an_order_is_a_whole_number(order: object) -> None:
    """Of at least one state."""
    log = ftc.Log.from_arrays(np.sin(np.arange(200.0)), np.arange(200.0), 1.0)
    with pytest.raises(ftc.DesignFileError, match=r"order is .*: give a whole number from 1 on"):
        ftc.Plant.identify(log, order=order)
    with pytest.raises(ftc.DesignFileError, match="log 1 is of type ndarray"):
        ftc.Plant.identify(np.zeros((200, 2)))


def test_a_log_without_excitation_is_refused() -> None:
    """One sentence."""
    log = ftc.Log.from_arrays(np.ones((100, 1)), np.arange(100.0), 1.0)
    with pytest.raises(ftc.DesignFileError, match="input 1 never changes"):
        ftc.Plant.identify(log)
