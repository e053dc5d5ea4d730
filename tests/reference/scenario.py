"""The experiment: mode schedule, references, disturbance and sensor faults, tick by tick."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

ROUNDING = 1e-9


def first_tick(time: float, te: float) -> int:
    """Returns the first tick at or after `time`; rounding noise in `time / te` is forgiven."""
    return max(math.ceil(time / te - ROUNDING), 0)


def first_half(time: float, period: float) -> bool:
    """Says whether `time` falls into the first half of its period; an edge belongs to what follows."""
    return math.modf(time / period + ROUNDING)[0] % 1.0 < 0.5


def _steps(signal: dict, tick: int, te: float) -> float:
    value = 0.0
    for start, level in signal["points"]:
        if first_tick(start, te) <= tick:
            value = level
    return value


def waveform(signal: dict, tick: int, te: float) -> float:
    """Returns the value of one recorded signal at `tick`."""
    t = tick * te
    match signal["kind"]:
        case "constant":
            return signal["value"]
        case "steps":
            return _steps(signal, tick, te)
        case "square":
            sign = 1.0 if first_half(t, signal["period"]) else -1.0
            return signal["offset"] + sign * signal["amplitude"]
        case "sine":
            turns = math.fmod(t, signal["period"]) / signal["period"]
            return signal["offset"] + signal["amplitude"] * math.sin(2 * math.pi * turns + signal["phase"])
        case "ramp":
            return signal["value"] + signal["slope"] * max(min(t, signal["until"]) - signal["from"], 0.0)
        case "table":
            return signal["values"][min(tick, len(signal["values"]) - 1)]
        case unknown:
            raise ValueError(unknown)


def active_mode(schedule: list[dict], tick: int, te: float) -> int:
    """Returns the (0-based) mode that the schedule prescribes at `tick`."""
    return max(
        (entry for entry in schedule if first_tick(entry["from"], te) <= tick),
        key=lambda entry: entry["from"],
    )["mode"]


def faulty_reading(event: dict, reading: float, stuck_at: float, t: float) -> float:
    """Returns what a sensor under `event` shows in place of `reading`."""
    kind = event["kind"]
    since = t - event["from"]
    match kind["kind"]:
        case "bias":
            return reading + kind["size"]
        case "drift":
            return reading + kind["slope"] * since
        case "gain-loss":
            return (1.0 - kind["loss"]) * reading
        case "stuck":
            return stuck_at
        case "intermittent":
            return reading + (kind["size"] if first_half(since, kind["period"]) else 0.0)
        case "dropout":
            return math.nan
        case unknown:
            raise ValueError(unknown)


@dataclass
class Sensors:
    """The sensors, with the memory that a stuck one needs."""

    events: list[dict]
    last: np.ndarray
    fault: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def read(self, y_true: np.ndarray, noise: np.ndarray, additive: np.ndarray, tick: int, te: float) -> np.ndarray:
        """Returns the measurement; `fault` then holds what failure added to each sensor."""
        healthy = y_true + noise
        y = healthy + additive
        self.fault = additive.copy()
        for i in range(len(y)):
            active = [
                e
                for e in self.events
                if e["sensor"] == i and first_tick(e["from"], te) <= tick < first_tick(e["until"], te)
            ]
            for event in active:
                y[i] = faulty_reading(event, y[i], self.last[i], tick * te)
            if active:
                self.fault[i] = y[i] - healthy[i] if math.isfinite(y[i]) else 0.0
            else:
                self.last[i] = y[i]
        return y
