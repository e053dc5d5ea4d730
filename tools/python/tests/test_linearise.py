"""Plants from FMUs: of another maker (built here, FMI 2 and 3), and our own nonlinear rectifier.

promise: python-fmu-in
"""

from __future__ import annotations

import importlib.metadata
import re
import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
import scipy.signal

import ftc_fmu as ftc
from conftest import EXAMPLES

HEADERS = Path(fmpy.__file__).parent / "c-code"
DERIVATIVES = {"fmi2GetDirectionalDerivative", "fmi3GetDirectionalDerivative"}
# FMUs that OpenModelica made, out of a package that is installed for them alone.
OPENMODELICA = {
    Path(file).name: Path(file.locate())
    for file in importlib.metadata.distribution("gemseo-fmu").files
    if "linux" in file.parts and file.suffix == ".fmu"
}

FMI2 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="oscillator" guid="{{1}}">
<ModelExchange modelIdentifier="oscillator" {derivatives}/>
<UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit></UnitDefinitions>
<ModelVariables>
<ScalarVariable name="x1" valueReference="0" causality="local" initial="exact">
<Real start="0.5" unit="m"/></ScalarVariable>
<ScalarVariable name="x2" valueReference="1" causality="local" initial="exact"><Real start="0"/></ScalarVariable>
<ScalarVariable name="der(x1)" valueReference="2"><Real derivative="1"/></ScalarVariable>
<ScalarVariable name="der(x2)" valueReference="3"><Real derivative="2"/></ScalarVariable>
<ScalarVariable name="u" valueReference="4" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="w" valueReference="5" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="y" valueReference="6" causality="output"><Real unit="m"/></ScalarVariable>
<ScalarVariable name="mu" valueReference="7" causality="parameter" variability="fixed">
<Real start="1"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="7"/></Outputs>
<Derivatives><Unknown index="3"/><Unknown index="4"/></Derivatives></ModelStructure>
</fmiModelDescription>"""

FMI3 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="oscillator" instantiationToken="1">
<ModelExchange modelIdentifier="oscillator" {derivatives}/>
<UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit></UnitDefinitions>
<ModelVariables>
<Float64 name="time" valueReference="8" causality="independent" variability="continuous"/>
<Float64 name="x1" valueReference="0" causality="local" variability="continuous" initial="exact" start="0.5" unit="m"/>
<Float64 name="x2" valueReference="1" causality="local" variability="continuous" initial="exact" start="0"/>
<Float64 name="der(x1)" valueReference="2" derivative="0"/>
<Float64 name="der(x2)" valueReference="3" derivative="1"/>
<Float64 name="u" valueReference="4" causality="input" start="0"/>
<Float64 name="w" valueReference="5" causality="input" start="0"/>
<Float64 name="y" valueReference="6" causality="output" unit="m"/>
<Float64 name="mu" valueReference="7" causality="parameter" variability="fixed" start="1"/>
</ModelVariables>
<ModelStructure><Output valueReference="6"/>
<ContinuousStateDerivative valueReference="2"/><ContinuousStateDerivative valueReference="3"/></ModelStructure>
</fmiModelDescription>"""


ARRAYS = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="arrays" instantiationToken="1">
<ModelExchange modelIdentifier="arrays"/>
<ModelVariables>
<Float64 name="time" valueReference="9" causality="independent" variability="continuous"/>
<Float64 name="x" valueReference="0" causality="local" initial="exact" start="0 0"><Dimension start="2"/></Float64>
<Float64 name="der(x)" valueReference="1" derivative="0"><Dimension start="2"/></Float64>
<Float64 name="u" valueReference="2" causality="input" start="0 0"><Dimension start="2"/></Float64>
<Float64 name="y" valueReference="3" causality="output"><Dimension start="2"/></Float64>
<Float64 name="A" valueReference="4" causality="parameter" variability="fixed" start="-1 0 0 -1">
<Dimension start="2"/><Dimension start="2"/></Float64>
</ModelVariables>
<ModelStructure><Output valueReference="3"/><ContinuousStateDerivative valueReference="1"/></ModelStructure>
</fmiModelDescription>"""


def made(folder: Path, source: str, version: int, text: str, flags: list[str]) -> Path:
    """An FMU from its C source and its description."""
    code = Path(__file__).parent / f"{source}.c"
    library = folder / f"{source}.so"
    # fmpy looks for every function of the standard; those it never calls here lead nowhere.
    names = re.findall(
        rf"#define (fmi{version}\w+)\s+fmi{version}FullName", (HEADERS / f"fmi{version}Functions.h").read_text()
    )
    written = set(re.findall(r"^fmi\w+ \*?(fmi\w+)\(|^void (fmi\w+)\(", code.read_text(), re.MULTILINE))
    there = {name for pair in written for name in pair} - (set() if "-DDERIVATIVES" in flags else DERIVATIVES)
    absent = [f"-Wl,--defsym={name}=fmi{version}Terminate" for name in names if name not in there]
    command = ["cc", "-shared", "-fPIC", "-O1", f"-DFMI={version}", *flags, "-I", HEADERS, code, *absent, "-o", library]
    subprocess.run(command, check=True)
    fmu = folder / f"{source}.fmu"
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.write(library, f"binaries/{ {2: 'linux64', 3: 'x86_64-linux'}[version] }/{source}.so")
    return fmu


@pytest.fixture(scope="module", params=[(2, True), (2, False), (3, True), (3, False)], ids=str)
def oscillator(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of another maker, with directional derivatives and without."""
    version, derivatives = request.param
    attribute = {2: "providesDirectionalDerivative", 3: "providesDirectionalDerivatives"}[version]
    text = {2: FMI2, 3: FMI3}[version].format(derivatives=f'{attribute}="{str(derivatives).lower()}"')
    flags = ["-DDERIVATIVES"] if derivatives else []
    return made(tmp_path_factory.mktemp("oscillator"), "oscillator", version, text, flags)


