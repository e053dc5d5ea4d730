"""FMUs from Python: written without a compiler, proved, run by fmpy."""

from __future__ import annotations

import zipfile
from pathlib import Path

import fmpy
import fmpy.validation
import numpy as np
import pytest

import ftc_fmu as ftc


@pytest.fixture(scope="module")
def exported(paper: ftc.Design, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Both FMUs and their package."""
    return paper.export(tmp_path_factory.mktemp("fmus"), ssp=True)


def test_every_platform_of_the_wheel_is_inside(exported: list[Path]) -> None:
    """And fmpy has nothing to say against the files."""
    assert [path.name for path in exported] == ["paper.ssp", "paper_controller.fmu", "paper_plant.fmu"]
    assert "linux64" in ftc.platforms()
    for path in exported[1:]:
        assert not fmpy.validation.validate_fmu(str(path))
        names = [Path(name).parts for name in zipfile.ZipFile(path).namelist()]
        assert sorted(parts[1] for parts in names if parts[0] == "binaries") == sorted(ftc.platforms())


def test_one_platform_alone(paper: ftc.Design, tmp_path: Path) -> None:
    """Others are left out; one that is not there is refused, and nothing is written."""
    controller, _ = paper.export(tmp_path / "one", platforms=["linux64"])
    names = zipfile.ZipFile(controller).namelist()
    assert [name for name in names if name.startswith("binaries/")] == ["binaries/linux64/paper_controller.so"]
    with pytest.raises(ftc.DesignFileError, match="darwin64 has no FMU binaries here") as refused:
        paper.export(tmp_path / "none", platforms=["darwin64"])
    assert refused.value.key == "platforms"
    assert not (tmp_path / "none").exists()
    with pytest.raises(ftc.DesignFileError, match=r'fmi is "3\.0"'):
        paper.export(tmp_path / "none", fmi="3.0")


def test_verify(exported: list[Path], tmp_path: Path) -> None:
    """A proof, or what is wrong."""
    proved = ftc.verify(exported[1])
    assert proved["verified"] is True
    damaged = tmp_path / "damaged.fmu"
    with zipfile.ZipFile(exported[1]) as source, zipfile.ZipFile(damaged, "w") as target:
        for name in source.namelist():
            data = source.read(name)
            if name == "resources/certificate.json":
                data = data.replace(b'"decay": 0.', b'"decay": 0.0')
            target.writestr(name, data)
    with pytest.raises(ftc.Unproved, match=r"damaged\.fmu"):
        ftc.verify(damaged)
    nothing = tmp_path / "nothing.fmu"
    nothing.write_bytes(b"no archive")
    with pytest.raises(ftc.FtcError, match="no FMU"):
        ftc.verify(nothing)


def test_the_controller_runs_in_fmpy(paper: ftc.Design, exported: list[Path]) -> None:
    """The command of the FMU is that of `Controller.step`, bit for bit."""
    description = fmpy.read_model_description(str(exported[1]))
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    folder = fmpy.extract(str(exported[1]))
    fmu = fmpy.instantiate_fmu(folder, description, fmi_type="CoSimulation")
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    twin = paper.controller()
    run = paper.simulate({"steps": 400})
    for k in range(400):
        y, y_ref, mode = run["ftc.y"][k], run["y_ref"][k], int(run["mode"][k])
        fmu.setReal([references[name] for name in ("y[1]", "y[2]", "y_ref[1]", "y_ref[2]")], [*y, *y_ref])
        fmu.setInteger([references["mode"]], [mode])
        fmu.doStep(currentCommunicationPoint=k * 1.0, communicationStepSize=1.0)
        u = np.array(fmu.getReal([references["u[1]"], references["u[2]"]]))
        assert u.tobytes() == twin.step(y, y_ref, mode).tobytes(), k
    fmu.terminate()
    fmu.freeInstance()
