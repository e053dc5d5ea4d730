"""A second implementation of the loop with `method = "observer"`: estimator, observer, feedback, plant.

The estimator is `observer_bank`; observer, command and internal model are those of `reference_loop`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np

import record
import reference_loop
import scenario
from observer_bank import Bank

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


class Controller:
    """The controller of a design record in one of its variants."""

    def __init__(self, design: dict, mode: int, variant: str = "ftc") -> None:
        """Rests at the operating point of `mode`."""
        self.design, self.variant = design, variant
        self.feedback = design["controller"]["feedback"]
        self.settings = design["controller"]["estimator"]
        self.laws = reference_loop.Loop(design, np.zeros(0))
        self.modes = record.modes(design)
        self.repetition = reference_loop.Repetition(design)
        self.bank = Bank(design, mode)
        self.observer = reference_loop.Observer(design)
        self.observer.start(mode)
        self.internal = reference_loop.InternalModel(design)
        self.Z = np.zeros(len(self.internal.M))
        self.mode: int | None = None
        self.u = self.acting = self.modes[mode].u0
        self.offset, self.since = np.zeros(len(self.u)), math.inf
        self.f_hat = np.zeros(len(self.modes[0].y0))
        self.residual = np.zeros(len(self.f_hat))

    def tick(self, told: int, y: np.ndarray, y_ref: np.ndarray, fault: np.ndarray | None = None) -> dict:
        """Takes a sample and returns what the controller says; `fault` is the true one, for a variant that is told."""
        heard = self.repetition.screen(y)
        bank = self.bank
        bank.observe(told, heard)
        present = np.isfinite(heard)
        flagged = np.isin(np.arange(len(y)), list(bank.flagged))
        authority = np.array(self.settings["hypotheses"]["authority"])
        self.f_hat = np.where(flagged & present, np.clip(heard - bank.expected, -authority, authority), 0.0)
        self.residual = np.where(present, bank.residual, self.residual)
        finds = bank.finds_mode and self.variant == "ftc"
        mode = bank.mode if finds else told
        left = self._enter(mode, late=finds and bank.best.moved_by == mode, finds=finds)

        taken_out = self.laws.trusted_fault(self.variant, self.f_hat, fault)
        used = heard if self.variant == "ftc" else y
        y_c = np.where(np.isfinite(used), used - taken_out, bank.expected)
        self.observer.correct(mode, y_c)
        u = self._command(mode, left, y_ref, y_c)
        self.observer.advance(mode, self.acting, y_c)
        bank.advance(self.acting)
        outputs = {
            "u": u,
            "x_hat": self.observer.x_hat,
            "f_hat": self.f_hat,
            "residual": self.residual,
            "fault": flagged,
            "suspect": np.isin(np.arange(len(y)), list(bank.suspect)),
            "model_valid": [bank.model_valid],
            "load_hat": bank.load,
            "actuator_fault": bank.actuator_fault,
        }
        if bank.finds_mode:
            outputs |= {"mode_hat": [bank.mode + 1], "mode_probability": bank.probability}
        return {name: np.array(value, dtype=float) for name, value in outputs.items()}

    def _enter(self, mode: int, *, late: bool, finds: bool) -> int:
        """Returns the mode just left. A switch that is found a sample late is made up for: the observer moves again."""
        if self.mode is None and finds:
            self.observer.start(mode)
        left = mode if self.mode is None else self.mode
        self.mode = mode
        if left != mode and late:
            z, H, _, u, y = self.observer.pending
            self.observer.pending = (z, H, mode, u, y)
            return mode
        return left

    def _command(self, mode: int, left: int, y_ref: np.ndarray, y_c: np.ndarray) -> np.ndarray:
        te, feedback = record.sample_time(self.design), self.feedback
        wanted = self.laws.command(mode, self.observer.x_hat, self.Z, y_ref, self.u)
        transfer = feedback["transfer"]
        self.since += 1
        if left != mode and transfer and self.since >= transfer["samples"]:
            self.offset, self.since = self.u - wanted, 0
        wanted = wanted + self.offset
        before, self.u = self.u, self.laws.saturate(wanted)
        self.acting = before if feedback["latency"] else self.u
        unwinding = np.array(feedback["modes"][mode]["anti_windup"])
        error = te * (y_ref - y_c[feedback["tracked"]])
        self.Z = self.internal.M @ self.Z + self.internal.N @ error + unwinding @ (self.u - wanted)
        self.offset = self.offset * (transfer["decay"] if transfer else 0.0)
        return self.u


class Regulator(Protocol):
    """What closes a loop."""

    acting: np.ndarray

    def tick(self, told: int, y: np.ndarray, y_ref: np.ndarray, fault: np.ndarray) -> dict:
        """Takes a sample and returns what it says."""


def close(
    design: dict,
    noise: np.ndarray,
    regulator: Regulator,
    spoil: Callable[[int, np.ndarray], np.ndarray] | None = None,
    push: Callable[[int], np.ndarray] | None = None,
) -> Iterator[dict]:
    """Closes the loop of a design's scenario around a linear plant.

    Args:
        design: The record.
        noise: Of each sensor, one row per sample.
        regulator: What closes it.
        spoil: Changes the readings of a sample on their way.
        push: What acts on the state over a sample beside the model; over sample -1, how far from rest it begins.
    """
    loop = reference_loop.Loop(design, noise)
    te = record.sample_time(design)
    mode = loop.signals(0)[0]
    x = loop.true_modes[mode].x0 + (push(-1) if push else 0.0)
    sensors = scenario.Sensors(design["scenario"]["events"], loop.true_modes[mode].y0.copy())
    for tick in range(len(noise)):
        mode, y_ref, w, additive = loop.signals(tick)
        now = loop.true_modes[mode]
        y = sensors.read(now.C @ x + now.F @ w + now.c, noise[tick], additive, tick, te)
        y = spoil(tick, y) if spoil else y
        yield regulator.tick(mode, y, y_ref, sensors.fault) | {"x": x, "y": y}
        x = now.A @ x + now.B @ regulator.acting + now.E @ w + now.a + (push(tick) if push else 0.0)