def test_a_model_exchange_fmu_is_linearised(oscillator: Path) -> None:
    """At a steady state per mode, equal to the Jacobian by hand, discretised exactly."""
    points = [{"u": 0.125, "mu": 1.0}, {"u": 1.0, "mu": 0.5, "x1": 0.8}]
    plant = ftc.Plant.from_fmu(
        oscillator, ["u"], ["y"], points, sample_time=0.2, disturbance_inputs=["w"], names=["slow", "fast"]
    )
    for mode, point in zip(plant.modes, points, strict=True):
        u, mu = point["u"], point["mu"]
        x1 = u ** (1 / 3)
        A = np.array([[0.0, 1.0], [-3 * x1**2, mu * (1 - x1**2)]])
        B, C, D = np.array([[0.0, 0.2], [1.0, 0.0]]), np.array([[1.0, 0.0]]), np.array([[0.0, 0.05]])
        Ad, Bd, *_ = scipy.signal.cont2discrete((A, B, C, D), 0.2)
        found = [mode.A, mode.B, mode.C, mode.D, mode.E, mode.F]
        for got, expected in zip(found, [Ad, Bd[:, :1], C, [[0.0]], Bd[:, 1:], [[0.05]]], strict=True):
            np.testing.assert_allclose(got, expected, atol=1e-8)
        np.testing.assert_allclose(mode.operating_point.x, [x1, 0.0], atol=1e-8)
        np.testing.assert_allclose(mode.operating_point.y, [x1], atol=1e-8)
    assert plant.signals["states"][0] == {"name": "x1", "unit": "m"}
    assert [mode.name for mode in plant.modes] == ["slow", "fast"]


def test_linearised_where_it_is(oscillator: Path) -> None:
    """Away from a steady state, if that is asked for."""
    plant = ftc.Plant.from_fmu(oscillator, ["u"], ["y"], [{"x1": 0.3, "x2": 0.4}], sample_time=0.1, steady=False)
    A = np.array([[0.0, 1.0], [-2 * 0.3 * 0.4 - 3 * 0.09, 1 - 0.09]])
    np.testing.assert_allclose(plant.modes[0].A, scipy.linalg.expm(0.1 * A), atol=1e-8)
    np.testing.assert_allclose(plant.modes[0].C, [[1.0, 0.08]], atol=1e-8)


