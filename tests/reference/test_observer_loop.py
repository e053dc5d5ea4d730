"""The loop with `method = "observer"` against its second implementation: the same verdicts at every sample.

Flags, suspects, `model_valid`, faults of actuators and the mode found are equal; estimates, states and commands agree
to `RELATIVE` of their own size or of a thousandth of the signal's largest value. Both loops are closed, each with a
plant of its own: a difference in one sample would come back in the next.

Not compared: thresholds changed while it runs, readings marked as held, directional derivatives, saved states.

promise: second-implementation
"""

from __future__ import annotations

import re
import shutil
import tomllib
from copy import deepcopy
from typing import TYPE_CHECKING

import numpy as np
import pytest

import commands
import design_file
import fmu_loop
import observer_loop
import record

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

RELATIVE = 1e-7
ESTIMATES = ("y", "u", "x_hat", "f_hat", "residual", "load_hat", "mode_probability")
VERDICTS = ("fault", "suspect", "model_valid", "actuator_fault", "mode_hat")
OUTPUTS = (*ESTIMATES[1:], *VERDICTS)


class Fmu:
    """The exported controller as what closes a loop."""

    def __init__(self, design: dict, slave: fmu_loop.Slave) -> None:
        """Has not begun."""
        self.slave, self.te = slave, record.sample_time(design)
        self.late = design["controller"]["feedback"]["latency"] > 0
        self.tells = "mode" in slave.vectors
        self.names = [name for name in OUTPUTS if name in slave.vectors]
        self.ticks = 0
        self.u = self.acting = np.zeros(0)

    def _put(self, mode: int, y: np.ndarray, y_ref: np.ndarray) -> None:
        self.slave.set("y", y)
        self.slave.set("y_ref", y_ref)
        if self.tells:
            self.slave.set("mode", np.array([mode + 1]))

    def tick(self, told: int, y: np.ndarray, y_ref: np.ndarray, _fault: np.ndarray) -> dict:
        """Makes a communication step and returns the outputs."""
        if self.ticks == 0:
            self.slave.fmu.setupExperiment(startTime=0.0)
            self.slave.fmu.enterInitializationMode()
            self._put(told, y, y_ref)
            self.slave.fmu.exitInitializationMode()
            self.u = self.slave.get("u")
        self._put(told, y, y_ref)
        self.slave.step(self.ticks * self.te, self.te)
        self.ticks += 1
        said = {name: self.slave.get(name) for name in self.names}
        self.acting, self.u = self.u if self.late else said["u"], said["u"]
        return said


def assert_same(ours: list[dict], theirs: list[dict], leads: list[float]) -> None:
    """Compares two runs signal by signal; says at the first sample of another verdict how close it was."""
    for name in theirs[0]:
        got, wanted = (np.array([step[name] for step in run]) for run in (ours, theirs))
        assert name == "y" or np.isfinite(wanted).all(), name
        if name in VERDICTS:
            differing = np.flatnonzero((got != wanted).any(axis=1))
            if differing.size:
                at = differing[0]
                close = f"decided by {leads[at]:.3g} in log likelihood, {leads[max(at - 1, 0)]:.3g} a sample before"
                pytest.fail(f"{name} at sample {at}: {got[at]} instead of {wanted[at]}, {close}")
        else:
            largest = np.nanmax(np.abs(wanted), initial=0.0)
            np.testing.assert_allclose(got, wanted, rtol=RELATIVE, atol=1e-3 * RELATIVE * largest, err_msg=name)


def check_against_the_fmu(
    design: dict, fmu: Path, steps: int, spoil: Callable[[], Callable] | None = None, push: Callable | None = None
) -> tuple[list[dict], set[str]]:
    """Closes the loop twice, compares, and returns our run and what was thought possible in it."""
    deviations = np.array(design["scenario"]["noise"])
    noise = np.random.default_rng(8).normal(size=(steps, len(deviations))) * deviations
    controller = observer_loop.Controller(design, design["scenario"]["schedule"][0]["mode"])
    ours, leads = [], []
    for said in observer_loop.close(design, noise, controller, spoil and spoil(), push):
        ours.append(said)
        leads.append(controller.bank.lead)
    with fmu_loop.slave(fmu, "controller") as slave:
        theirs = list(observer_loop.close(design, noise, Fmu(design, slave), spoil and spoil(), push))
    assert_same(ours, theirs, leads)
    return ours, controller.bank.kept


def state_based(base: dict, **settings: object) -> dict:
    """Returns a design whose faults are estimated by hypotheses."""
    design = deepcopy(base)
    design["estimator"] = {"method": "observer", **settings}
    return design


