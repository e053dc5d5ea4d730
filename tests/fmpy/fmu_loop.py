"""Two FMUs in a closed loop, driven through fmpy as any co-simulation master would."""

from __future__ import annotations

import contextlib
import re
import shutil
from dataclasses import dataclass
from typing import TYPE_CHECKING

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from commands import Exported

MEASURED = ("y", "y_ref", "mode")
FROM_PLANT = ("y", "y_true", "x", "y_ref", "mode", "f", "w")
FROM_CONTROLLER = ("u", "x_hat", "f_hat", "residual", "fault")
# What a controller adds that is told no mode.
FOUND = ("mode_hat", "mode_hat_real", "mode_probability")


class Slave:
    """One instance of an FMU, its scalar variables gathered into vectors by name."""

    def __init__(self, path: Path, instance_name: str) -> None:
        """Unzips and instantiates an FMU."""
        self.description = fmpy.read_model_description(path)
        self.folder = fmpy.extract(path)
        self.fmu = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=instance_name,
        )
        self.fmu.instantiate()
        self.vectors: dict[str, list[int]] = {}
        self.types: dict[str, str] = {}
        for variable in self.description.modelVariables:
            name = re.sub(r"\[\d+\]$", "", variable.name)
            self.vectors.setdefault(name, []).append(variable.valueReference)
            self.types[name] = variable.type

    def get(self, name: str) -> np.ndarray:
        """Returns a vector."""
        read = {"Real": self.fmu.getReal, "Integer": self.fmu.getInteger, "Boolean": self.fmu.getBoolean}
        return np.array(read[self.types[name]](self.vectors[name]), dtype=float)

    def set(self, name: str, values: np.ndarray) -> None:
        """Sets a vector."""
        match self.types[name]:
            case "Real":
                self.fmu.setReal(self.vectors[name], list(values))
            case "Integer":
                self.fmu.setInteger(self.vectors[name], [int(value) for value in values])
            case "Boolean":
                self.fmu.setBoolean(self.vectors[name], [bool(value) for value in values])

    def take(self, names: tuple[str, ...], source: Slave) -> None:
        """Copies outputs of another FMU to the inputs of the same name, if there are such."""
        for name in names:
            if name in self.vectors:
                self.set(name, source.get(name))

    def initialize(self, start_time: float, *, inputs_from: Slave | None = None) -> None:
        """Goes through initialization mode, taking measured inputs from a plant already initialized."""
        self.fmu.setupExperiment(startTime=start_time)
        self.fmu.enterInitializationMode()
        if inputs_from:
            self.take(MEASURED, inputs_from)
        self.fmu.exitInitializationMode()

    def step(self, time: float, size: float) -> None:
        """Makes one communication step."""
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def close(self) -> None:
        """Ends the instance and removes the unzipped files."""
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder)


@contextlib.contextmanager
def slave(path: Path, instance_name: str) -> Iterator[Slave]:
    """Opens an FMU for the length of a block."""
    opened = Slave(path, instance_name)
    try:
        yield opened
    finally:
        opened.close()


@dataclass(frozen=True)
class Schedule:
    """When a master steps and when it exchanges signals.

    Attributes:
        step: Communication step in sample times.
        exchange_every: Steps between two exchanges of signals.
        parallel: Both FMUs step from the same old signals (Jacobi) rather than the controller first
            (Gauss-Seidel).
        start_time: First communication point in seconds.
    """

    step: float = 1.0
    exchange_every: int = 1
    parallel: bool = False
    start_time: float = 0.0


def run(pair: Exported, steps: int, schedule: Schedule | None = None, *, ftc_enabled: bool = True) -> dict:
    """Closes the loop for a number of communication steps.

    Returns:
        One array per signal, one row per step: the plant's outputs at the step's beginning, and
        what the controller answers. A signal is exchanged at full steps of the schedule only.
    """
    schedule = schedule or Schedule()
    with slave(pair.plant, "plant") as plant, slave(pair.controller, "controller") as controller:
        controller.set("ftc_enabled", [ftc_enabled])
        plant.initialize(schedule.start_time)
        controller.initialize(schedule.start_time, inputs_from=plant)
        size = schedule.step * float(plant.description.defaultExperiment.stepSize)
        answers = (*FROM_CONTROLLER, *(name for name in FOUND if name in controller.vectors))
        rows: dict[str, list[np.ndarray]] = {name: [] for name in (*FROM_PLANT, *answers)}
        for index in range(0, steps, schedule.exchange_every):
            for name in FROM_PLANT:
                rows[name].append(plant.get(name))
            controller.take(MEASURED, plant)
            if schedule.parallel:
                plant.take(("u",), controller)
            times = [schedule.start_time + i * size for i in range(index, index + schedule.exchange_every)]
            for time in times:
                controller.step(time, size)
            for name in answers:
                rows[name].append(controller.get(name))
            if not schedule.parallel:
                plant.take(("u",), controller)
            for time in times:
                plant.step(time, size)
        return {name: np.array(values) for name, values in rows.items()}


def differing(loop: dict, trajectories: object, variant: str) -> list[str]:
    """Returns the signals of a loop that are not, bit for bit, those of a native run's variant."""
    different = []
    for name, values in loop.items():
        if name in FOUND:
            continue
        if name == "f" and variant != "ftc":
            continue  # the table has it once: what a stuck sensor adds depends on the run
        shared = name in {"mode", "y_ref", "w", "f"}
        native = trajectories[name if shared else f"{variant}.{name}"]
        if not np.array_equal(values, native[: len(values)], equal_nan=True):
            different.append(name)
    return different
