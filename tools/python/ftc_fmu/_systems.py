"""State-space matrices out of the objects that hold them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ftc_fmu import _core
from ftc_fmu._plain import real
from ftc_fmu.errors import DesignFileError


@dataclass(frozen=True)
class Matrices:
    """One state-space model as it was given; `dt` is 0 for continuous time, else seconds."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    dt: float | None
    where: str
    inputs: list[str] | None = None
    outputs: list[str] | None = None
    states: list[str] | None = None

    def discretised(self, sample_time: float) -> Matrices:
        """Returns the model at a sample time: exact for an input that is held between samples."""
        if self.dt is None or self.dt == sample_time:
            return replace(self, dt=sample_time)
        if self.dt != 0.0:
            raise DesignFileError(
                f"{self.where} has a sample time of {self.dt} s, the plant one of {sample_time} s: "
                "give the continuous model, or the same sample time",
                "sample_time",
            )
        try:
            A, B = _core.discretise(self.A.tolist(), self.B.tolist(), sample_time)
        except ValueError as error:
            raise DesignFileError(f"{self.where}: {error}", "sample_time") from error
        n, m = self.B.shape
        return replace(self, A=np.array(A).reshape(n, n), B=np.array(B).reshape(n, m), dt=sample_time)

    def named_as(self, first: Matrices) -> Matrices:
        """Returns the model with the first model's names where it has none of its own.

        Raises:
            DesignFileError: It has the same names in another order.
        """
        kinds = ("inputs", "outputs", "states")
        for kind in kinds:
            mine, others = getattr(self, kind), getattr(first, kind)
            if mine and others and mine != others and sorted(mine) == sorted(others):
                raise DesignFileError(
                    f"{self.where} has the {kind} {', '.join(mine)}, {first.where} {', '.join(others)}: "
                    "give them in one order",
                    self.where,
                )
        return replace(self, **{kind: getattr(self, kind) or getattr(first, kind) for kind in kinds})


def is_model(system: object) -> bool:
    """Whether something holds state-space matrices under their names."""
    return all(hasattr(system, name) for name in "ABCD")


def matrices(system: Any, where: str, *, continuous: bool) -> Matrices:  # noqa: ANN401  (duck typing is the point)
    """Returns the matrices of a model.

    Args:
        system: `control.StateSpace`, `scipy.signal.StateSpace`, or arrays `(A, B, C, D[, dt])`.
        where: What to call it in a refusal.
        continuous: What arrays without a `dt` are.

    Raises:
        DesignFileError: Where it is none of these, or sizes do not fit.
    """
    if isinstance(system, tuple | list):
        return _checked(_from_arrays(system, where, continuous=continuous))
    if not is_model(system):
        transfer = " (control.ss(...) and .to_ss() of SciPy make one)" if hasattr(system, "num") else ""
        raise DesignFileError(
            f"{where} is of type {type(system).__name__}: give a control.StateSpace, a scipy.signal.StateSpace"
            f"{transfer} or arrays (A, B, C, D)",
            where,
        )
    # python-control: 0 continuous, True discrete at an unsaid sample time, None unsaid;
    # scipy: None continuous. Only the first has labels.
    labelled = hasattr(system, "input_labels")
    dt = system.dt
    if dt is True:
        dt = None
    elif dt is None:
        dt = (0.0 if continuous else None) if labelled else 0.0
    labels = [_labels(system, kind) if labelled else None for kind in ("input", "output", "state")]
    given = [real(getattr(system, name), name, f"{where}: ") for name in "ABCD"]
    return _checked(Matrices(*given, dt, where, *labels))


def _labels(system: Any, kind: str) -> list[str] | None:  # noqa: ANN401
    """Names that a person gave; python-control's own (`u[0]`, `x[1]`) say nothing."""
    labels = [str(label) for label in getattr(system, f"{kind}_labels")]
    letter = {"input": "u", "output": "y", "state": "x"}[kind]
    default = [f"{letter}[{number}]" for number in range(len(labels))]
    return None if labels == default else labels


def _from_arrays(system: tuple | list, where: str, *, continuous: bool) -> Matrices:
    if len(system) not in (3, 4, 5):
        raise DesignFileError(
            f"{where} has {len(system)} parts: give (A, B, C), (A, B, C, D) or (A, B, C, D, dt)", where
        )
    A, B, C = (np.atleast_2d(real(part, name, f"{where}: ")) for part, name in zip(system[:3], "ABC", strict=True))
    n = len(A)
    if B.shape[0] != n and B.size == n:
        B = B.reshape(n, 1)
    given = system[3] if len(system) > 3 else None
    D = np.zeros((len(C), B.shape[1])) if given is None else np.atleast_2d(real(given, "D", f"{where}: "))
    if D.size == 1 and D.flat[0] == 0.0:
        D = np.zeros((len(C), B.shape[1]))
    dt = 0.0 if continuous else None
    if len(system) == 5:
        dt = 0.0 if system[4] is None else _sample_time(system[4], where)
    return Matrices(A, B, C, D, dt, where)


def _sample_time(dt: object, where: str) -> float:
    given = real(dt, "dt", f"{where}: ")
    if given.ndim or not np.isfinite(given) or given < 0.0:
        raise DesignFileError(f"{where}: dt is {dt}: give seconds, or 0 for a continuous model", "dt")
    return float(given)


def _checked(model: Matrices) -> Matrices:
    n, m, p = model.A.shape[0], model.B.shape[-1], model.C.shape[0]
    for name, wanted in (("A", (n, n)), ("B", (n, m)), ("C", (p, n)), ("D", (p, m))):
        matrix = getattr(model, name)
        if matrix.ndim != 2:
            raise DesignFileError(f"{model.where}: {name} has {matrix.ndim} dimensions: give rows and columns", name)
        if matrix.shape != wanted:
            # What B and C should be besides is told by themselves, so a transposed one tells it wrongly.
            turned = {"B": matrix.shape[1] == n, "C": matrix.shape[0] == n, "D": matrix.T.shape == wanted}.get(name)
            hint = "it seems to be transposed" if turned else f"it must be {wanted[0]} x {wanted[1]}"
            raise DesignFileError(
                f"{model.where}: {name} is {matrix.shape[0]} x {matrix.shape[1]}: beside the other matrices {hint}",
                name,
            )
        if not np.isfinite(matrix).all():
            raise DesignFileError(f"{model.where}: {name} has an entry that is no finite number", name)
    return model