def example(name: str, folder: Path) -> Path:
    """Writes an example with the default estimator in place of its own, and the logs to which it is fitted."""
    text = (commands.ROOT / "examples" / f"{name}.toml").read_text()
    logs = re.findall(r"^database = \[.*\]$", text, re.MULTILINE)
    for log in (commands.ROOT / "examples").glob("*.csv"):
        shutil.copy(log, folder)
    section = "\n".join(["[estimator]", 'method = "observer"', *logs, "", "["])
    text, count = re.subn(r"(?ms)^\[estimator\]\n.*?^\[", section, text)
    assert count == 1
    path = folder / f"{name}.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", ["paper", "paper_output", "paper_internal_model", "paper_latency", "tank", "logged"])
def test_examples(tmp_path: Path, name: str) -> None:
    """Every linear example, with and without compensation and told the fault, against the native run."""
    path = example(name, tmp_path)
    design = record.load(commands.export(path, tmp_path).controller)
    native = commands.simulate(path, tmp_path).trajectories
    mode = int(native["mode"][0, 0]) - 1
    for variant in ("ftc", "no_ftc", "told_the_fault"):
        controller = observer_loop.Controller(design, mode, variant)
        ours, leads = [], []
        for said in observer_loop.close(design, native["noise"], controller):
            ours.append(said)
            leads.append(controller.bank.lead)
        names = [name for name in (*ESTIMATES, *VERDICTS, "x") if f"{variant}.{name}" in native]
        assert set(names) >= {"y", "u", "x_hat", "f_hat", "residual", "fault", "x"}
        columns = {name: native[f"{variant}.{name}"] for name in names}
        theirs = [{name: column[tick] for name, column in columns.items()} for tick in range(native.ticks)]
        assert_same(ours, theirs, leads)


def test_the_nonlinear_converter(tmp_path: Path) -> None:
    """The rectifier's readings are those of the program's integration; estimator and controller are compared."""
    path = example("converter", tmp_path)
    design = record.load(commands.export(path, tmp_path).controller)
    native = commands.simulate(path, tmp_path).trajectories
    modes = native["mode"][:, 0].astype(int) - 1
    controller = observer_loop.Controller(design, modes[0])
    ours, leads = [], []
    for tick in range(2500):
        said = controller.tick(modes[tick], native["ftc.y"][tick], native["y_ref"][tick], np.zeros(2))
        ours.append(said)
        leads.append(controller.bank.lead)
    names = ("u", "x_hat", "f_hat", "residual", "fault")
    theirs = [{name: native[f"ftc.{name}"][tick] for name in names} for tick in range(2500)]
    assert_same(ours, theirs, leads)


def event(sensor: int, kind: str, begin: float, end: float, **sizes: float) -> dict:
    """Returns a fault of a sensor (from 0) between two samples."""
    return {"sensor": sensor, "from": begin, "until": end, "kind": {"kind": kind, **sizes}}


# What befalls the sensors of the paper's example, in samples of 1 s.
FAULTS = {
    "none": [],
    "bias": [event(0, "bias", 150.0, 300.0, size=0.3)],
    "dropout": [event(0, "dropout", 150.0, 200.0), event(1, "dropout", 180.0, 220.0)],
    "gain": [event(0, "gain-loss", 150.0, 350.0, loss=0.4)],
    "drift": [event(1, "drift", 150.0, 400.0, slope=0.004)],
    "stuck": [event(0, "stuck", 250.0, 450.0)],
    "intermittent": [event(1, "intermittent", 150.0, 400.0, size=0.3, period=20.0)],
    "start": [event(0, "bias", 0.0, 200.0, size=0.3)],
    "switch": [event(0, "bias", 400.0, 450.0, size=0.3), event(1, "bias", 400.0, 550.0, size=-0.2)],
    "together": [event(0, "bias", 200.0, 350.0, size=0.3), event(1, "bias", 200.0, 350.0, size=0.4)],
    "in turn": [
        event(0, "bias", 120.0, 260.0, size=-0.2),
        event(1, "gain-loss", 180.0, 300.0, loss=0.5),
        event(0, "drift", 340.0, 420.0, slope=-0.005),
        event(1, "stuck", 380.0, 480.0),
        event(0, "dropout", 460.0, 500.0),
    ],
}


def with_events(design: dict, events: list[dict], size: float = 1.0) -> dict:
    """Returns a record whose scenario has these events, their additions `size` times as large, and a switch."""
    te = record.sample_time(design)
    changed = deepcopy(design)
    plan = changed["scenario"]
    plan["fault"] = [{"kind": "constant", "value": 0.0}] * len(plan["fault"])
    modes = len(design["plant"]["modes"])
    plan["schedule"] = [{"from": 400.0 * te * k, "mode": k % modes} for k in range(modes)]
    plan["events"] = []
    for given in deepcopy(events):
        kind = given["kind"]
        for key in ("size", "slope"):
            if key in kind:
                kind[key] *= size / (te if key == "slope" else 1.0)
        if "period" in kind:
            kind["period"] *= te
        plan["events"].append(given | {"from": given["from"] * te, "until": given["until"] * te})
    return changed


