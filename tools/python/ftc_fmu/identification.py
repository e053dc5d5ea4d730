"""Plants from logs of healthy operation, without a model."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ftc_fmu import _core
from ftc_fmu._plain import whole
from ftc_fmu.errors import DesignFileError
from ftc_fmu.log import Log
from ftc_fmu.plant import Plant

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


@dataclass(frozen=True)
class Identification:
    """What was found in logs; `plant` is ready for `ftc_fmu.design`.

    Attributes:
        plant: One linear model per mode, about the steady state at the log's mean inputs.
        order: Number of states.
        tried: Per order that was tried, its mean fit on validation data in percent.
        fit: Per mode and output (modes x p), fit of a free simulation to data that no choice has
            seen, in percent: `100 (1 - |y - y_sim| / |y - mean(y)|)`.
        held_out: Samples per mode that `fit` was computed on.
        coordinates: How the modes' states were made one: `switches` that were logged (with
            `switch_fit`, in percent), `outputs` where too few were, or `single mode`.
        switch_fit: How well the state after a switch follows from the one before, in percent.
    """

    plant: Plant
    order: int
    tried: dict[int, float]
    fit: np.ndarray
    held_out: list[int]
    coordinates: str
    switch_fit: float | None
    _text: str = field(repr=False)

    def __str__(self) -> str:
        """Returns the orders tried, the one chosen, and the fit per mode."""
        return self._text


def identify(
    logs: Log | Sequence[Log], order: int | None = None, disturbance: Mapping[str, Any] | None = None
) -> Identification:
    """Identifies a plant from logs of healthy operation (subspace identification).

    Args:
        logs: One log, or several of the same signals. Where no log says its `mode`, several logs
            are one mode each, in their order.
        order: Number of states; by default the smallest that fits validation data nearly as well as the best.
        disturbance: `{"period": seconds, "harmonics": count}` of a periodic disturbance that is in the
            logs and that nobody measured; it is told from the plant.

    Raises:
        DesignFileError: One sentence about what the logs lack.
    """
    logs = list(logs) if isinstance(logs, list | tuple) else [logs]
    for number, log in enumerate(logs, 1):
        if not isinstance(log, Log):
            raise DesignFileError(
                f"log {number} is of type {type(log).__name__}: give an ftc_fmu.Log, as Log.from_dataframe makes",
                "logs",
            )
    order = None if order is None else whole(order, "order", 1)
    if not logs:
        raise DesignFileError("there is no log: give at least one", "logs")
    first = logs[0]
    for number, log in enumerate(logs, 1):
        same = (log.inputs, log.outputs) == (first.inputs, first.outputs)
        if not same or abs(log.sample_time - first.sample_time) > 1e-6 * first.sample_time:
            raise DesignFileError(f"log {number} has other signals or another sample time than log 1", "logs")
    unsaid = all(log.mode is None for log in logs)
    data = []
    for number, log in enumerate(logs, 1):
        mode = log.mode if log.mode is not None else np.full(len(log), number if unsaid else 1)
        data.append((log.u.tolist(), log.y.tolist(), [int(value) for value in mode]))
    known = dict(disturbance or {})
    period = (float(known["period"]), int(known.get("harmonics", 1)), first.sample_time) if known else None
    names = [str(name) for name in first.outputs]
    chosen, tried, modes, coordinates, switch_fit, text = _core.identify(data, order, period, names)
    points = [dict(zip("xuy", point, strict=True)) for _, _, _, point, _, _, _ in modes]
    plant = Plant(
        [(A, B, C) for A, B, C, *_ in modes],
        first.sample_time,
        inputs=first.inputs,
        outputs=first.outputs,
        operating_points=points,
    )
    return Identification(
        plant=plant,
        order=chosen,
        tried=dict(tried),
        fit=np.array([mode[4] for mode in modes]),
        held_out=[mode[5] for mode in modes],
        coordinates=coordinates,
        switch_fit=switch_fit,
        _text=text.rstrip("\n"),
    )
