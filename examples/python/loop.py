"""Closes the loop of an exported controller and its plant in fmpy: what any FMI 2.0 simulator does."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import fmpy
import numpy as np

if TYPE_CHECKING:
    from pathlib import Path


class Fmu:
    """An instance of one FMU, with signals by name."""

    def __init__(self, path: Path) -> None:
        """Loads and initialises the FMU."""
        description = fmpy.read_model_description(str(path))
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.folder = fmpy.extract(str(path))
        self.fmu = fmpy.instantiate_fmu(self.folder, description, fmi_type="CoSimulation")
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def names(self, signal: str) -> list[str]:
        """Returns `y[1]`, `y[2]`, ... of a vector."""
        return [name for name in self.variables if name.startswith(f"{signal}[")]

    def read(self, signal: str) -> np.ndarray:
        """Returns a vector signal."""
        return np.array(self.fmu.getReal([self.variables[name].valueReference for name in self.names(signal)]))

    def write(self, signal: str, values: np.ndarray) -> None:
        """Sets a vector signal."""
        references = [self.variables[name].valueReference for name in self.names(signal)]
        self.fmu.setReal(references, values.tolist())

    def step(self, tick: int, sample_time: float) -> None:
        """Runs from one sample to the next."""
        self.fmu.doStep(currentCommunicationPoint=tick * sample_time, communicationStepSize=sample_time)

    def close(self) -> None:
        """Ends the instance and removes what was unpacked."""
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)


def close_loop(controller: Path, plant: Path, steps: int, sample_time: float) -> dict[str, np.ndarray]:
    """Steps controller, then plant, `steps` times, and returns what both did, one row per sample."""
    controller, plant = Fmu(controller), Fmu(plant)
    seen = {name: [] for name in ("y", "y_true", "y_ref", "u", "f_hat")}
    mode = [plant.variables["mode"].valueReference], [controller.variables["mode"].valueReference]
    try:
        for tick in range(steps):
            for signal in ("y", "y_ref"):
                controller.write(signal, plant.read(signal))
            controller.fmu.setInteger(mode[1], plant.fmu.getInteger(mode[0]))
            controller.step(tick, sample_time)
            plant.write("u", controller.read("u"))
            for signal, rows in seen.items():
                source = controller if signal in ("u", "f_hat") else plant
                rows.append(source.read(signal))
            plant.step(tick, sample_time)
    finally:
        controller.close()
        plant.close()
    return {signal: np.array(rows) for signal, rows in seen.items()}