def stuck_with_noise(sensor: int, begin: int, end: int, deviation: float) -> Callable[[], Callable]:
    """Returns what makes a sensor hold its value between two samples, and add noise of its own."""

    def begins() -> Callable[[int, np.ndarray], np.ndarray]:
        noise, held = np.random.default_rng(3).normal(size=end) * deviation, {}

        def spoil(tick: int, y: np.ndarray) -> np.ndarray:
            if not begin <= tick < end:
                return y
            held.setdefault(sensor, y[sensor])
            return np.where(np.arange(len(y)) == sensor, held[sensor] + noise[tick], y)

        return spoil

    return begins


def paper(**settings: object) -> dict:
    """Returns the paper's example."""
    return state_based(design_file.scenario_a(disturbed="state", reference="levels", noise=0.005), **settings)


def sensors(C: list[list[float]], *others: list[list[float]], **settings: object) -> dict:
    """Returns the paper's example with these sensors, in the second mode with others where they are given."""
    design = paper(**settings)
    for mode, matrix in zip(design["mode"], [C, *(others or [C])], strict=True):
        mode["C"], mode["F"] = matrix, [[0.1 * row] for row in range(len(C))]
    design["scenario"]["fault"] = [0.0] * len(C)
    tracked = [1, 2][: len(C)]
    design["controller"]["tracked"] = tracked
    design["scenario"]["reference"] = design["scenario"]["reference"][: len(tracked)]
    return design


def late(**settings: object) -> dict:
    """Returns the example designed for a delay, with saturating inputs that do not jump at a switch."""
    design = state_based(design_file.delayed(), **settings)
    design["signals"] = {"inputs": [{"min": -1.5, "max": 1.5}] * 2}
    design["controller"] |= {"bumpless": True}
    return design


def tank() -> dict:
    """Returns the stirred tank: three states, two sensors, one input, operating points, two harmonics."""
    return state_based(tomllib.loads((commands.ROOT / "examples" / "tank.toml").read_text()))


BOTH = [[1.0, 0.0], [0.0, 1.0]]
THREE = [*BOTH, [1.0, 1.0]]
DESIGNS = {
    "paper": paper,
    "trusting": lambda: paper(ambiguous="trust-model"),
    "found": lambda: paper(mode="estimated"),
    "found at once": lambda: sensors(BOTH, [[1.0, 0.2], [0.0, 1.0]], mode="estimated", mode_length=100),
    "three": lambda: sensors(THREE),
    "one": lambda: sensors(BOTH[:1]),
    "four, trusting": lambda: sensors([*THREE, [1.0, -1.0]], ambiguous="trust-model"),
    "late": late,
    "silenced": lambda: paper(stuck_after=3),
    "tank": tank,
}


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], tuple[dict, Path]]:
    """Returns a function that exports a design of `DESIGNS` once, and gives its record and controller."""
    done: dict[str, tuple[dict, Path]] = {}

    def make(name: str) -> tuple[dict, Path]:
        if name not in done:
            folder = tmp_path_factory.mktemp(name)
            fmu = commands.export(design_file.write(DESIGNS[name](), folder), folder).controller
            done[name] = (record.load(fmu), fmu)
        return done[name]

    return make


@pytest.mark.parametrize("faults", list(FAULTS))
@pytest.mark.parametrize("name", ["paper", "trusting"])
def test_faults(exported: Callable[[str], tuple[dict, Path]], name: str, faults: str) -> None:
    """Each kind of fault, alone and together, at the switch and from the first sample."""
    design, fmu = exported(name)
    run, _ = check_against_the_fmu(with_events(design, FAULTS[faults]), fmu, 620)
    flagged = np.array([step["fault"] for step in run])
    assert flagged.any() == (faults != "none")


@pytest.mark.parametrize("faults", ["switch", "in turn"])
@pytest.mark.parametrize("name", [name for name in DESIGNS if name not in {"paper", "trusting"}])
def test_designs(exported: Callable[[str], tuple[dict, Path]], name: str, faults: str) -> None:
    """Modes found, more and fewer sensors than states, delay, saturation, silenced repetition, physical units."""
    design, fmu = exported(name)
    outputs = design["signals"]["outputs"]
    size = 60.0 * min(design["scenario"]["noise"]) / 0.3
    events = [given | {"sensor": given["sensor"] % len(outputs)} for given in FAULTS[faults]]
    run, _ = check_against_the_fmu(with_events(design, events, size), fmu, 620)
    assert any(step["fault"].any() for step in run)


