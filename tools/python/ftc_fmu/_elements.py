"""The numbers of an FMU: its scalar variables, and the elements of the arrays of FMI 3."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from ftc_fmu._plain import real
from ftc_fmu.errors import DesignFileError

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(frozen=True)
class Element:
    """One number of an FMU."""

    name: str
    variable: Any
    position: int
    """Place in the array, row by row; 0 for a scalar."""
    size: int
    """Numbers of the whole variable."""

    def start(self) -> list[float]:
        """Start values of the whole variable; zero where the FMU declares none."""
        declared = [float(word) for word in str(self.variable.start or "").split()]
        return declared if len(declared) == self.size else [0.0] * self.size


def labels(variable: Any) -> list[str]:  # noqa: ANN401
    """Names of a variable's numbers: its own, or "u[1]", "A[2,3]" for each element of an array."""
    shape = tuple(variable.shape) if getattr(variable, "dimensions", None) else ()
    if not shape:
        return [variable.name]
    return [
        f"{variable.name}[{','.join(str(at + 1) for at in place)}]" for place in product(*(range(end) for end in shape))
    ]


class Elements:
    """All numbers of an FMU, by name. The name of an array stands for all of its elements, row by row."""

    def __init__(self, description: Any) -> None:  # noqa: ANN401
        """Keeps the model description's variables."""
        self._arrays: dict[str, list[str]] = {}
        self._elements: dict[str, Element] = {}
        for variable in description.modelVariables:
            names = labels(variable)
            self._arrays[variable.name] = names
            for position, name in enumerate(names):
                self._elements[name] = Element(name, variable, position, len(names))

    def __getitem__(self, name: str) -> Element:
        """One number."""
        return self._elements[name]

    def names(self, given: Iterable[str]) -> list[str]:
        """Names of numbers for names of variables or of numbers.

        Raises:
            DesignFileError: The FMU has no such variable.
        """
        found: list[str] = []
        for name in [given] if isinstance(given, str) else given:
            if name in self._elements:
                found.append(name)
            elif name in self._arrays:
                found += self._arrays[name]
            else:
                known = list(self._arrays)
                near = [one for one in known if one.lower() == name.lower()] or known[:12]
                raise DesignFileError(f'the FMU has no variable "{name}": it has {", ".join(near)}', name)
        return found

    def assignments(self, values: dict[str, Any]) -> dict[str, float]:
        """Values by number for values by variable; an array takes a list, of any shape with as many numbers.

        Raises:
            DesignFileError: A name is unknown, or an array is given another number of values.
        """
        found: dict[str, float] = {}
        for name, value in values.items():
            names = self.names([name])
            flat = real(value, name).reshape(-1)
            if not np.isfinite(flat).all():
                raise DesignFileError(f'"{name}" is {value}: give finite numbers', name)
            if len(flat) != len(names):
                raise DesignFileError(f'"{name}" takes {len(names)} numbers, not {len(flat)}', name)
            found.update(zip(names, flat.tolist(), strict=True))
        return found


def whole(elements: list[Element]) -> dict[int, int]:
    """Value reference and number of values of every variable that the elements belong to."""
    return {element.variable.valueReference: element.size for element in elements}
