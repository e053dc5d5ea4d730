"""Plants from FMUs of other tools: linearised at one operating point per mode."""

from __future__ import annotations

import shutil
from ctypes import c_double
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import numpy as np

from ftc_fmu.errors import DesignFileError, FtcError, extra
from ftc_fmu.plant import Plant
from ftc_fmu.sampled import SampledModel

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from os import PathLike

# Relative size of a perturbation: truncation and rounding of central differences are equally small.
STEP = 6e-6
# A steady state is one whose derivatives are so small, relative to a perturbation's effect.
STEADY = 1e-9
MOST_ITERATIONS = 50


def from_fmu(
    path: str | PathLike[str],
    inputs: Sequence[str],
    outputs: Sequence[str],
    operating_points: Sequence[Mapping[str, float]] | None = None,
    *,
    sample_time: float,
    disturbance_inputs: Sequence[str] = (),
    states: Sequence[str] | None = None,
    steady: bool = True,
    settle: float = 0.0,
    names: Sequence[str] | None = None,
) -> Plant:
    """Linearises an FMU (FMI 2 or 3) and discretises it, one mode per operating point.

    A model exchange FMU is linearised by its directional derivatives where it provides them, else by
    central differences, and discretised exactly. An FMU for co-simulation only is linearised by small
    steps of its inputs, sample by sample; it must publish its whole state in `states`.

    Args:
        path: The FMU.
        inputs: Variables that the controller commands (m).
        outputs: Variables that sensors measure (p).
        operating_points: Per mode the values of inputs, parameters and states that make it; what is
            not named keeps its start value. One mode at the start values by default.
        sample_time: Seconds between two samples of the design.
        disturbance_inputs: Inputs that nobody commands; they become E and F.
        states: Of a co-simulation FMU, outputs that together are its state (n).
        steady: Of a model exchange FMU, look for the steady state nearest to the states given;
            `False`: linearise where they are.
        settle: Of a co-simulation FMU, seconds to run before it is linearised.
        names: Name of each mode.

    Returns:
        The plant, with the operating points found.

    Raises:
        DesignFileError: A name is unknown, or the FMU shows too little.
        FtcError: The FMU refuses a call.
        MissingExtra: fmpy is not installed.
    """
    fmpy = extra("fmpy")
    description = fmpy.read_model_description(str(path))
    if description.fmiVersion.startswith("1"):
        raise DesignFileError(f"{path} is of FMI {description.fmiVersion}: export it as FMI 2 or 3", "path")
    points = [dict(point) for point in operating_points] if operating_points else [{}]
    driven = [*inputs, *disturbance_inputs]
    _known(description, [*driven, *outputs, *(states or []), *(name for point in points for name in point)])
    if description.modelExchange is None and not states:
        raise DesignFileError(
            f"{path} is for co-simulation only: give states=, outputs that together are its state", "states"
        )
    folder = fmpy.extract(str(path))
    source = _Source(fmpy, description, folder, driven, outputs)
    try:
        if description.modelExchange is not None:
            found = [_continuous(source, point, steady=steady) for point in points]
        else:
            timing = (sample_time, settle)
            found = [_sampled(source, point, list(states or []), *timing) for point in points]
    except fmpy.fmi1.FMICallException as error:
        raise FtcError(f"{path}: the FMU refused a call ({error})") from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    commanded = len(inputs)
    return Plant(
        [matrices for matrices, _ in found],
        sample_time,
        disturbance_inputs=list(range(commanded, len(driven))),
        inputs=[_table(description, name) for name in inputs],
        outputs=[_table(description, name) for name in outputs],
        states=[_table(description, name) for name in (states or _state_names(description))],
        operating_points=[{"x": x, "u": u[:commanded], "y": y} for _, (x, u, y) in found],
        names=names,
    )


@dataclass(frozen=True)
class _Source:
    """An FMU that was unpacked, and which of its variables are of interest."""

    fmpy: Any
    description: Any
    folder: str
    inputs: Sequence[str]
    outputs: Sequence[str]


def _known(description: Any, names: list[str]) -> None:  # noqa: ANN401
    """Refuses names that the FMU has not, and tables of numbers."""
    variables = {variable.name: variable for variable in description.modelVariables}
    for name in names:
        if name not in variables:
            near = [known for known in variables if known.lower() == name.lower()] or list(variables)[:12]
            raise DesignFileError(f'the FMU has no variable "{name}": it has {", ".join(near)}', name)
        if getattr(variables[name], "dimensions", None):
            raise DesignFileError(f'"{name}" is an array: give scalar variables', name)


