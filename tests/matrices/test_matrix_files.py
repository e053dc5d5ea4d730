"""Matrices from files of other tools, and the sampling of continuous ones, against scipy.

promise: plants-as-they-are
"""

from __future__ import annotations

import subprocess
from typing import TYPE_CHECKING

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.signal

import commands
import record

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

TOP = 'name = "filed"\nsample_time = 0.2\n'
REST = "\n[controller]\ndecay = 0.99\n\n[scenario]\nnoise = 0.001\n"
A = np.array([[0.7, 0.2, 0.0], [-0.1, 0.6, 0.1], [0.0, 0.0, 0.5]])
B = np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.25]])
C = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 2.0]])
E = np.array([[0.1], [0.2], [0.3]])
MODEL = {"A": A, "B": B, "C": C, "E": E}


def designed(text: str, folder: Path) -> dict[str, np.ndarray]:
    """Exports a design and returns the matrices of its first mode."""
    path = folder / "design.toml"
    path.write_text(TOP + text + REST)
    mode = record.load(commands.export(path, folder).controller)["plant"]["modes"][0]
    return {name: np.array(mode[name.lower()]) for name in MODEL}


def same(found: dict[str, np.ndarray], model: dict[str, np.ndarray]) -> None:
    """Asserts that the matrices are those of the model, to the bit."""
    for name, matrix in model.items():
        np.testing.assert_array_equal(found[name], matrix, err_msg=name)


def savemat(model: dict, path: Path) -> None:
    """Writes a MATLAB file of level 5."""
    scipy.io.savemat(path, model)


def savemat_compressed(model: dict, path: Path) -> None:
    """Writes a compressed MATLAB file of level 5, as MATLAB does."""
    scipy.io.savemat(path, model, do_compression=True)


def write_group(group: h5py.Group, model: dict) -> None:
    """Writes arrays and structures as MATLAB 7.3 does: dimensions reversed, classes as attributes."""
    for name, value in model.items():
        if isinstance(value, dict):
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            write_group(inner, value)
        elif value.size == 0:
            dataset = group.create_dataset(name, data=np.array(value.shape, dtype=np.uint64))
            dataset.attrs["MATLAB_class"] = np.bytes_("double")
            dataset.attrs["MATLAB_empty"] = np.uint8(1)
        else:
            options = {"compression": "gzip", "chunks": value.T.shape}
            dataset = group.create_dataset(name, data=value.T, **options)
            dataset.attrs["MATLAB_class"] = np.bytes_("double")


def save73(model: dict, path: Path) -> None:
    """Writes a MATLAB file of level 7.3 with its block of text in front."""
    with h5py.File(path, "w", userblock_size=512) as file:
        write_group(file, model)
    text = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Thu Jan 01 00:00:00 2026 HDF5 schema 1.00 ."
    with path.open("r+b") as file:
        file.write(text.ljust(124) + b"\x00\x02IM")


def savez(model: dict, path: Path) -> None:
    """Writes a NumPy archive."""
    np.savez(path, **model)


def savez_compressed(model: dict, path: Path) -> None:
    """Writes a compressed NumPy archive in Fortran's order."""
    np.savez_compressed(path, **{name: np.asfortranarray(matrix) for name, matrix in model.items()})


MATLAB = [(savemat, "plant.mat"), (savemat_compressed, "plant.mat"), (save73, "plant.mat")]
ALL = [*MATLAB, (savez, "plant.npz"), (savez_compressed, "plant.npz")]


@pytest.mark.parametrize(("save", "name"), ALL)
def test_arrays_under_their_letters(save: Callable, name: str, tmp_path: Path) -> None:
    """What is not named is sought under its own letter."""
    save(MODEL, tmp_path / name)
    same(designed(f'[[mode]]\nfile = "{name}"\n', tmp_path), MODEL)


@pytest.mark.parametrize(("save", "name"), ALL)
def test_arrays_under_other_names(save: Callable, name: str, tmp_path: Path) -> None:
    """Names of variables stand in the place of rows, and rows win over the file."""
    save({"Ad": A, "Bd": B, "C": np.zeros((2, 3)), "Ed": E}, tmp_path / name)
    text = f'[[mode]]\nfile = "{name}"\nA = "Ad"\nB = "Bd"\nC = {C.tolist()}\nE = "Ed"\n'
    same(designed(text, tmp_path), MODEL)


@pytest.mark.parametrize(("save", "name"), MATLAB)
@pytest.mark.parametrize("line", ["", 'struct = "sys"\n'])
def test_a_structure(save: Callable, name: str, line: str, tmp_path: Path) -> None:
    """The fields of a structure, named or the only one; an empty D is none."""
    save({"sys": {**MODEL, "D": np.zeros((0, 0))}, "note": np.ones((1, 4))}, tmp_path / name)
    same(designed(f'[[mode]]\nfile = "{name}"\n{line}', tmp_path), MODEL)


def test_integers_and_single_precision(tmp_path: Path) -> None:
    """Real types of any width become doubles."""
    model = {"A": np.array([[0.5]], dtype=np.float32), "B": np.array([[1]], dtype=np.uint8), "C": np.array([[2]])}
    for save, name in ALL:
        save(model, tmp_path / name)
        found = designed(f'[[mode]]\nfile = "{name}"\n', tmp_path)
        assert (found["A"], found["B"], found["C"]) == (0.5, 1.0, 2.0)


