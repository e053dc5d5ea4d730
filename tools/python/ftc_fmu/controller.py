"""The controller that runs in the FMU, one sample at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ftc_fmu._plain import count, real, whole

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ftc_fmu import _core


class Controller:
    """The on-line code: the same numbers, to the last bit, as the exported FMU.

    Made by `Design.controller()`. Signals are in physical units.
    """

    def __init__(self, core: _core.Controller) -> None:
        """Wraps a controller at rest."""
        self._core = core

    def step(self, y: ArrayLike, y_ref: ArrayLike, mode: int = 1) -> np.ndarray:
        """Takes one sample and returns the command.

        Args:
            y: Measurement (p); a value that is not finite is a fault of that sensor.
            y_ref: Reference of the tracked outputs (r).
            mode: Active mode, from 1; of no account where the design finds it (`mode = "estimated"`).

        Returns:
            The command (m).

        Raises:
            ValueError: One sentence about a wrong size or mode.
        """
        return np.array(self._core.step(_vector(y, "y"), _vector(y_ref, "y_ref"), whole(mode, "mode", 0)))

    def __repr__(self) -> str:
        """Returns one line: sizes and whether estimated faults are taken out."""
        sizes = f"{count(len(self.f_hat), 'sensor')}, {count(len(self.u), 'command')}"
        return f"<ftc_fmu.Controller: {sizes}, ftc_enabled={self.ftc_enabled}>"

    @property
    def u(self) -> np.ndarray:
        """The last command (m)."""
        return np.array(self._core.u())

    @property
    def x_hat(self) -> np.ndarray:
        """Estimate of the state (n)."""
        return np.array(self._core.x_hat())

    @property
    def f_hat(self) -> np.ndarray:
        """Estimate of each sensor's fault (p), in the units of the outputs."""
        return np.array(self._core.f_hat())

    @property
    def residual(self) -> np.ndarray:
        """Measurement less what the healthy sensor would read (p)."""
        return np.array(self._core.residual())

    @property
    def fault(self) -> np.ndarray:
        """Which sensors are called faulty (p)."""
        return np.array(self._core.fault(), dtype=bool)

    @property
    def mode_hat(self) -> int | None:
        """The mode found from the readings, from 1; None where it is told."""
        return self._core.mode_hat()

    @property
    def mode_probability(self) -> np.ndarray:
        """How likely each mode is given the readings; empty where the mode is told."""
        return np.array(self._core.mode_probability())

    @property
    def ftc_enabled(self) -> bool:
        """Whether estimated faults are taken out of the loop."""
        return self._core.ftc_enabled()

    @ftc_enabled.setter
    def ftc_enabled(self, value: bool) -> None:
        self._core.set_ftc_enabled(bool(value))

    def reset(self, mode: int = 1) -> None:
        """Goes back to rest at the operating point of a mode (from 1)."""
        self._core.reset(whole(mode, "mode", 0))

    def copy(self) -> Controller:
        """Returns a controller in the same state, which goes its own way from here."""
        return Controller(self._core.copy())


def _vector(values: ArrayLike, name: str) -> list[float]:
    return np.atleast_1d(real(values, name)).ravel().tolist()