def test_arrays_are_taken_element_by_element(tmp_path: Path) -> None:
    """By the array's name or by an element's; parameters as matrices, what is not named keeps its start value."""
    fmu = made(tmp_path, "arrays", 3, ARRAYS, [])
    A = np.array([[-1.0, 0.5], [0.2, -2.0]])
    plant = ftc.Plant.from_fmu(
        fmu,
        ["u[2]"],
        ["y"],
        [{"A": A, "u": [1.0, 2.0]}, {"A[1,2]": 0.25, "u[1]": 3.0}],
        sample_time=0.1,
        disturbance_inputs=["u[1]"],
    )
    for mode, (matrix, u) in zip(plant.modes, [(A, [1, 2]), (np.array([[-1, 0.25], [0, -1]]), [3, 0])], strict=True):
        Ad, Bd, *_ = scipy.signal.cont2discrete((matrix, np.eye(2), np.eye(2), matrix), 0.1)
        found = [mode.A, mode.B, mode.C, mode.D, mode.E, mode.F]
        expected = [Ad, Bd[:, 1:], np.eye(2), matrix[:, 1:], Bd[:, :1], matrix[:, :1]]
        for got, one in zip(found, expected, strict=True):
            np.testing.assert_allclose(got, one, atol=1e-8)
        np.testing.assert_allclose(mode.operating_point.x, np.linalg.solve(matrix, -np.array(u)), atol=1e-8)
    assert [signal["name"] for signal in plant.signals["states"]] == ["x[1]", "x[2]"]
    with pytest.raises(ftc.DesignFileError, match='"A" takes 4 numbers, not 2'):
        ftc.Plant.from_fmu(fmu, ["u"], ["y"], [{"A": [1.0, 2.0]}], sample_time=0.1)


def test_fmus_of_openmodelica() -> None:
    """A mass with spring and damper, and a chain's half, equal to their equations."""
    plant = ftc.Plant.from_fmu(OPENMODELICA["Mass_Damper.fmu"], ["f"], ["y"], sample_time=1e-3)
    A, B = np.array([[0.0, 1.0], [-1e4, -10.0]]), np.array([[0.0], [-1.0]])
    Ad, Bd, *_ = scipy.signal.cont2discrete((A, B, np.eye(2), np.zeros((2, 1))), 1e-3)
    (mode,) = plant.modes
    np.testing.assert_allclose(mode.A, Ad, atol=1e-7)
    np.testing.assert_allclose(mode.B, Bd, atol=1e-9)
    np.testing.assert_allclose(mode.C, [[-1.0, 0.0]], atol=1e-8)
    assert plant.signals["inputs"] == [{"name": "f", "unit": "N"}]

    points = [{"k1": 2.0, "k2": 1.0, "m1": 1.0}, {"k1": 3.0, "k2": 1.0, "m1": 2.0}]
    plant = ftc.Plant.from_fmu(OPENMODELICA["MassSpringSubSystem1.fmu"], ["x2"], ["x1"], points, sample_time=0.1)
    for mode, point in zip(plant.modes, points, strict=True):
        stiffness = (point["k1"] + point["k2"]) / point["m1"]
        A, B = np.array([[0.0, -stiffness], [1.0, 0.0]]), np.array([[point["k2"] / point["m1"]], [0.0]])
        Ad, Bd, *_ = scipy.signal.cont2discrete((A, B, np.eye(2), np.zeros((2, 1))), 0.1)
        np.testing.assert_allclose(mode.A, Ad, atol=1e-8)
        np.testing.assert_allclose(mode.B, Bd, atol=1e-8)
        np.testing.assert_allclose(mode.C, [[0.0, 1.0]], atol=1e-8)


def test_wrong_names_are_refused(oscillator: Path) -> None:
    """With those that there are."""
    with pytest.raises(ftc.DesignFileError, match='no variable "U": it has u'):
        ftc.Plant.from_fmu(oscillator, ["U"], ["y"], sample_time=0.1)


@pytest.mark.parametrize("version", [2, 3])
def test_wrong_directional_derivatives_are_found_out(version: int, tmp_path: Path) -> None:
    """Those of outputs are 0 in the Van der Pol oscillator of the Reference FMUs, whatever the output is."""
    attribute = {2: "providesDirectionalDerivative", 3: "providesDirectionalDerivatives"}[version]
    text = {2: FMI2, 3: FMI3}[version].format(derivatives=f'{attribute}="true"')
    forgetful = made(tmp_path, "oscillator", version, text, ["-DDERIVATIVES", "-DFORGETFUL"])
    with pytest.warns(UserWarning, match='directional derivatives of the output "y" are not those'):
        found = ftc.Plant.from_fmu(forgetful, ["u"], ["y"], sample_time=0.1).modes[0]
    (tmp_path / "intact").mkdir()
    oscillator = made(tmp_path / "intact", "oscillator", version, text, ["-DDERIVATIVES"])
    intact = ftc.Plant.from_fmu(oscillator, ["u"], ["y"], sample_time=0.1).modes[0]
    for name in "ABC":
        np.testing.assert_allclose(getattr(found, name), getattr(intact, name), atol=1e-8)


