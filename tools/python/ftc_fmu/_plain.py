"""From what Python users hold (arrays, tuples, NumPy numbers) to the plain values of a design file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import tomli_w

from ftc_fmu.errors import DesignFileError


def plain(value: object, key: str) -> Any:  # noqa: ANN401  (a TOML value has many types)
    """Returns a value of the design file.

    Args:
        value: Dictionary, sequence, array, number, text or truth value.
        key: Where it stands, for the sentence of a refusal.

    Raises:
        DesignFileError: For a value that no design file can hold.
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, dict):
        return {str(name): plain(item, f"{key}.{name}" if key else str(name)) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, f"{key}[{number}]") for number, item in enumerate(value, 1)]
    if isinstance(value, float) and not math.isfinite(value):
        raise DesignFileError(f"{key} is {value}: give a finite number", key)
    if isinstance(value, bool | int | float | str):
        return value
    raise DesignFileError(f"{key} is of type {type(value).__name__}: give a number, a text, a list or a table", key)


def table(value: object, key: str) -> dict[str, Any]:
    """Returns a table of the design file that was given as a dictionary.

    Raises:
        DesignFileError: It is none.
    """
    if not isinstance(value, Mapping):
        raise DesignFileError(f"{key} is of type {type(value).__name__}: give a dictionary", key)
    return dict(value)


def real(values: object, key: str, where: str = "") -> np.ndarray:
    """Returns an array of real numbers.

    Args:
        values: Whatever NumPy reads.
        key: What it is, for the sentence of a refusal.
        where: Where that is.

    Raises:
        DesignFileError: It is complex, or no array of numbers.
    """
    try:
        if not np.iscomplexobj(values if isinstance(values, np.ndarray) else np.asarray(values)):
            return np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise DesignFileError(f"{where}{key} is no array of numbers ({error}): give real numbers", key) from error
    if np.asarray(values).imag.any():
        raise DesignFileError(f"{where}{key} has complex entries: give real numbers", key)
    return np.array(np.real(values), dtype=float)


def count(number: int, what: str) -> str:
    """Returns a number of things, as "1 mode" or "2 modes"."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def whole(value: object, key: str, least: int) -> int:
    """Returns a whole number that is at least so large.

    Raises:
        DesignFileError: It is none.
    """
    try:
        number = int(value)
        sound = number == value and number >= least
    except (TypeError, ValueError, OverflowError):
        sound = False
    if not sound:
        raise DesignFileError(f"{key} is {value!r}: give a whole number from {least} on", key)
    return number


def to_toml(document: Mapping[str, Any]) -> str:
    """Returns the text of a design file: single values first, then modes, then tables."""
    single = {key: value for key, value in document.items() if not isinstance(value, dict) and key != "mode"}
    modes = {"mode": document["mode"]} if document.get("mode") else {}
    tables = {key: value for key, value in document.items() if isinstance(value, dict)}
    return tomli_w.dumps(single | modes | tables)
