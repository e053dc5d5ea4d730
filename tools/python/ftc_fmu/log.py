"""Logs of healthy operation: what a plant was told and what its sensors said."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ftc_fmu import _core
from ftc_fmu._plain import real, whole
from ftc_fmu.errors import DesignFileError, extra

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from os import PathLike

    import pandas as pd


@dataclass(frozen=True)
class Log:
    """Samples of healthy operation at a fixed rate; row k holds the inputs that act from it on and the outputs there.

    Attributes:
        u: Inputs (samples x m).
        y: Outputs (samples x p).
        inputs: Names of the inputs (m).
        outputs: Names of the outputs (p).
        sample_time: Seconds between two samples.
        mode: Active mode of each sample, from 1; `None`: one mode throughout.
    """

    u: np.ndarray
    y: np.ndarray
    inputs: list[str]
    outputs: list[str]
    sample_time: float
    mode: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Checks sizes and numbers."""
        for key, values, names in (("u", self.u, self.inputs), ("y", self.y, self.outputs)):
            if values.ndim != 2 or values.shape[1] != len(names):
                raise DesignFileError(
                    f"{key} has shape {values.shape}, there are {len(names)} names: give samples x signals", key
                )
            bad = np.argwhere(~np.isfinite(values))
            if len(bad):
                row, column = bad[0]
                raise DesignFileError(
                    f"the log: row {row + 1}, {names[column]} is no number: leave such rows out, or fill them", key
                )
        modes = len(self.u) if self.mode is None else len(self.mode)
        if not len(self.u) == len(self.y) == modes:
            raise DesignFileError(
                f"the log has {len(self.u)} rows of inputs, {len(self.y)} of outputs and {modes} of modes: "
                "give one of each per sample",
                "y",
            )

    @classmethod
    def from_arrays(
        cls,
        u: np.ndarray,
        y: np.ndarray,
        sample_time: float,
        *,
        mode: Sequence[int] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> Log:
        """Makes a log of arrays (samples x m) and (samples x p)."""
        u, y = real(u, "u"), real(y, "y")
        u, y = (values[:, None] if values.ndim == 1 else values for values in (u, y))
        return cls(
            u,
            y,
            list(inputs or (f"u[{number}]" for number in range(1, u.shape[1] + 1))),
            list(outputs or (f"y[{number}]" for number in range(1, y.shape[1] + 1))),
            float(sample_time),
            None if mode is None else _modes(mode, "mode"),
        )

    @classmethod
    def from_dataframe(
        cls,
        frame: pd.DataFrame,
        inputs: Sequence[str],
        outputs: Sequence[str],
        *,
        time: str | None = None,
        mode: str | None = None,
        sample_time: float | None = None,
    ) -> Log:
        """Makes a log of a data frame, and so of all that pandas reads: Parquet, Excel, MDF4 by asammdf.

        Args:
            frame: One row per sample.
            inputs: Columns of the inputs.
            outputs: Columns of the outputs.
            time: Column of the time, as time stamps, or numbers in seconds or in the unit behind its name
                (`Time [ms]`). By default the index where it is more than a row's number, else the column
                that bears a usual name (`t`, `time`, `Time [s]`).
            mode: Column of the active mode, from 1; one mode throughout by default.
            sample_time: Seconds between two samples; from the time by default.

        Raises:
            DesignFileError: A column is missing, or the sampling is not even: which row, and by how much.
        """
        if not hasattr(frame, "columns"):
            raise DesignFileError(f"frame is of type {type(frame).__name__}: give a pandas.DataFrame", "frame")
        inputs, outputs = ([names] if isinstance(names, str) else list(names) for names in (inputs, outputs))
        wanted = [*inputs, *outputs, *([time] if time else []), *([mode] if mode else [])]
        missing = [name for name in wanted if name not in frame.columns]
        if missing:
            known = ", ".join(map(str, frame.columns))
            raise DesignFileError(f'the data frame has no column "{missing[0]}": its columns are {known}', missing[0])
        sample_time = _rate(_seconds(frame, time, [*inputs, *outputs, mode]), sample_time)
        return cls(
            _columns(frame, inputs),
            _columns(frame, outputs),
            [str(name) for name in inputs],
            [str(name) for name in outputs],
            sample_time,
            _modes(frame[mode], f'column "{mode}"') if mode else None,
        )

    def to_csv(self, path: str | PathLike[str]) -> Path:
        """Writes the log as a design file's `estimator.database` reads it; returns the path."""
        path = Path(path)
        header = ["t", *([] if self.mode is None else ["mode"]), *self.inputs, *self.outputs]
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(header)
            for row, (u, y) in enumerate(zip(self.u.tolist(), self.y.tolist(), strict=True)):
                mode = [] if self.mode is None else [int(self.mode[row])]
                writer.writerow([row * self.sample_time, *mode, *u, *y])
        return path

    def __len__(self) -> int:
        """Returns the number of samples."""
        return len(self.y)


def _columns(frame: pd.DataFrame, names: Sequence[str]) -> np.ndarray:
    """Columns as numbers (rows x columns); NaN where a table has none."""
    found = []
    for name in names:
        column = frame[name]
        if column.ndim != 1:
            raise DesignFileError(f'the data frame has two columns "{name}": rename one of them', name)
        try:
            found.append(column.to_numpy(dtype=float, na_value=np.nan))
        except (TypeError, ValueError) as error:
            raise DesignFileError(
                f'column "{name}" holds what is no number ({error}): convert it; for decimal commas, '
                'pandas.read_csv(..., decimal=",")',
                name,
            ) from error
    return np.array(found).reshape(len(found), len(frame)).T


def _modes(values: Iterable[object], where: str) -> np.ndarray:
    """Modes of all samples, from 1."""
    return np.array([whole(mode, f"{where}, row {row}", 1) for row, mode in enumerate(values, 1)], dtype=int)


def _seconds(frame: pd.DataFrame, time: str | None, signals: Sequence[str | None]) -> np.ndarray | None:
    """The time of each row in seconds; None where nothing tells it."""
    pandas = extra("pandas")
    names = [str(name) for name in frame.columns]
    taken = [at for at, name in enumerate(frame.columns) if name in signals]
    if time is None and not isinstance(frame.index, pandas.RangeIndex):
        stamps, unit = frame.index.to_series(), 1.0
    else:
        found = _core.time_column(names, None if time is None else str(time), taken)
        if found is None:
            return None
        stamps, unit = frame.iloc[:, found[0]], found[1]
    try:
        if stamps.dtype.kind not in "Mmiuf":
            numbers = pandas.to_numeric(stamps, errors="coerce")
            whole_column = not numbers.isna().any()
            stamps = numbers if whole_column else pandas.to_datetime(stamps, format="ISO8601")
        if stamps.dtype.kind in "Mm":
            return (stamps - stamps.iloc[0]).dt.total_seconds().to_numpy(dtype=float)
        return stamps.to_numpy(dtype=float) * unit
    except (TypeError, ValueError) as error:
        raise DesignFileError(f"the time column is no time ({error}): name another by time=", "time") from error


def _rate(t: np.ndarray | None, said: float | None) -> float:
    """The sample time: what the rows' times say, which must be what is said."""
    if said is not None:
        said = float(real(said, "sample_time"))
        if not (np.isfinite(said) and said > 0.0):
            raise DesignFileError(f"sample_time is {said}: give a positive number of seconds", "sample_time")
    if t is None:
        if said is None:
            raise DesignFileError(
                "no column tells the time: name one, time=..., or give sample_time=, in seconds", "time"
            )
        return said
    found = _sample_time(t)
    if said is not None and abs(found - said) > _core.DRIFT * said:
        raise DesignFileError(
            f"the rows are {found:.6g} s apart on average, sample_time is {said:.6g}: give the log's, or none",
            "sample_time",
        )
    return found if said is None else said


def _sample_time(t: np.ndarray) -> float:
    """The sample time of even times in seconds."""
    if len(t) < 2:
        raise DesignFileError(f"the log has {len(t)} rows: record more", "time")
    if not np.isfinite(t).all():
        row = int(np.argmin(np.isfinite(t))) + 1
        raise DesignFileError(f"the time of row {row} is missing: leave the row out", "time")
    steps = np.diff(t)
    sample_time = float(np.median(steps))
    off = np.abs(steps - sample_time) > 0.05 * abs(sample_time)
    if sample_time <= 0.0 or off.any():
        row = int(np.argmax(off)) if off.any() else 0
        raise DesignFileError(
            f"the time goes from {t[row]} to {t[row + 1]} s after row {row + 1}, other steps are {sample_time} s: "
            "give evenly sampled rows, or resample them",
            "time",
        )
    return float((t[-1] - t[0]) / (len(t) - 1))