WRONG = [
    ({"A": A, "B": B}, "", ["C is missing", "A, B"]),
    ({"X": A, "B": B, "C": C}, "", ["A is missing", "B, C, X"]),
    ({**MODEL, "A": A + 1j}, "", ["A", "save real"]),
    ({**MODEL, "A": np.zeros((2, 3, 3))}, "", ["A has 3 dimensions"]),
    ({**MODEL, "A": A * np.nan}, "", ["plant", "A: the entry in row 1, column 1"]),
    (MODEL, 'A = "Z"\n', ["no variable 'Z'", "A, B, C, E"]),
    (MODEL, 'struct = "sys"\n', ["A is missing", "sys.A"]),
]


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize(("save", "name"), [(savemat, "plant.mat"), (savez, "plant.npz")])
def test_wrong_files(save: Callable, name: str, wrong: tuple[dict, str, list[str]], tmp_path: Path) -> None:
    """One sentence names the file or the variable, and what is there."""
    model, line, words = wrong
    save(model, tmp_path / name)
    refused(f'[[mode]]\nfile = "{name}"\n{line}', words, tmp_path)


def refused(text: str, words: list[str], folder: Path) -> None:
    """Asserts that a design is refused in one sentence that has these words."""
    path = folder / "design.toml"
    path.write_text(TOP + text + REST)
    message = complaint(path)
    assert all(word in message for word in words), message


def complaint(path: Path) -> str:
    """Returns the one sentence with which a design file is refused."""
    run = subprocess.run([commands.PROGRAM, "design", path], capture_output=True, text=True, check=False)
    assert run.returncode == 2, run.stdout
    sentences = [line for line in run.stderr.splitlines() if line.startswith("error: ")]
    assert len(sentences) == 1, run.stderr
    return sentences[0]


@pytest.mark.parametrize(("save", "name"), ALL)
def test_damaged_files(save: Callable, name: str, tmp_path: Path) -> None:
    """Whatever a file lost, the answer is a sentence."""
    save(MODEL, tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    for share in (0.0, 0.1, 0.5, 0.9):
        (tmp_path / name).write_bytes(whole[: int(share * len(whole))])
        path = tmp_path / "design.toml"
        path.write_text(f'{TOP}[[mode]]\nfile = "{name}"\n{REST}')
        message = complaint(path)
        assert f'mode 1: file = "{name}"' in message or "mode 1: A is missing" in message, message


def test_continuous_matrices_are_sampled_as_scipy_does(tmp_path: Path) -> None:
    """The matrix exponential, for stiff, oscillating and unstable plants."""
    random = np.random.default_rng(7)
    for trial in range(6):
        n = 2 + trial % 3
        continuous = random.normal(size=(n, n)) * 10.0 ** random.uniform(-1, 1) - 2.0 * np.eye(n)
        model = {"A": continuous, "B": random.normal(size=(n, 1)), "C": np.eye(1, n), "E": random.normal(size=(n, 1))}
        both = np.hstack([model["B"], model["E"]])
        a, b, *_ = scipy.signal.cont2discrete((continuous, both, np.eye(n), np.zeros((n, 2))), 0.2, method="zoh")
        if np.abs(np.linalg.eigvals(a)).max() > 0.9:
            continue
        np.savez(tmp_path / "plant.npz", **model)
        found = designed('continuous = true\n[[mode]]\nfile = "plant.npz"\n', tmp_path)
        for name, wanted in (("A", a), ("B", b[:, :1]), ("E", b[:, 1:])):
            np.testing.assert_allclose(found[name], wanted, rtol=1e-11, atol=1e-13 * np.abs(wanted).max())


@pytest.mark.parametrize("save", [savemat, savemat_compressed])
def test_a_damaged_file_is_refused_in_one_sentence(save: Callable[[dict, Path], None], tmp_path: Path) -> None:
    """Whatever bytes are wrong, whoever reads them: one sentence or a design, and no trace of a panic."""
    save(MODEL, tmp_path / "plant.mat")
    intact = (tmp_path / "plant.mat").read_bytes()
    design = tmp_path / "design.toml"
    design.write_text(TOP + '[[mode]]\nfile = "plant.mat"\n' + REST)
    generator = np.random.default_rng(11)
    for _ in range(60):
        damaged = bytearray(intact)
        for _ in range(generator.integers(1, 6)):
            damaged[generator.integers(128, len(damaged))] = generator.integers(256)
        (tmp_path / "plant.mat").write_bytes(
            damaged[: generator.choice([len(damaged), generator.integers(130, len(damaged))])]
        )
        run = subprocess.run(
            [commands.PROGRAM, "--quiet", "design", design], capture_output=True, text=True, check=False
        )
        assert run.returncode in (0, 1, 2), run.stderr
        assert "panicked" not in run.stderr
        assert len([line for line in run.stderr.splitlines() if not line.startswith("warning: ")]) <= 1, run.stderr