def _provides_derivatives(folder: str) -> bool:
    """Whether directional derivatives may be asked for; the attribute has another name in FMI 3."""
    root = ET.parse(Path(folder) / "modelDescription.xml").getroot()  # noqa: S314  (fmpy read it before)
    kind = root.find("ModelExchange")
    names = ("providesDirectionalDerivative", "providesDirectionalDerivatives")
    return kind is not None and any(kind.get(name) in ("true", "1") for name in names)


def _state_names(description: Any) -> list[str]:  # noqa: ANN401
    return [unknown.variable.derivative.name for unknown in description.derivatives]


def _table(description: Any, name: str) -> dict[str, Any]:  # noqa: ANN401
    """Name, unit and nominal value, as far as the FMU says them."""
    (variable,) = [variable for variable in description.modelVariables if variable.name == name]
    declared = getattr(variable, "declaredType", None)
    unit = variable.unit or (declared.unit if declared is not None else None)
    table: dict[str, Any] = {"name": name}
    if unit:
        table["unit"] = str(unit)
    nominal = variable.nominal or (declared.nominal if declared is not None else None)
    if nominal and float(nominal) > 0.0:
        table["nominal"] = float(nominal)
    return table


def _nominals(description: Any, names: Sequence[str]) -> np.ndarray:  # noqa: ANN401
    return np.array([_table(description, name).get("nominal", 1.0) for name in names])


class _Instance:
    """An FMU instance under FMI 2 or 3, as far as linearising needs it."""

    def __init__(self, source: _Source, kind: str) -> None:
        self.fmi3 = source.description.fmiVersion.startswith("3")
        self.variables = {variable.name: variable for variable in source.description.modelVariables}
        self.fmu = source.fmpy.instantiate_fmu(source.folder, source.description, fmi_type=kind)

    def initialise(self, values: Mapping[str, float]) -> None:
        if self.fmi3:
            self._set_all(values, lambda variable: variable.causality != "input")
            self.fmu.enterInitializationMode(startTime=0.0)
        else:
            self.fmu.setupExperiment(startTime=0.0)
            self._set_all(values, lambda variable: variable.causality != "input")
            self.fmu.enterInitializationMode()
        self._set_all(values, lambda variable: variable.causality == "input")
        self.fmu.exitInitializationMode()

    def _set_all(self, values: Mapping[str, float], pick: Callable[[Any], bool]) -> None:
        for name, value in values.items():
            variable = self.variables[name]
            if not pick(variable):
                continue
            kind = variable.type
            setter = getattr(self.fmu, f"set{kind}")
            given = bool(value) if kind == "Boolean" else float(value) if kind in ("Real", "Float64") else int(value)
            setter([variable.valueReference], [given])

    def references(self, names: Sequence[str]) -> list[int]:
        return [self.variables[name].valueReference for name in names]

    def get(self, references: list[int]) -> np.ndarray:
        values = self.fmu.getFloat64(references) if self.fmi3 else self.fmu.getReal(references)
        return np.array(list(values), dtype=float)

    def set(self, references: list[int], values: np.ndarray) -> None:
        if references:
            (self.fmu.setFloat64 if self.fmi3 else self.fmu.setReal)(references, [float(value) for value in values])

    def free(self) -> None:
        try:
            self.fmu.terminate()
        finally:
            self.fmu.freeInstance()


class _Continuous(_Instance):
    """A model exchange instance in continuous-time mode."""

    def enter(self) -> None:
        if self.fmi3:
            again = True
            while again:
                again, terminate, *_ = self.fmu.updateDiscreteStates()
                _not_over(terminate)
            self.fmu.enterContinuousTimeMode()
            return
        again = True
        while again:
            again, terminate, *_ = self.fmu.newDiscreteStates()
            _not_over(terminate)
        self.fmu.enterContinuousTimeMode()

    def states(self, count: int) -> np.ndarray:
        values = (c_double * count)()
        self.fmu.getContinuousStates(values, count)
        return np.array(values)

    def set_states(self, values: np.ndarray) -> None:
        self.fmu.setContinuousStates((c_double * len(values))(*values), len(values))

    def derivatives(self, count: int) -> np.ndarray:
        values = (c_double * count)()
        (self.fmu.getContinuousStateDerivatives if self.fmi3 else self.fmu.getDerivatives)(values, count)
        return np.array(values)


def _not_over(terminate: bool) -> None:  # noqa: FBT001
    if terminate:
        raise FtcError("the FMU ends its simulation at the operating point: give another")


