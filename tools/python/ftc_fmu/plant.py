"""The plant: linear modes at one sample time, from whatever holds state-space matrices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ftc_fmu._plain import count, plain, real
from ftc_fmu._systems import Matrices, is_model, matrices
from ftc_fmu.errors import DesignFileError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    from ftc_fmu.identification import Identification
    from ftc_fmu.log import Log


@dataclass(frozen=True)
class OperatingPoint:
    """A steady state about which a mode is linear, in physical units.

    Attributes:
        x: State (n).
        u: Input (m).
        y: Output (p).
    """

    x: np.ndarray
    u: np.ndarray
    y: np.ndarray


@dataclass(frozen=True)
class Mode:
    """One way the plant can behave, in discrete time about its operating point.

    `x(k+1) = A x(k) + B u(k) + E w(k)`, `y(k) = C x(k) + D u(k) + F w(k)`.

    Attributes:
        A: State matrix (n x n).
        B: Input matrix (n x m).
        C: Output matrix (p x n).
        D: Input to output (p x m); zero for most plants.
        E: Disturbance to state (n x s).
        F: Disturbance to output (p x s).
        name: What it is called.
        operating_point: Where it was linearised; `None`: the origin.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    E: np.ndarray
    F: np.ndarray
    name: str
    operating_point: OperatingPoint | None = None

    def table(self) -> dict[str, Any]:
        """Returns the mode as a `[[mode]]` of the design file."""
        table: dict[str, Any] = {"name": self.name}
        table |= {key: getattr(self, key).tolist() for key in "ABC"}
        table |= {key: getattr(self, key).tolist() for key in "DEF" if getattr(self, key).any()}
        if self.E.shape[1] and not self.E.any() and not self.F.any():
            table["E"] = self.E.tolist()
        if self.operating_point is not None:
            point = self.operating_point
            table["operating_point"] = {"x": point.x.tolist(), "u": point.u.tolist(), "y": point.y.tolist()}
        return table


