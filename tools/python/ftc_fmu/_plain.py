"""From what Python users hold (arrays, tuples, NumPy numbers) to the plain values of a design file."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from ftc_fmu.errors import DesignFileError

if TYPE_CHECKING:
    from collections.abc import Mapping


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


def to_toml(document: Mapping[str, Any]) -> str:
    """Returns the text of a design file: single values first, then modes, then tables."""
    single = {key: value for key, value in document.items() if not isinstance(value, dict) and key != "mode"}
    modes = {"mode": document["mode"]} if document.get("mode") else {}
    tables = {key: value for key, value in document.items() if isinstance(value, dict)}
    return tomli_w.dumps(single | modes | tables)
