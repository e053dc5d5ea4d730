"""What a simulation gives: trajectories as arrays, tables and pictures, and figures of merit."""

from __future__ import annotations

import json
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ftc_fmu.errors import extra

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import matplotlib.figure
    import pandas as pd
    import xarray as xr

    from ftc_fmu import _core

VARIANTS = {
    "ftc": "fault-tolerant",
    "no_ftc": "without fault compensation",
    "told_the_fault": "told the true fault",
    "additive": "additive control as printed",
    "mpc": "model predictive control",
}


class Run:
    """One experiment in every variant of the controller.

    `run["t"]` (steps), `run["mode"]` (steps, from 1), `run["y_ref"]` (steps x r), `run["f"]` (steps x p)
    and `run["w"]` (steps x s) are the scenario; `run["ftc.y_true"]` and the like are the signals of a
    variant: `y`, `y_true`, `f_hat`, `residual`, `fault` (steps x p), `x`, `x_hat` (steps x n), `u`
    (steps x m). Physical units throughout.

    Attributes:
        metrics: Per variant `mse` and `vaf`, each `measured` and `true`, one number per tracked output.
        warnings: What is worth knowing of the design, of this run and of how it fares on plants that are not quite the
            model, one sentence each.
        variants: Keys of the variants that ran.
    """

    def __init__(self, core: _core.Run) -> None:
        """Wraps what was simulated."""
        self._core = core
        self.metrics: dict[str, Any] = json.loads(core.metrics())
        self.metrics.pop("warnings", None)
        self.warnings: list[str] = core.warnings()
        self.variants: list[str] = core.variants()

    @cached_property
    def _signals(self) -> dict[str, np.ndarray]:
        signals = {}
        for name, width, values in self._core.signals():
            array = np.frombuffer(values, dtype=np.float64)
            signals[name] = array if width == 0 else array.reshape(-1, width)
        return signals

    def __getitem__(self, signal: str) -> np.ndarray:
        """Returns a signal, one row per sample."""
        if signal not in self._signals:
            raise KeyError(f"{signal}: the signals are {', '.join(self._signals)}")
        return self._signals[signal]

    def __iter__(self) -> Iterator[str]:
        """Iterates over the names of the signals."""
        return iter(self._signals)

    def __len__(self) -> int:
        """Returns the number of signals."""
        return len(self._signals)

    def keys(self) -> list[str]:
        """Returns the names of the signals."""
        return list(self._signals)

    def to_pandas(self) -> pd.DataFrame:
        """Returns one row per sample, indexed by `t` (s); columns bear the names of trajectories.csv, as `ftc.y[1]`."""
        pandas = extra("pandas")
        columns = {}
        for name, values in self._signals.items():
            if values.ndim == 1:
                columns[name] = values
            else:
                columns |= {f"{name}[{number}]": column for number, column in enumerate(values.T, 1)}
        return pandas.DataFrame(columns).set_index("t")

    def to_xarray(self) -> xr.Dataset:
        """Returns a data set over `t` (s) and `variant`; the second dimension counts from 1."""
        xarray = extra("xarray")
        shared, own = {}, {}
        for name, values in self._signals.items():
            variant, _, signal = name.rpartition(".")
            if name == "t":
                continue
            if variant:
                own.setdefault(signal, {})[variant] = values
            else:
                shared[name] = values
        data = {}
        for name, values in shared.items():
            data[name] = (("t",) if values.ndim == 1 else ("t", _axis(name)), values)
        for name, runs in own.items():
            stacked = np.stack([runs[variant] for variant in self.variants])
            data[name] = (("variant", "t", _axis(name)), stacked)
        coordinates: dict[str, Any] = {"t": self["t"], "variant": self.variants}
        for dimensions, values in data.values():
            if len(dimensions) > 1:
                coordinates[dimensions[-1]] = np.arange(1, values.shape[-1] + 1)
        dataset = xarray.Dataset(data, coords=coordinates)
        dataset["t"].attrs["units"] = "s"
        return dataset

    def plot(self, variants: Sequence[str] = ("ftc", "no_ftc")) -> matplotlib.figure.Figure:
        """Draws the true tracked outputs beside their references, and the faults beside their estimates.

        Args:
            variants: Which variants to draw, of those that ran.

        Returns:
            The figure: a notebook shows it, `savefig` writes it.

        Raises:
            ValueError: No such variant ran.
        """
        pictures = extra("ftc_fmu._picture", "matplotlib")
        tracked, outputs = self._core.tracked(), self._core.outputs()
        shown = [variants] if isinstance(variants, str) else list(variants)
        unknown = [variant for variant in shown if variant not in self.variants]
        if unknown:
            raise ValueError(f"variants names {unknown[0]!r}: give some of {', '.join(self.variants)}")
        figure = pictures.Picture(figsize=(9, 2.4 * (len(tracked) + 1)), layout="constrained")
        axes = figure.subplots(len(tracked) + 1, 1, sharex=True)
        t = self["t"]
        for row, (ax, output) in enumerate(zip(axes, tracked, strict=False)):
            for variant in reversed(shown):
                ax.plot(t, self[f"{variant}.y_true"][:, output], label=VARIANTS[variant], linewidth=1.2)
            ax.step(t, self["y_ref"][:, row], "k--", where="post", label="reference", linewidth=0.9)
            ax.set_ylabel(outputs[output])
        axes[0].legend(loc="best", fontsize="small")
        for output, name in enumerate(outputs):
            (line,) = axes[-1].step(t, self["f"][:, output], where="post", label=f"fault of {name}", linewidth=1.2)
            estimate = self["ftc.f_hat"][:, output]
            axes[-1].plot(t, estimate, ":", color=line.get_color(), label=f"its estimate ({name})")
        axes[-1].legend(loc="best", fontsize="small")
        axes[-1].set_ylabel("sensor faults")
        axes[-1].set_xlabel("time (s)")
        return figure

    def __repr__(self) -> str:
        """Returns one line: samples and variants."""
        return f"<ftc_fmu.Run: {len(self['t'])} samples, {', '.join(self.variants)}>"

    def __str__(self) -> str:
        """Returns the table of figures of merit and the warnings that `ftc-fmu simulate` prints."""
        return self._core.text()

    def _repr_html_(self) -> str:
        """Shows the report in a notebook."""
        return self._core.html()


def _axis(signal: str) -> str:
    """Name of a signal's second dimension."""
    return {
        "y_ref": "tracked",
        "w": "disturbance_channel",
        "u": "input",
        "x": "state",
        "x_hat": "state",
    }.get(signal, "output")
