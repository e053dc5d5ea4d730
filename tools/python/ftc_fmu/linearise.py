"""Plants from FMUs of other tools: linearised at one operating point per mode."""

from __future__ import annotations

import shutil
import warnings
from contextlib import suppress
from ctypes import c_double
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import numpy as np

from ftc_fmu._elements import Element, Elements, labels, whole
from ftc_fmu._plain import table
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
# How far directional derivatives may be from differences, relative to the largest effect in their row.
AGREEMENT = 1e-3
MOST_ITERATIONS = 50


def from_fmu(
    path: str | PathLike[str],
    inputs: Sequence[str],
    outputs: Sequence[str],
    operating_points: Sequence[Mapping[str, Any]] | None = None,
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
        inputs: Variables that the controller commands (m). Here and below, the name of an array (FMI 3)
            stands for all its elements, "u[2]" or "A[1,3]" for one.
        outputs: Variables that sensors measure (p).
        operating_points: Per mode the values of inputs, parameters and states that make it, of arrays as
            lists; what is not named keeps its start value. One mode at the start values by default.
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
    try:
        description = fmpy.read_model_description(str(path))
    except Exception as error:  # whatever zipfile, lxml and fmpy find in a file that is no FMU
        raise DesignFileError(f"{path} cannot be read as an FMU ({error}): name an FMU (FMI 2 or 3)", "path") from error
    if description.fmiVersion.startswith("1"):
        raise DesignFileError(f"{path} is of FMI {description.fmiVersion}: export it as FMI 2 or 3", "path")
    points = [operating_points] if isinstance(operating_points, dict) else list(operating_points or [{}])
    points = [table(point, f"operating_points[{number}]") for number, point in enumerate(points)]
    elements = Elements(description)
    inputs, outputs, disturbance_inputs = (elements.names(each) for each in (inputs, outputs, disturbance_inputs))
    states = elements.names(states) if states else None
    for name in [*inputs, *disturbance_inputs]:
        _check_input(elements[name].variable, name, sampled=description.modelExchange is None)
    for key, named in (("inputs", [*inputs, *disturbance_inputs]), ("outputs", outputs)):
        twice = [name for name in named if named.count(name) > 1]
        if twice:
            raise DesignFileError(f'{key}: "{twice[0]}" is named twice: name it once', key)
    points = [elements.assignments(point) for point in points]
    driven = [*inputs, *disturbance_inputs]
    if description.modelExchange is None and not states:
        raise DesignFileError(
            f"{path} is for co-simulation only: give states=, outputs that together are its state", "states"
        )
    folder = fmpy.extract(str(path))
    source = _Source(fmpy, description, elements, folder, driven, outputs)
    try:
        if description.modelExchange is not None:
            found = [_continuous(source, point, steady=steady) for point in points]
        else:
            timing = (sample_time, settle)
            found = [_sampled(source, point, list(states or []), *timing) for point in points]
    except fmpy.fmi1.FMICallException as error:
        raise FtcError(f"{path}: the FMU refused a call ({error}): see what it logged") from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    commanded = len(inputs)
    return Plant(
        [matrices for matrices, _ in found],
        sample_time,
        disturbance_inputs=list(range(commanded, len(driven))),
        inputs=[_table(elements, name) for name in inputs],
        outputs=[_table(elements, name) for name in outputs],
        states=[_table(elements, name) for name in (states or _state_names(description))],
        operating_points=[{"x": x, "u": u[:commanded], "y": y} for _, (x, u, y) in found],
        names=names,
    )


def _check_input(variable: Any, name: str, *, sampled: bool) -> None:  # noqa: ANN401
    """Refuses what cannot be commanded while a model runs."""
    tunable = sampled and variable.causality == "parameter" and variable.variability == "tunable"
    if variable.causality != "input" and not tunable:
        raise DesignFileError(
            f'"{name}" is no input of the FMU (its causality is {variable.causality}): name inputs; what makes a mode, '
            "such as a parameter, belongs into operating_points",
            "inputs",
        )


@dataclass(frozen=True)
class _Source:
    """An FMU that was unpacked, and which of its variables are of interest."""

    fmpy: Any
    description: Any
    elements: Elements
    folder: str
    inputs: Sequence[str]
    outputs: Sequence[str]


def _provides_derivatives(folder: str) -> bool:
    """Whether directional derivatives may be asked for; the attribute has another name in FMI 3."""
    root = ET.parse(Path(folder) / "modelDescription.xml").getroot()  # noqa: S314  (fmpy read it before)
    kind = root.find("ModelExchange")
    names = ("providesDirectionalDerivative", "providesDirectionalDerivatives")
    return kind is not None and any(kind.get(name) in ("true", "1") for name in names)


def _state_names(description: Any) -> list[str]:  # noqa: ANN401
    return [name for unknown in description.derivatives for name in labels(unknown.variable.derivative)]


def _table(elements: Elements, name: str) -> dict[str, Any]:
    """Name, unit and nominal value, as far as the FMU says them."""
    variable = elements[name].variable
    declared = getattr(variable, "declaredType", None)
    unit = variable.unit or (declared.unit if declared is not None else None)
    table: dict[str, Any] = {"name": name}
    if unit:
        table["unit"] = str(unit)
    nominal = variable.nominal or (declared.nominal if declared is not None else None)
    if nominal and float(nominal) > 0.0:
        table["nominal"] = float(nominal)
    return table


def _nominals(elements: Elements, names: Sequence[str]) -> np.ndarray:
    return np.array([_table(elements, name).get("nominal", 1.0) for name in names])


class _Instance:
    """An FMU instance under FMI 2 or 3, as far as linearising needs it."""

    def __init__(self, source: _Source, kind: str) -> None:
        self.fmi3 = source.description.fmiVersion.startswith("3")
        self.elements = source.elements
        try:
            self.fmu = source.fmpy.instantiate_fmu(source.folder, source.description, fmi_type=kind)
        except Exception as error:  # a library that is missing, of another machine, or lacks a function
            raise FtcError(f"the FMU's binary cannot be used on this machine ({error})") from error

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
        """Sets start values; what is not named of an array keeps the start value that the FMU declares."""
        numbers: dict[int, list[float]] = {}
        for name, value in values.items():
            element = self.elements[name]
            variable = element.variable
            if not pick(variable):
                continue
            if variable.type in ("Real", "Float64"):
                array = numbers.setdefault(variable.valueReference, element.start())
                array[element.position] = float(value)
            else:
                given = bool(value) if variable.type == "Boolean" else int(value)
                getattr(self.fmu, f"set{variable.type}")([variable.valueReference], [given])
        self._set_arrays(numbers)

    def references(self, names: Sequence[str]) -> list[Element]:
        return [self.elements[name] for name in names]

    def get(self, elements: list[Element]) -> np.ndarray:
        arrays = self._arrays(elements)
        return np.array([arrays[element.variable.valueReference][element.position] for element in elements])

    def set(self, elements: list[Element], values: np.ndarray) -> None:
        # What is not an element keeps its value: an array is set as a whole.
        arrays = self._arrays([element for element in elements if element.size > 1])
        for element, value in zip(elements, values, strict=True):
            reference = element.variable.valueReference
            arrays.setdefault(reference, [0.0])[element.position] = float(value)
        self._set_arrays(arrays)

    def _set_arrays(self, arrays: Mapping[int, list[float]]) -> None:
        for reference, array in arrays.items():
            (self.fmu.setFloat64 if self.fmi3 else self.fmu.setReal)([reference], array)

    def _arrays(self, elements: list[Element]) -> dict[int, list[float]]:
        """The values of whole variables, by value reference."""
        if self.fmi3:
            return {reference: self.fmu.getFloat64([reference], size) for reference, size in whole(elements).items()}
        return {reference: list(self.fmu.getReal([reference])) for reference in whole(elements)}

    def free(self) -> None:
        # After a refused call some FMUs may not be terminated, and the refusal is what counts.
        with suppress(Exception):
            self.fmu.terminate()
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
    # Directional derivatives are asked for number by number; of arrays, differences are taken.
    directional = _provides_derivatives(source.folder) and not _has_arrays(source, names)
    model = _Continuous(source, "ModelExchange")
    try:
        model.initialise(point)
        model.enter()
        given = model.references(inputs)
        read = model.references(source.outputs)
        x, u = model.states(n), model.get(given)

        def evaluate(x: np.ndarray, u: np.ndarray) -> np.ndarray:
            # Outputs first: OpenModelica's FMUs forget that outputs are old once derivatives were read.
            model.set_states(x)
            model.set(given, u)
            y = model.get(read)
            return np.concatenate([model.derivatives(n), y])

        sizes = np.maximum(np.abs(np.concatenate([x, u])), _nominals(source.elements, [*names, *inputs]))

        def jacobian(x: np.ndarray, u: np.ndarray) -> np.ndarray:
            evaluate(x, u)
            if directional:
                return _directional(model, description, names, given, read)
            return _differences(evaluate, x, u, STEP * sizes)

        if steady and n:
            x = _steady(evaluate, jacobian, x, u, STEP * sizes[:n])
        full = jacobian(x, u)
        y = evaluate(x, u)[n:]
        if directional:
            full = _trusted(full, _differences(evaluate, x, u, STEP * sizes), sizes, source.outputs)
    finally:
        model.free()
    if not np.isfinite(full).all():
        raise DesignFileError(f"the FMU gives no finite derivatives at {dict(point)}: give another operating point")
    return (full[:n, :n], full[:n, n:], full[n:, :n], full[n:, n:], 0.0), (x, u, y)


def _has_arrays(source: _Source, states: list[str]) -> bool:
    return any(source.elements[name].size > 1 for name in [*states, *source.inputs, *source.outputs])


def _directional(
    model: _Continuous,
    description: Any,  # noqa: ANN401
    names: list[str],
    given: list[Element],
    read: list[Element],
) -> np.ndarray:
    unknowns = [unknown.variable.valueReference for unknown in description.derivatives]
    unknowns += [element.variable.valueReference for element in read]
    knowns = [element.variable.valueReference for element in model.references(names) + given]
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


def _trusted(directional: np.ndarray, differences: np.ndarray, sizes: np.ndarray, outputs: Sequence[str]) -> np.ndarray:
    """The directional derivatives, or the differences where these contradict them: some FMUs forget outputs."""
    effect = np.abs(differences * sizes)
    known = np.isfinite(directional) & (
        np.abs((directional - differences) * sizes) <= AGREEMENT * (1e-6 + effect.max(axis=1, initial=0.0))[:, None]
    )
    if known.all():
        return directional
    row = int(np.argmin(known.all(axis=1)))
    at = row - (len(directional) - len(outputs))
    what = f'the output "{outputs[at]}"' if at >= 0 else f"the derivative of state {row + 1}"
    warnings.warn(
        f"the FMU's directional derivatives of {what} are not those of its values: central differences are taken",
        stacklevel=2,
    )
    return differences


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

    sizes = _nominals(source.elements, source.inputs)
    names = (source.inputs, source.outputs, states)
    A, B, C, D, at = SampledModel(fresh, names, sizes, sample_time, settle).linearise()
    return (A, B, C, D, sample_time), at