def _continuous(source: _Source, point: Mapping[str, float], *, steady: bool) -> tuple[tuple, tuple]:
    """Matrices (A, B, C, D, 0) of a model exchange FMU, and the point (x, u, y) they belong to."""
    description, inputs = source.description, source.inputs
    names = _state_names(description)
    n = len(names)
    directional = _provides_derivatives(source.folder)
    model = _Continuous(source, "ModelExchange")
    try:
        model.initialise(point)
        model.enter()
        given = model.references(inputs)
        read = model.references(source.outputs)
        x, u = model.states(n), model.get(given)

        def evaluate(x: np.ndarray, u: np.ndarray) -> np.ndarray:
            model.set_states(x)
            model.set(given, u)
            return np.concatenate([model.derivatives(n), model.get(read)])

        sizes = np.maximum(np.abs(np.concatenate([x, u])), _nominals(description, [*names, *inputs]))

        def jacobian(x: np.ndarray, u: np.ndarray) -> np.ndarray:
            evaluate(x, u)
            if directional:
                return _directional(model, description, names, given, read)
            return _differences(evaluate, x, u, STEP * sizes)

        if steady and n:
            x = _steady(evaluate, jacobian, x, u, STEP * sizes[:n])
        full = jacobian(x, u)
        y = evaluate(x, u)[n:]
    finally:
        model.free()
    if not np.isfinite(full).all():
        raise DesignFileError(f"the FMU gives no finite derivatives at {dict(point)}: give another operating point")
    return (full[:n, :n], full[:n, n:], full[n:, :n], full[n:, n:], 0.0), (x, u, y)


def _directional(
    model: _Continuous,
    description: Any,  # noqa: ANN401
    names: list[str],
    given: list[int],
    read: list[int],
) -> np.ndarray:
    unknowns = [unknown.variable.valueReference for unknown in description.derivatives] + read
    knowns = model.references(names) + given
    columns = [model.fmu.getDirectionalDerivative(unknowns, [known], [1.0]) for known in knowns]
    return np.array([list(column) for column in columns]).T.reshape(len(unknowns), len(knowns))


def _differences(
    evaluate: Callable[[np.ndarray, np.ndarray], np.ndarray], x: np.ndarray, u: np.ndarray, steps: np.ndarray
) -> np.ndarray:
    n, columns = len(x), []
    for at, step in enumerate(steps):
        ends = []
        for sign in (1.0, -1.0):
            moved = np.concatenate([x, u])
            moved[at] += sign * step
            ends.append((moved[at], evaluate(moved[:n], moved[n:])))
        (high, above), (low, below) = ends
        columns.append((above - below) / (high - low))
    evaluate(x, u)
    return np.array(columns).T


def _steady(
    evaluate: Callable[[np.ndarray, np.ndarray], np.ndarray],
    jacobian: Callable[[np.ndarray, np.ndarray], np.ndarray],
    x: np.ndarray,
    u: np.ndarray,
    steps: np.ndarray,
) -> np.ndarray:
    """The nearest state that stays where it is, by Newton's method with halved steps."""
    n = len(x)
    for _ in range(MOST_ITERATIONS):
        drift = evaluate(x, u)[:n]
        A = jacobian(x, u)[:, :n][:n]
        change = np.linalg.lstsq(A, -drift, rcond=None)[0]
        if (np.abs(change) <= STEADY / STEP * steps).all() and np.linalg.norm(A @ change + drift) <= STEADY * (
            1.0 + np.linalg.norm(drift)
        ):
            return x + change
        share = 1.0
        while share > 1e-6 and not np.linalg.norm(evaluate(x + share * change, u)[:n]) < np.linalg.norm(drift):
            share /= 2.0
        if share <= 1e-6:
            break
        x = x + share * change
    raise DesignFileError(
        f"no steady state was found from x = {x.tolist()} at u = {u.tolist()} (dx/dt = {drift.tolist()}): "
        "give states nearer to one in operating_points, or steady=False",
        "operating_points",
    )


def _sampled(
    source: _Source, point: Mapping[str, float], states: list[str], sample_time: float, settle: float
) -> tuple[tuple, tuple]:
    """Matrices (A, B, C, D, sample_time) of a co-simulation FMU, and the point (x, u, y)."""

    def fresh() -> _Instance:
        model = _Instance(source, "CoSimulation")
        model.initialise(point)
        return model

    sizes = _nominals(source.description, source.inputs)
    names = (source.inputs, source.outputs, states)
    A, B, C, D, at = SampledModel(fresh, names, sizes, sample_time, settle).linearise()
    return (A, B, C, D, sample_time), at
