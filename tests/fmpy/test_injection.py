"""Faults that are put on a sensor of the plant FMU while it runs.

promise: injected-faults
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import fmpy
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave

import commands

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

NONE, BIAS, DRIFT, GAIN, STUCK, DROPOUT, NOISE = range(7)
BEGIN, END = 6, 12


class Plant:
    """The plant FMU with names for references, stepped sample by sample without any scenario."""

    def __init__(self, path: Path, step: float) -> None:
        """Loads and initializes it."""
        self.step, self.tick = step, 0
        description = fmpy.read_model_description(path)
        self.reference = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(path),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="plant",
        )
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.setBoolean([self.reference["scenario_enabled"], self.reference["noise_enabled"]], [False, False])
        self.fmu.setInteger([self.reference["mode_ext"]], [1])
        self.fmu.exitInitializationMode()

    def inject(self, kind: int, size: float) -> None:
        """Puts a fault on the first sensor."""
        self.fmu.setInteger([self.reference["inject_kind[1]"]], [kind])
        for name, value in (("size", size), ("from", BEGIN * self.step), ("until", END * self.step)):
            self.fmu.setReal([self.reference[f"inject_{name}[1]"]], [value])

    def __call__(self, name: str) -> float:
        """Returns a Real."""
        return self.fmu.getReal([self.reference[name]])[0]

    def advance(self) -> None:
        """Takes one step under a command that moves every output."""
        self.fmu.setReal([self.reference["u[1]"]], [math.sin(self.tick)])
        self.fmu.doStep(self.tick * self.step, self.step)
        self.tick += 1

    def advance_under(self, kind: int, size: float) -> None:
        """Puts a fault on the first sensor and takes one step."""
        self.inject(kind, size)
        self.advance()

    def rows(self) -> Iterator[tuple[int, float, float, float]]:
        """Yields tick, reading, true output and fault of the first sensor, 16 samples long."""
        for _ in range(16):
            self.advance()
            yield self.tick, self("y[1]"), self("y_true[1]"), self("f[1]")


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plant FMU of the paper's example."""
    return commands.export(commands.ROOT / "examples" / "paper.toml", tmp_path_factory.mktemp("injection")).plant


@pytest.mark.parametrize("kind", range(7))
def test_a_fault_is_injected_at_run_time(path: Path, kind: int) -> None:
    """Each kind by its definition, set between two steps, present from its begin to its end."""
    plant = Plant(path, 1.0)
    for _ in range(2):
        plant.advance()
    plant.inject(kind, 0.25)
    before = math.nan
    draws = []
    for tick, reading, true, fault in plant.rows():
        if not BEGIN <= tick < END or kind == NONE:
            assert (reading, fault) == (true, 0.0)
            before = reading
            continue
        if kind == DROPOUT:
            assert math.isnan(reading)
            assert fault == 0.0
            continue
        wanted = {
            BIAS: true + 0.25,
            DRIFT: true + 0.25 * (tick - BEGIN),
            GAIN: 0.75 * true,
            STUCK: before,
            NOISE: reading,
        }[kind]
        assert reading == wanted
        assert fault == pytest.approx(reading - true, abs=1e-15)
        draws.append((reading - true) / 0.25)
    if kind == NOISE:
        assert len(set(draws)) == END - BEGIN
        assert all(abs(draw) < 6.0 for draw in draws)


def test_a_kind_beyond_the_last_is_refused(path: Path) -> None:
    """The declared range holds."""
    plant = Plant(path, 1.0)
    with pytest.raises(FMICallException):
        plant.advance_under(7, 1.0)
