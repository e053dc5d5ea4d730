"""Reading a finished design: the record that the command line ships inside each FMU."""

from __future__ import annotations

import json
import struct
import zipfile
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cbor2
import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

RESOURCE = "resources/design.cbor"
CERTIFICATE = "resources/certificate.json"


def load(fmu: Path) -> dict:
    """Returns the record zipped into an FMU, with what proves it."""
    with zipfile.ZipFile(fmu) as archive:
        design = _with_matrices(cbor2.loads(archive.read(RESOURCE)))
        return design | {"proof": json.loads(archive.read(CERTIFICATE))["proof"]}


def _with_matrices(value: object) -> object:
    """Returns a value in which every byte string has become the rows of the matrix that it holds."""
    match value:
        case bytes():
            return _matrix(value).tolist()
        case list():
            return [_with_matrices(item) for item in value]
        case dict():
            return {key: _with_matrices(item) for key, item in value.items()}
    return value


def _matrix(data: bytes) -> np.ndarray:
    """Reads rows, columns and the entries column after column, or those of the upper triangle."""
    rows, columns = struct.unpack_from("<II", data)
    entries = np.frombuffer(data, "<f8", offset=8)
    if len(entries) == rows * columns:
        return entries.reshape((columns, rows)).T
    matrix = np.zeros((columns, rows))
    matrix[np.tril_indices(rows)] = entries
    return matrix.T


@dataclass(frozen=True)
class Mode:
    """One mode as an affine system: x+ = A x + B u + E w + a, y = C x + F w + c."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    E: np.ndarray
    F: np.ndarray
    x0: np.ndarray
    u0: np.ndarray
    y0: np.ndarray

    @property
    def a(self) -> np.ndarray:
        """Affine term of the state equation, which makes (x0, u0) a rest point."""
        return self.x0 - self.A @ self.x0 - self.B @ self.u0

    @property
    def c(self) -> np.ndarray:
        """Affine term of the output equation, which makes x0 read as y0."""
        return self.y0 - self.C @ self.x0


def _modes(plant: dict) -> list[Mode]:
    return [
        Mode(
            **{key.upper(): np.array(mode[key], dtype=float) for key in "abcef"},
            **{key + "0": np.array(mode["operating_point"][key], dtype=float) for key in "xuy"},
        )
        for mode in plant["modes"]
    ]


def modes(design: dict) -> list[Mode]:
    """Returns the modes that the controller was designed for."""
    return _modes(design["plant"])


def true_modes(design: dict) -> list[Mode]:
    """Returns the modes of the simulated plant, which a scenario may set apart from the design's."""
    true_plant = design["true_plant"]
    match true_plant["kind"]:
        case "as-designed":
            return modes(design)
        case "linear":
            return _modes(true_plant["plant"])
        case nonlinear:
            raise ValueError(nonlinear)


def sample_time(design: dict) -> float:
    """Returns Te in seconds."""
    return design["plant"]["sample_time"]