class Plant:
    """A plant that switches between known linear modes.

    Args:
        systems: One state-space model per mode: `control.StateSpace`, `scipy.signal.StateSpace`,
            arrays `(A, B, C, D)` or `(A, B, C, D, dt)`. Continuous models are discretised exactly
            (zero-order hold). A single model is a plant of one mode.
        sample_time: Seconds between two samples.
        disturbance_inputs: Columns of B and D (from 0, as NumPy counts), or names of inputs, that
            nobody commands: they become E and F. A single one needs no list.
        continuous: Whether arrays `(A, B, C, D)` are of a continuous model; models that know it
            themselves need no word.
        inputs: Per command its name, or a table `{"name", "unit", "nominal", "min", "max"}`; or the same
            per column of B, disturbances included, which names them, too.
        outputs: The same per output.
        states: The same per state.
        operating_points: Per mode the steady state `{"x": (n), "u": (m), "y": (p)}` about which it
            was linearised; signals are then in physical units.
        names: Name of each mode.

    Attributes:
        modes: The modes in discrete time.
        sample_time: Seconds between two samples.
        signals: Tables `inputs`, `outputs`, `states` of the design file, as far as given.

    Raises:
        DesignFileError: One sentence about what does not fit.
    """

    def __init__(
        self,
        systems: Any,  # noqa: ANN401  (any object with state-space matrices)
        sample_time: float,
        disturbance_inputs: Sequence[int | str] = (),
        *,
        continuous: bool = False,
        inputs: Sequence[str | Mapping[str, Any]] | None = None,
        outputs: Sequence[str | Mapping[str, Any]] | None = None,
        states: Sequence[str | Mapping[str, Any]] | None = None,
        operating_points: Sequence[Mapping[str, Any]] | None = None,
        names: Sequence[str] | None = None,
    ) -> None:
        """Turns every model into a mode."""
        self.sample_time = _positive(sample_time, "sample_time")
        many = isinstance(systems, list) or (isinstance(systems, tuple) and is_model(systems[0] if systems else None))
        systems = list(systems) if many else [systems]
        given = [matrices(system, f"systems[{at}]", continuous=continuous) for at, system in enumerate(systems)]
        if not given:
            raise DesignFileError("systems is empty: give one model per mode", "systems")
        said = {"inputs": inputs, "outputs": outputs, "states": states}
        for key, entries in said.items():
            if isinstance(entries, str | Mapping):
                raise DesignFileError(f"{key} is {entries!r}: give a list with an entry per signal", key)
        names = list(names) if names is not None else [f"mode {number}" for number in range(1, len(given) + 1)]
        points = list(operating_points) if operating_points is not None else [None] * len(given)
        for key, values in (("names", names), ("operating_points", points)):
            if len(values) != len(given):
                raise DesignFileError(f"{key} has {len(values)} entries: give {len(given)}, one per mode", key)
        _one_size(given)
        one = isinstance(disturbance_inputs, str | int | np.integer)
        self._disturbance_inputs = [disturbance_inputs] if one else list(disturbance_inputs)
        columns = _names(inputs, given[0].B.shape[1])
        if columns is not None:
            given = [replace(model, inputs=columns) for model in given]
        given = [model.named_as(given[0]) for model in given]
        self.modes: list[Mode] = [self._mode(*parts) for parts in zip(given, names, points, strict=True)]
        self.signals: dict[str, list[dict[str, Any]]] = self._signals(given[0], said)

    def __repr__(self) -> str:
        """Returns one line: modes and sizes."""
        first = self.modes[0]
        (n, m), p, s = first.B.shape, len(first.C), first.E.shape[1]
        return (
            f"<ftc_fmu.Plant: {count(len(self.modes), 'mode')}, {count(n, 'state')}, {count(m, 'input')}, "
            f"{count(p, 'output')}, {count(s, 'disturbance')}, {self.sample_time} s>"
        )

    def _mode(self, model: Matrices, name: str, point: Mapping[str, Any] | None) -> Mode:
        model = model.discretised(self.sample_time)
        disturbed = self._disturbed(model)
        commanded = [column for column in range(model.B.shape[1]) if column not in disturbed]
        return Mode(
            A=model.A,
            B=model.B[:, commanded],
            C=model.C,
            D=model.D[:, commanded],
            E=model.B[:, disturbed],
            F=model.D[:, disturbed],
            name=name,
            operating_point=None if point is None else _operating_point(point),
        )

    def _disturbed(self, model: Matrices) -> list[int]:
        """Columns of the inputs that are disturbances."""
        width = model.B.shape[1]
        columns = []
        for given in self._disturbance_inputs:
            if isinstance(given, str):
                if given not in (model.inputs or []):
                    known = ", ".join(model.inputs or []) or "it has no names"
                    raise DesignFileError(
                        f'disturbance_inputs: the model has no input "{given}" ({known}): give the column',
                        "disturbance_inputs",
                    )
                columns.append(model.inputs.index(given))
            elif 0 <= int(given) < width:
                columns.append(int(given))
            else:
                raise DesignFileError(
                    f"disturbance_inputs names column {given}, B has columns 0 to {width - 1}: count as NumPy does",
                    "disturbance_inputs",
                )
        if len(set(columns)) < len(columns):
            raise DesignFileError("disturbance_inputs names a column twice: name each once", "disturbance_inputs")
        return columns

    def _signals(self, first: Matrices, said: Mapping[str, Any]) -> dict[str, list[dict[str, Any]]]:
        """The tables of `[signals]`: what was said, else the names that the first model has."""
        disturbed = self._disturbed(first)
        columns = said["inputs"]
        if _names(columns, first.B.shape[1]) is None:
            columns = first.inputs
        split = {
            "inputs": columns and [entry for column, entry in enumerate(columns) if column not in disturbed],
            "disturbances": columns and [columns[column] for column in disturbed],
        }
        if columns is said["inputs"]:
            said = {**said, "inputs": None}
        labels = split | {"outputs": first.outputs, "states": first.states}
        tables = {}
        for key, label in labels.items():
            entries = said[key] if said.get(key) is not None else label
            if entries:
                tables[key] = [_signal(entry, f"signals.{key}[{number}]") for number, entry in enumerate(entries, 1)]
        return tables

    def truth(self) -> dict[str, Any]:
        """Returns the plant as `[scenario.plant]`: what is simulated in place of the model."""
        keys = "ABCDEF"
        tables = [{key: value for key, value in mode.table().items() if key in keys} for mode in self.modes]
        return {"continuous": False, "mode": [plain(table, "scenario.plant.mode") for table in tables]}

    def document(self) -> dict[str, Any]:
        """Returns the plant as the keys of a design file: `sample_time`, `mode`, `signals`."""
        document: dict[str, Any] = {
            "sample_time": self.sample_time,
            "mode": [plain(mode.table(), f"mode {number}") for number, mode in enumerate(self.modes, 1)],
        }
        if self.signals:
            document["signals"] = self.signals
        return document

    @classmethod
    def from_fmu(
        cls,
        path: str | PathLike[str],
        inputs: Sequence[str],
        outputs: Sequence[str],
        operating_points: Sequence[Mapping[str, float]] | None = None,
        **options: Any,  # noqa: ANN401
    ) -> Plant:
        """Linearises an FMU (FMI 2 or 3) at one operating point per mode; see `ftc_fmu.linearise`."""
        from ftc_fmu.linearise import from_fmu  # noqa: PLC0415  (needs the extra fmpy)

        return from_fmu(path, inputs, outputs, operating_points, **options)

    @classmethod
    def identify(
        cls, logs: Log | Sequence[Log], order: int | None = None, disturbance: Mapping[str, Any] | None = None
    ) -> Identification:
        """Identifies a plant from logs of healthy operation; see `ftc_fmu.identification`."""
        from ftc_fmu.identification import identify  # noqa: PLC0415  (that module needs this one)

        return identify(logs, order, disturbance)


