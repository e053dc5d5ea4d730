"""Logs of healthy operation: what a plant was told and what its sensors said."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ftc_fmu.errors import DesignFileError

if TYPE_CHECKING:
    from collections.abc import Sequence
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
        if len(self.u) != len(self.y) or (self.mode is not None and len(self.mode) != len(self.y)):
            raise DesignFileError(f"the log has {len(self.u)} rows of inputs and {len(self.y)} of outputs", "y")

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
        u, y = (np.asarray(values, dtype=float) for values in (u, y))
        u, y = (values[:, None] if values.ndim == 1 else values for values in (u, y))
        return cls(
            u,
            y,
            list(inputs or (f"u[{number}]" for number in range(1, u.shape[1] + 1))),
            list(outputs or (f"y[{number}]" for number in range(1, y.shape[1] + 1))),
            float(sample_time),
            None if mode is None else np.asarray(mode, dtype=int),
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
            time: Column of the time, in seconds or as time stamps; the index by default.
            mode: Column of the active mode, from 1; one mode throughout by default.
            sample_time: Seconds between two samples; from the time by default.

        Raises:
            DesignFileError: A column is missing, or the sampling is not even: which row, and by how much.
        """
        wanted = [*inputs, *outputs, *([time] if time else []), *([mode] if mode else [])]
        missing = [name for name in wanted if name not in frame.columns]
        if missing:
            known = ", ".join(map(str, frame.columns))
            raise DesignFileError(f'the data frame has no column "{missing[0]}": its columns are {known}', missing[0])
        stamps = frame[time] if time else frame.index.to_series()
        if sample_time is None:
            sample_time = _sample_time(stamps)
        return cls(
            frame[list(inputs)].to_numpy(dtype=float),
            frame[list(outputs)].to_numpy(dtype=float),
            [str(name) for name in inputs],
            [str(name) for name in outputs],
            float(sample_time),
            frame[mode].to_numpy(dtype=int) if mode else None,
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


def _sample_time(stamps: pd.Series) -> float:
    """The sample time of even time stamps (seconds or dates)."""
    if stamps.dtype.kind in "Mm":
        stamps = (stamps - stamps.iloc[0]).dt.total_seconds()
    try:
        t = stamps.to_numpy(dtype=float)
    except (TypeError, ValueError) as error:
        raise DesignFileError(f"the time column is no time ({error}): name another by time=", "time") from error
    if len(t) < 2:
        raise DesignFileError(f"the log has {len(t)} rows: record more", "time")
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
