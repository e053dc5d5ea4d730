"""Designs: the same as the command line's, with errors that have parts.

promise: python-same
"""

from __future__ import annotations

import json
import pickle
import signal
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING

import numpy as np
import pytest
import tomli_w

import ftc_fmu as ftc
from conftest import EXAMPLES

if TYPE_CHECKING:
    from pathlib import Path


def test_examples_come_with_the_package(tmp_path: Path) -> None:
    """Every example is written whole; a design file loads, a script starts."""
    assert {"paper", "logged", "quadruple_tank", "from_a_log"} <= set(ftc.examples())
    for name in ftc.examples():
        start = ftc.example(name, tmp_path / name)
        assert start.exists()
        assert start.stem == name
    assert ftc.load(ftc.example("tank.toml", tmp_path / "again")).name == "tank"
    script = tmp_path / "quadruple_tank" / "quadruple_tank.py"
    told = subprocess.run([sys.executable, script, "--help"], capture_output=True, text=True, check=False)
    assert "--out" in told.stdout, told.stderr
    with pytest.raises(ftc.DesignFileError, match='no example "reactor": name one of paper'):
        ftc.example("reactor", tmp_path)


def test_threads_do_not_change_a_design(tmp_path: Path) -> None:
    """Modes under `dwell` solved in three threads are those solved in one."""
    path = ftc.example("paper", tmp_path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('lyapunov = "common"', 'lyapunov = "dwell"'), encoding="utf-8")
    assert "dwell" in path.read_text(encoding="utf-8")
    assert ftc.load(path).record() == ftc.load(path, threads=3).record()
    with pytest.raises(ftc.DesignFileError, match=r"threads is 1025: give 1 to 1024"):
        ftc.load(path, threads=1025)