def _one_size(models: Sequence[Matrices]) -> None:
    """Refuses modes of other sizes than the first's."""
    sizes = [(model.A.shape[0], model.B.shape[1], model.C.shape[0]) for model in models]
    for model, size in zip(models, sizes, strict=True):
        if size != sizes[0]:
            n, m, p = sizes[0]
            raise DesignFileError(
                f"{model.where} has {size[0]} states, {size[1]} inputs and {size[2]} outputs, {models[0].where} "
                f"{n}, {m} and {p}: give modes of the same signals",
                model.where,
            )


def _names(inputs: Sequence[str | Mapping[str, Any]] | None, width: int) -> list[str] | None:
    """Names of all columns of B, where there is an entry for each."""
    if inputs is None or len(inputs) != width:
        return None
    return [_signal(entry, f"signals.inputs[{number}]").get("name", "") for number, entry in enumerate(inputs, 1)]


def _signal(entry: object, key: str) -> dict[str, Any]:
    if isinstance(entry, str):
        return {"name": entry}
    if not isinstance(entry, Mapping):
        raise DesignFileError(f'{key} is {entry!r}: give a name, or a dictionary such as {{"name": "..."}}', key)
    return plain(dict(entry), key)


def _operating_point(point: Mapping[str, Any]) -> OperatingPoint:
    missing = {"x", "u", "y"} - set(point)
    if missing:
        raise DesignFileError(
            f"operating_points: {', '.join(sorted(missing))} is missing: give x, u and y", "operating_points"
        )
    return OperatingPoint(*(np.atleast_1d(real(point[key], key, "operating_points: ")) for key in "xuy"))


def _positive(value: float, key: str) -> float:
    try:
        value = float(value)
    except (TypeError, ValueError) as error:
        raise DesignFileError(f"{key} is {value!r}: give a positive number of seconds", key) from error
    if not (np.isfinite(value) and value > 0.0):
        raise DesignFileError(f"{key} is {value}: give a positive number of seconds", key)
    return value


__all__ = ["Mode", "OperatingPoint", "Plant"]