def test_one_name_and_one_point_need_no_list(oscillator: Path) -> None:
    """A text is one name, not its letters; a dictionary one point."""
    plain = ftc.Plant.from_fmu(oscillator, "u", "y", {"u": 0.5}, sample_time=0.1)
    listed = ftc.Plant.from_fmu(oscillator, ["u"], ["y"], [{"u": 0.5}], sample_time=0.1)
    np.testing.assert_array_equal(plain.modes[0].A, listed.modes[0].A)


@pytest.mark.parametrize(
    ("inputs", "points", "says"),
    [
        (["y"], None, '"y" is no input of the FMU'),
        (["u", "u"], None, '"u" is named twice'),
        (["u"], [{"u": np.nan}], '"u" is nan: give finite numbers'),
        (["u"], [{"u": "half"}], "u is no array of numbers"),
        (["u"], ["half"], r"operating_points\[0\] is of type str: give a dictionary"),
    ],
)
def test_what_is_no_input_or_point_is_refused(oscillator: Path, inputs: list, points: list | None, says: str) -> None:
    """By name, before the FMU refuses a call."""
    with pytest.raises(ftc.DesignFileError, match=says):
        ftc.Plant.from_fmu(oscillator, inputs, ["y"], points, sample_time=0.1)


def test_what_is_no_fmu_is_refused(oscillator: Path, tmp_path: Path) -> None:
    """By its path: no archive, and an FMU without a binary for this machine."""
    for path in (tmp_path / "none.fmu", Path(__file__)):
        with pytest.raises(ftc.DesignFileError, match=f"{path.name} cannot be read as an FMU"):
            ftc.Plant.from_fmu(path, ["u"], ["y"], sample_time=0.1)
    bare = tmp_path / "bare.fmu"
    with zipfile.ZipFile(oscillator) as whole, zipfile.ZipFile(bare, "w") as archive:
        archive.writestr("modelDescription.xml", whole.read("modelDescription.xml"))
    with pytest.raises(ftc.FtcError, match="binary cannot be used on this machine"):
        ftc.Plant.from_fmu(bare, ["u"], ["y"], sample_time=0.1)


@pytest.fixture(scope="module")
def rectifier(tmp_path_factory: pytest.TempPathFactory) -> tuple[ftc.Design, Path]:
    """Our own nonlinear plant, for co-simulation, and the design it belongs to."""
    design = ftc.load(EXAMPLES / "converter.toml")
    return design, design.export(tmp_path_factory.mktemp("converter"))[1]


def test_our_nonlinear_rectifier_equals_its_analytic_linearisation(rectifier: tuple[ftc.Design, Path]) -> None:
    """Sample by sample, to 1e-6 of each matrix's size."""
    design, fmu = rectifier
    record = design.record()
    modes = record["plant"]["modes"]
    points = []
    for number, mode in enumerate(modes, 1):
        u = mode["operating_point"]["u"]
        off = {"scenario_enabled": False, "noise_enabled": False, "mode_ext": number}
        points.append({**off, "u[1]": u[0], "u[2]": u[1]})
    plant = ftc.Plant.from_fmu(
        fmu,
        ["u[1]", "u[2]"],
        ["y_true[1]", "y_true[2]"],
        points,
        sample_time=design.sample_time,
        states=["x[1]", "x[2]", "x[3]"],
        disturbance_inputs=["w_ext[1]"],
    )
    for found, mode in zip(plant.modes, modes, strict=True):
        for key in "ABCE":
            expected = np.array(mode[key.lower()])
            error = np.abs(getattr(found, key) - expected).max() / np.abs(expected).max()
            assert error < 1e-6, (key, error, getattr(found, key), expected)
        np.testing.assert_allclose(found.operating_point.x, mode["operating_point"]["x"], rtol=1e-9)
    again = ftc.design(plant, name="again", tracked=[1, 2], decay=0.9)
    assert len(again.report["spectral_radius"]) == 2


def test_a_co_simulation_fmu_must_show_its_state(rectifier: tuple[ftc.Design, Path]) -> None:
    """Else it is refused, as is one that is not at rest."""
    design, fmu = rectifier
    with pytest.raises(ftc.DesignFileError, match="give states="):
        ftc.Plant.from_fmu(fmu, ["u[1]"], ["y_true[1]"], sample_time=design.sample_time)
    arguments = {"sample_time": design.sample_time, "states": ["x[1]", "x[2]", "x[3]"]}
    point = {"scenario_enabled": False, "noise_enabled": False, "mode_ext": 1, "u[1]": 30.0}
    with pytest.raises(ftc.DesignFileError, match="not at rest"):
        ftc.Plant.from_fmu(fmu, ["u[1]", "u[2]"], ["y_true[1]"], [point], **arguments)