@pytest.mark.parametrize("name", ["paper", "trusting"])
def test_a_stuck_sensor_with_noise(exported: Callable[[str], tuple[dict, Path]], name: str) -> None:
    """It repeats no reading; its noise about one value tells."""
    design, fmu = exported(name)
    run, kept = check_against_the_fmu(with_events(design, []), fmu, 620, stuck_with_noise(0, 250, 450, 0.005))
    assert "freeze" in kept
    assert any(step["fault"][0] for step in run)


# What the plant does that the model does not know: gains of the inputs, loads on the states, errors of the matrices.
DEPARTURES = {
    "weak input": {"gain": 0.7},
    "load": {"load": [0.2, 0.0]},
    "unmatched load": {"load": [0.05, -0.05]},
    "elsewhere": {"start": [0.5, -0.3]},
    "wrong matrices": {"error": 0.15},
    "another plant": {"error": 0.8},
}


def depart(design: dict, *, gain: float = 1.0, error: float = 0.0) -> dict:
    """Returns a record whose plant has a weak first input, or relative errors in every entry of A and B."""
    changed, random = deepcopy(design), np.random.default_rng(5)
    plant = deepcopy(design["plant"])
    for mode in plant["modes"]:
        mode["b"] = (np.array(mode["b"]) * [gain, 1.0]).tolist()
        for key in "ab":
            matrix = np.array(mode[key])
            mode[key] = (matrix * (1.0 + error * random.uniform(-1.0, 1.0, matrix.shape))).tolist()
    changed["true_plant"] = {"kind": "linear", "plant": plant}
    return changed


def pushed(load: tuple[float, ...] = (0.0, 0.0), start: tuple[float, ...] = (0.0, 0.0)) -> Callable:
    """Returns a load on the states that acts from sample 150 to 350, and how far from rest the plant begins."""

    def push(tick: int) -> np.ndarray:
        return np.array(start) if tick < 0 else np.array(load) * (150 <= tick < 350)

    return push


@pytest.mark.parametrize("departure", list(DEPARTURES))
@pytest.mark.parametrize("name", ["paper", "three"])
def test_a_changed_plant(exported: Callable[[str], tuple[dict, Path]], name: str, departure: str) -> None:
    """The plant is not the model, and one sensor fails."""
    design, fmu = exported(name)
    given = DEPARTURES[departure]
    push = pushed(**{key: given[key] for key in ("load", "start") if key in given})
    changed = depart(design, **{key: given[key] for key in ("gain", "error") if key in given})
    faulty = with_events(changed, [event(0, "bias", 200.0, 300.0, size=0.3)])
    check_against_the_fmu(faulty, fmu, 620, push=push)


def test_a_wrong_model_whose_mode_is_looked_for(exported: Callable[[str], tuple[dict, Path]]) -> None:
    """Drifts are likelier by far than all that convinces: what convinces stays, and each mode has a probability."""
    design, fmu = exported("found")
    faulty = with_events(depart(design, error=0.8), [event(1, "drift", 150.0, 400.0, slope=0.004)])
    run, _ = check_against_the_fmu(faulty, fmu, 300)
    np.testing.assert_allclose([step["mode_probability"].sum() for step in run], 1.0, rtol=1e-12)


def test_every_explanation_is_tried(exported: Callable[[str], tuple[dict, Path]]) -> None:
    """The comparisons reach everything that a hypothesis can be made of."""
    design, fmu = exported("paper")
    kept = set()
    for changed, push in (
        (with_events(design, FAULTS["in turn"]), None),
        (with_events(depart(design, error=0.8), []), None),
        (with_events(design, []), pushed(start=(0.5, -0.3))),
        (with_events(design, FAULTS["drift"]), pushed(load=(0.2, 0.0))),
    ):
        kept |= check_against_the_fmu(changed, fmu, 620, push=push)[1]
    every = "stay load changed restored start home return drift bias scale freeze change release"
    assert kept == set(every.split())


@pytest.mark.parametrize("name", list(DESIGNS))
def test_a_flag_ends_with_its_fault(exported: Callable[[str], tuple[dict, Path]], name: str) -> None:
    """A bias is flagged to its last sample and for ten more at most; a jump of a load may explain its first two."""
    design, fmu = exported(name)
    size = 60.0 * max(design["scenario"]["noise"])
    healthy = with_events(design, [])
    run, _ = check_against_the_fmu(with_events(healthy, [event(0, "bias", 150.0, 300.0, size=size)]), fmu, 400)
    flagged = np.array([step["fault"][0] for step in run], dtype=bool)
    assert flagged[152:300].all()
    assert not flagged[310:].any()