def program(*arguments: object) -> subprocess.CompletedProcess:
    """Runs the command line that the package brings along."""
    command = [sys.executable, "-m", "ftc_fmu", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def tank(tanks: ftc.Plant) -> ftc.Design:
    """A design from continuous models."""
    return ftc.design(
        tanks,
        name="tank",
        tracked=["level 1", "level 2"],
        decay=0.97,
        disturbance={"period": 600.0, "amplitude": 0.5},
        scenario={"steps": 300, "noise": 0.02, "seed": 3},
    )


def test_the_program_makes_the_same_design(paper: ftc.Design) -> None:
    """To the last digit of its report."""
    done = program("design", EXAMPLES / "paper.toml", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == paper.report


def test_a_design_and_its_file_are_inverse(tank: ftc.Design, tmp_path: Path) -> None:
    """Written and read again, the record is the same to the byte."""
    again = ftc.load(tank.save(tmp_path / "tank.toml"))
    assert again.document == tank.document
    assert again.to_toml() == tank.to_toml()
    assert again.core.record() == tank.core.record()


def test_examples_are_read_and_written(tmp_path: Path) -> None:
    """Logs come along."""
    logged = ftc.load(EXAMPLES / "logged.toml")
    again = ftc.load(logged.save(tmp_path / "copy" / "logged.toml"))
    assert again.core.record() == logged.core.record()


def test_matrices_and_tables_come_along(tank: ftc.Design, tmp_path: Path) -> None:
    """What `[[mode]] file` and a signal's `file` name, also from another folder."""
    document = tank.document | {"mode": [], "scenario": {"steps": 20}}
    for number, mode in enumerate(tank.document["mode"], 1):
        named = {key: mode[key] for key in "ABCE" if key in mode}
        np.savez(tmp_path / f"mode_{number}.npz", **{key: np.array(value) for key, value in named.items()})
        document["mode"].append({key: value for key, value in mode.items() if key not in named})
        document["mode"][-1] |= {"file": f"mode_{number}.npz"}
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "reference.csv").write_text("t,level\n0,1\n100,2\n")
    signal = {"kind": "table", "file": "tables/reference.csv", "column": "level"}
    document["scenario"]["reference"] = [signal, 0.0]
    (tmp_path / "tank.toml").write_text(tomli_w.dumps(document))
    first = ftc.load(tmp_path / "tank.toml")
    again = ftc.load(first.save(tmp_path / "copy" / "tank.toml"))
    assert again.core.record() == first.core.record()
    np.testing.assert_array_equal(again.simulate()["y_ref"], first.simulate()["y_ref"])


def test_a_design_travels(tank: ftc.Design) -> None:
    """To another process and back, without solving again."""
    again = pickle.loads(pickle.dumps(tank))  # noqa: S301
    assert again.report == tank.report
    assert again.core.record() == tank.core.record()


def test_reports(tank: ftc.Design) -> None:
    """As text, as one line, and as a page in a notebook."""
    assert "State feedback" in str(tank)
    assert "tank" in repr(tank)
    page = tank._repr_html_()
    assert page.lower().count("<svg") >= 1
    assert "tank" in page


@pytest.mark.parametrize("threads", [0, -1, "2", 1.5])
def test_threads_are_a_whole_number(tanks: ftc.Plant, threads: object) -> None:
    """Refused by name."""
    with pytest.raises(ftc.DesignFileError, match=r"threads is .*: give a whole number from 1 on"):
        ftc.design(tanks, threads=threads)
    with pytest.raises(ftc.DesignFileError, match=r"threads is .*: give a whole number from 1 on"):
        ftc.load(EXAMPLES / "tank.toml", threads=threads)


def test_an_unknown_key_is_named(tanks: ftc.Plant) -> None:
    """The nearest known one, too; there is no line where there is no file."""
    with pytest.raises(ftc.DesignFileError, match="tracked") as refused:
        ftc.design(tanks, trakced=[1])
    assert refused.value.key == "controller.trakced"
    assert refused.value.line is None
    assert str(refused.value).startswith("controller.trakced is not a known key")


@pytest.mark.parametrize(
    ("keys", "key", "says"),
    [
        ({"estimator": "none"}, "estimator", "give a dictionary"),
        ({"controller": [1]}, "controller", "give a dictionary"),
        ({"scenario": "steps"}, "scenario", "give a dictionary"),
        ({"scenario": {"events": {"kind": "stuck"}}}, "scenario.events", "must be a list of tables"),
        ({"tracked": [1.5]}, "controller.tracked", "whole number"),
    ],
)
def test_what_is_no_table_or_number_is_named(tanks: ftc.Plant, keys: dict, key: str, says: str) -> None:
    """Before anything is solved."""
    with pytest.raises(ftc.DesignFileError, match=says) as refused:
        ftc.design(tanks, **keys)
    assert refused.value.key == key


def test_a_design_is_made_of_a_plant() -> None:
    """Matrices alone are none."""
    with pytest.raises(ftc.DesignFileError, match=r"plant is of type list: give an ftc_fmu\.Plant"):
        ftc.design([([[0.5]], [[1.0]], [[1.0]])])


@pytest.mark.parametrize(
    ("find", "put", "key"),
    [
        ("sample_time = 1.0", "sample_time = -1.0", "sample_time"),
        ('lyapunov = "common"', 'lyapunov = "comon"', "controller.lyapunov"),
        ("steps = 1600", "steps = 0", "scenario.steps"),
        ("B = [[0.0, 1.0], [1.0, 0.0]]", "B = [[0.0, 1.0], [1.0]]", "mode 1: B"),
    ],
)
def test_a_wrong_file_is_told_by_key_and_line(find: str, put: str, key: str, tmp_path: Path) -> None:
    """The line is that of the key."""
    text = (EXAMPLES / "paper.toml").read_text()
    assert find in text
    path = tmp_path / "wrong.toml"
    path.write_text(text.replace(find, put, 1))
    with pytest.raises(ftc.DesignFileError) as refused:
        ftc.load(path)
    assert refused.value.key == key
    assert refused.value.line == 1 + text[: text.index(find)].count("\n")
    assert str(refused.value).startswith(str(path))


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    """By its name."""
    with pytest.raises(ftc.DesignFileError, match=r"nothing\.toml"):
        ftc.load(tmp_path / "nothing.toml")


def test_infeasible_has_blocks_and_advice() -> None:
    """What is in conflict, and what to change."""
    C = np.eye(2)
    first = ([[0.6, 0.45], [-0.2, 0.3]], [[0.0, 1.0], [1.0, 0.0]], C)
    second = ([[0.4, -0.3], [0.11, 0.0]], [[1.0, 0.0], [0.0, 1.0]], C)
    with pytest.raises(ftc.Infeasible) as refused:
        ftc.design(ftc.Plant([first, second], 1.0), decay=0.001, latency=1)
    assert refused.value.blocks
    assert all(isinstance(name, str) and share >= 0.0 for name, share in refused.value.blocks)
    assert refused.value.advice
    assert "line" not in str(refused.value)
    assert isinstance(refused.value, ftc.FtcError)


def test_tracked_outputs_by_name(tanks: ftc.Plant) -> None:
    """A wrong name is refused with the right ones."""
    with pytest.raises(ftc.DesignFileError, match="level 1, level 2"):
        ftc.design(tanks, tracked=["level 3"])


SLOW = """
import sys, numpy as np, ftc_fmu as ftc
rng = np.random.default_rng(0)
n = 12
modes = []
for _ in range(3):
    A = rng.normal(size=(n, n)); A *= 0.95 / max(abs(np.linalg.eigvals(A)))
    modes.append((A, rng.normal(size=(n, n // 2)), rng.normal(size=(n // 2, n)), np.zeros((n // 2, n // 2))))
plant = ftc.Plant(modes, 1.0)
"""


def test_ctrl_c_ends_the_wait() -> None:
    """Within a second or two, by KeyboardInterrupt."""
    # A shell without job control starts what runs in the background with the signal ignored.
    code = SLOW + (
        "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "def told(what, seconds):\n    print(what, flush=True)\n"
        "try:\n    ftc.design(plant, decay=0.97, estimator={'method': 'none'}, progress=told)\n    print('done')\n"
        "except KeyboardInterrupt:\n    print('interrupted', flush=True)\n"
        "    import os; os._exit(0)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert "solving" in process.stdout.readline()
    process.send_signal(signal.SIGINT)
    sent = time.monotonic()
    rest, _ = process.communicate(timeout=60)
    assert rest.splitlines()[-1] == "interrupted"
    assert time.monotonic() - sent < 10.0


def test_other_threads_run_on_while_solving() -> None:
    """The interpreter is released."""
    code = SLOW + (
        "import threading, time\nticks = []\nhalt = threading.Event()\n"
        "def tick():\n    while not halt.is_set():\n        ticks.append(time.monotonic()); time.sleep(0.005)\n"
        "threading.Thread(target=tick, daemon=True).start()\n"
        "n = 6\n"
        "plant = ftc.Plant([(m.A[:n,:n]*0.5, m.B[:n,:3], m.C[:3,:n]) for m in plant.modes[:2]], 1.0)\n"
        "begun = time.monotonic(); ftc.design(plant, decay=0.97); took = time.monotonic() - begun\n"
        "halt.set()\n"
        "during = [t for t in ticks if begun <= t <= begun + took]\n"
        "print(took, len(during), max(np.diff([begun, *during, begun + took])))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    took, ticks, longest = (float(word) for word in done.stdout.split())
    assert ticks >= 3
    assert longest < max(0.5, 0.5 * took)


def test_progress_may_be_printed(tanks: ftc.Plant, capsys: pytest.CaptureFixture) -> None:
    """And a listener that raises ends the wait."""
    ftc.design(tanks, decay=0.97, progress=True)
    assert "solving" in capsys.readouterr().out

    def stop(what: str, seconds: float) -> None:
        raise TimeoutError(f"{what} {seconds}")

    with pytest.raises(TimeoutError):
        ftc.design(tanks, progress=stop)
    assert threading.active_count() >= 1


def test_the_program_of_the_package() -> None:
    """Help, a wrong command, and its exit codes."""
    assert "simulate" in program("--help").stdout
    refused = program("design", "nothing.toml")
    assert refused.returncode == 2
    assert refused.stderr.startswith("error: nothing.toml")
    assert program("no-such-command").returncode == 2
