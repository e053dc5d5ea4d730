"""Other people's masters closing the loop: each steps both FMUs at once (Jacobi)."""

from __future__ import annotations

import contextlib
import functools
import logging
from typing import TYPE_CHECKING

import fmpy
import numpy as np
from fmu_manipulation_toolbox.assembly import AssemblyNode
from fmu_manipulation_toolbox.checker import get_checkers
from fmu_manipulation_toolbox.operations import FMU
from libcosimpy import CosimConstants
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

from fmu_loop import Schedule, slave
from fmu_loop import run as run_fmpy

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from commands import Exported

NANOSECONDS = 1_000_000_000

Loop = dict[str, np.ndarray]


def _sample_time(pair: Exported) -> float:
    return float(fmpy.read_model_description(pair.plant).defaultExperiment.stepSize)


def _variables(fmu: Path) -> list:
    return fmpy.read_model_description(fmu).modelVariables


def _named(fmu: Path, base: str) -> list:
    """Returns the elements of a vector variable, in order."""
    return [variable for variable in _variables(fmu) if variable.name.split("[")[0] == base]


def _links(pair: Exported, mode: str) -> Iterator[tuple[Path, object, Path, object]]:
    """Yields the connections of the loop: from FMU and variable, to FMU and variable.

    The mode goes by its Integer, `mode`, or by its Real, `mode_real`.
    """
    for base, source, target in [
        *((base, pair.plant, pair.controller) for base in ("y", "y_ref", mode)),
        ("u", pair.controller, pair.plant),
    ]:
        for out, into in zip(_named(source, base), _named(target, base), strict=True):
            yield source, out, target, into


def in_fmpy(pair: Exported, steps: int) -> Loop:
    """Steps both FMUs at once by hand; `y` and `u` as they are after each step."""
    loop = run_fmpy(pair, steps + 1, Schedule(parallel=True))
    return {"y": loop["y"][1:], "u": loop["u"][:-1]}


def _observe(execution: CosimExecution, pair: Exported, steps: int) -> Loop:
    """Runs an execution in which both FMUs already are."""
    observer = CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    names = {info.name.decode(): info.index for info in execution.slave_infos()}
    wanted = {"y": (names["plant"], pair.plant), "u": (names["controller"], pair.controller)}
    references = {base: [v.valueReference for v in _named(fmu, base)] for base, (_, fmu) in wanted.items()}
    rows: dict[str, list] = {base: [] for base in wanted}
    for _ in range(steps):
        assert execution.step()
        for base, (index, _) in wanted.items():
            rows[base].append(observer.last_real_values(index, references[base]))
    return {base: np.array(values) for base, values in rows.items()}


def in_libcosim(pair: Exported, steps: int) -> Loop:
    """Two FMUs connected one by one in libcosim, whose time is whole nanoseconds, by Reals only."""
    te = _sample_time(pair)
    execution = CosimExecution.from_step_size(round(te * NANOSECONDS))
    slaves = {
        fmu: CosimLocalSlave(str(fmu), name) for fmu, name in ((pair.controller, "controller"), (pair.plant, "plant"))
    }
    indices = {fmu: execution.add_local_slave(added) for fmu, added in slaves.items()}
    for source, out, target, into in _links(pair, "mode_real"):
        done = execution.connect_real_variables(
            indices[source], out.valueReference, indices[target], into.valueReference
        )
        assert done == CosimConstants.success
    return _observe(execution, pair, steps)


def in_libcosim_from_package(pair: Exported, steps: int) -> Loop:
    """The SSP package as it is: FMUs, connections and step size come from it."""
    return _observe(CosimExecution.from_ssp_file(str(pair.package)), pair, steps)


def in_container(pair: Exported, steps: int, *, controller_first: bool = False) -> Loop:
    """Both FMUs packed into one by fmu-manipulation-toolbox, which fmpy runs.

    The container initializes in the order of its list: a controller that is listed first leaves
    initialization mode before there is a mode to be told of.
    """
    folder = pair.plant.parent
    te = _sample_time(pair)
    node = AssemblyNode("container.fmu", step_size=te, auto_link=False, auto_input=False, auto_output=False)
    for fmu in (pair.controller, pair.plant) if controller_first else (pair.plant, pair.controller):
        node.add_fmu(fmu.name)
    for source, out, target, into in _links(pair, "mode"):
        node.add_link(source.name, out.name, target.name, into.name)
    for base, fmu in (("y", pair.plant), ("u", pair.controller)):
        for variable in _named(fmu, base):
            node.add_output(fmu.name, variable.name, variable.name)
    node.make_fmu(folder)
    with slave(folder / "container.fmu", "container") as container:
        container.initialize(0.0)
        rows: dict[str, list] = {"y": [], "u": []}
        for k in range(steps):
            container.step(k * te, te)
            for base, values in rows.items():
                values.append(container.get(base))
    return {base: np.array(values) for base, values in rows.items()}


ALL = {
    "fmpy": in_fmpy,
    "libcosim": in_libcosim,
    "libcosim-ssp": in_libcosim_from_package,
    "container": in_container,
    "container-controller-first": functools.partial(in_container, controller_first=True),
}


@contextlib.contextmanager
def _errors() -> Iterator[list[str]]:
    """Collects what the toolbox calls an error."""
    collected: list[str] = []
    handler = logging.Handler(logging.ERROR)
    handler.emit = lambda entry: collected.append(entry.getMessage())
    logger = logging.getLogger("fmu_manipulation_toolbox")
    logger.addHandler(handler)
    try:
        yield collected
    finally:
        logger.removeHandler(handler)


def toolbox_errors(fmu: Path) -> list[str]:
    """Returns what every checker of fmu-manipulation-toolbox finds wrong with an FMU."""
    with _errors() as errors, FMU(str(fmu)) as opened:
        for checker in get_checkers():
            opened.apply_operation(checker())
    return errors
