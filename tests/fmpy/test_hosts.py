"""Hosts as people have them: rounded steps, logging off, values out of range, a package opened by FMPy."""

from __future__ import annotations

import zipfile
from typing import TYPE_CHECKING

import fmpy
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp

import commands
import fmu_loop
import record

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from conftest import Case

TICKS = 600


@pytest.fixture(scope="module")
def fast_case(tmp_path_factory: pytest.TempPathFactory) -> commands.Exported:
    """The paper's example at 60 Hz, its times scaled with it."""
    folder = tmp_path_factory.mktemp("hz")
    text = (commands.ROOT / "examples" / "paper.toml").read_text(encoding="utf-8")
    for old, new in [("sample_time = 1.0", "sample_time = 0.016666666666666666"), ('name = "paper"', 'name = "hz"')]:
        assert old in text
        text = text.replace(old, new, 1)
    design = folder / "hz.toml"
    design.write_text(text, encoding="utf-8")
    return commands.export(design, folder)


def test_a_step_rounded_to_seven_digits_is_the_sample_time(fast_case: commands.Exported) -> None:
    """0.0166667 s for 1/60 s gives the loop of 1/60 s, to the bit."""
    exact = fmu_loop.run(fast_case, TICKS)
    rounded = fmu_loop.run(fast_case, TICKS, fmu_loop.Schedule(step=0.0166667 * 60.0))
    for name, values in exact.items():
        np.testing.assert_array_equal(rounded[name], values, err_msg=name)


def test_what_is_refused_is_heard_with_logging_off(
    example_case: Callable[[str], Case], capfd: pytest.CaptureFixture
) -> None:
    """FMPy leaves logging off and prints what it hears: the sentence is there, with the variable's name."""
    with fmu_loop.slave(example_case("paper").fmus.controller, "controller") as controller:
        for bad in (-1.0, np.inf):
            with pytest.raises(Exception, match="status 3"):
                controller.set("threshold", np.array([bad, 0.1]))
        controller.set("mode", np.array([1]))
        controller.initialize(0.0)
        controller.set("mode_real", np.array([2.0]))
        with pytest.raises(Exception, match="status 3"):
            controller.step(0.0, 1.0)
        controller.set("mode_real", np.array([0.0]))
        controller.step(0.0, 1.0)
    heard = capfd.readouterr().out
    assert "threshold[1] is -1: give a finite number from 0 on" in heard
    assert "threshold[1] is inf: give a finite number from 0 on" in heard
    assert "mode is 1, but mode_real is 2" in heard


def test_readings_held_within_a_coarse_step_flag_no_sensor(example_case: Callable[[str], Case]) -> None:
    """The converter's controller, stepped as `fmpy simulate` does: hundreds of samples a step, inputs never set."""
    case = example_case("converter")
    te = record.sample_time(case.record)
    with fmu_loop.slave(case.fmus.controller, "controller") as controller:
        controller.set("mode", np.array([1]))
        controller.initialize(0.0)
        before = controller.get("fault")
        assert not before.any()
        for k in range(5):
            controller.step(k * 100 * te, 100 * te)
            frozen = np.isinf(controller.get("y"))
            assert not frozen.any()
        flagged = controller.get("fault")
        residual, threshold = controller.get("residual"), controller.get("threshold")
        # A reading far from the model's may be a fault; its repetition is none.
        assert not np.any(flagged.astype(bool) & (np.abs(residual) <= threshold))
        np.testing.assert_array_equal(flagged, controller.get("fault_real"))


def test_a_model_that_is_a_little_wrong_is_no_wrong_coupling(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    """Entries of the true plant's matrices off by up to 15 %: the right coupling is silent, the wrong one is told.

    promise: wrong-delay
    """
    for example, right in [("paper", False), ("paper_latency", True)]:
        out = tmp_path / example
        out.mkdir()
        design = out / f"{example}.toml"
        text = (commands.ROOT / "examples" / f"{example}.toml").read_text()
        design.write_text(f"{text}\n[scenario.plant]\nrelative_error = 0.15\nseed = 1\n")
        fmus = commands.export(design, out)
        for parallel in (right, not right):
            fmu_loop.run(fmus, 600, fmu_loop.Schedule(parallel=parallel))
            told = "of delay in the loop than the design allows for" in capfd.readouterr().out
            assert told == (parallel != right), (example, parallel)


def test_fmpy_simulate_flags_no_sensor(example_case: Callable[[str], Case], capfd: pytest.CaptureFixture) -> None:
    """`fmpy simulate` on the converter's controller: no inputs, steps of four samples, no mode told."""
    result = fmpy.simulate_fmu(str(example_case("converter").fmus.controller))
    flags = [name for name in result.dtype.names if name.startswith("fault")]
    assert len(flags) == 4
    assert not any(result[name].any() for name in flags)
    heard = capfd.readouterr().out
    assert heard.count("mode is 0, not told yet") == 1
    assert heard.count("ran on these old inputs") == 1


def test_fmpy_opens_the_package_and_closes_the_loop(example_case: Callable[[str], Case]) -> None:
    """`simulate_ssp` sets every connector to 0 first and steps in parallel: the loop tracks as the native one does.

    promise: ssp-package
    """
    case = example_case("paper_latency")
    native = case.run.trajectories
    te = record.sample_time(case.record)
    result = simulate_ssp(str(case.fmus.package), stop_time=(native.ticks - 1) * te, step_size=te)
    names = [f"plant.y_true[{i + 1}]" for i in range(native["ftc.y_true"].shape[1])]
    y_true = np.column_stack([result[name] for name in names])
    y_ref = np.column_stack([result[f"plant.y_ref[{i + 1}]"] for i in range(native["y_ref"].shape[1])])
    settled = slice(50, None)
    error = ((y_ref - y_true)[settled] ** 2).mean(axis=0)
    expected = ((native["y_ref"] - native["ftc.y_true"])[settled] ** 2).mean(axis=0)
    assert np.all(error <= 1.1 * expected)


def test_the_package_says_how_it_is_stepped(example_case: Callable[[str], Case]) -> None:
    """Annotations of two masters, no connector that nothing is connected to, and units on all that have one."""
    for example, says in [("paper", "latency = 0"), ("paper_latency", "latency = 1")]:
        case = example_case(example)
        with zipfile.ZipFile(case.fmus.package) as package:
            structure = package.read("SystemStructure.ssd").decode()
        assert says in structure
        assert structure.count("oms:FixedStepMaster") == 2
        assert "osp:FixedStepAlgorithm" in structure
        for unused in ("f_ext", "w_ext", "mode_ext"):
            assert unused not in structure
        with zipfile.ZipFile(case.fmus.controller) as archive:
            assert says in archive.read("modelDescription.xml").decode()
            page = archive.read("documentation/index.html").decode()
        assert "How to connect" in page
        assert says in page


def test_export_warns_where_the_package_does_not_fit(example_case: Callable[[str], Case], tmp_path: Path) -> None:
    """A design without delay in a package for masters that step in parallel; each export says how to step."""
    for example, latency in [("paper", 0), ("paper_latency", 1)]:
        said = commands.ftc_fmu("export", example_case(example).path, "--out", tmp_path, "--ssp")
        assert f"coupling: Step {['the controller before', 'controller and plant in parallel'][latency]}" in said
        assert ("warning: the masters that the package is for" in said) == (latency == 0)


def test_units_are_declared_for_importers(example_case: Callable[[str], Case]) -> None:
    """DegC is K with an offset, which does not apply to differences; connectors of the package carry units."""
    case = example_case("tank")
    with zipfile.ZipFile(case.fmus.controller) as archive:
        description = archive.read("modelDescription.xml").decode()
    assert '<BaseUnit K="1" offset="273.15"/>' in description
    for name in ("f_hat[1]", "residual[1]", "threshold[1]"):
        element = description.split(f'name="{name}"')[1].split("</ScalarVariable>")[0]
        assert 'relativeQuantity="true"' in element, name
    absolute = description.split('name="y[1]"')[1].split("</ScalarVariable>")[0]
    assert "relativeQuantity" not in absolute
    with zipfile.ZipFile(case.fmus.package) as package:
        structure = package.read("SystemStructure.ssd").decode()
    assert structure.count('unit="degC"') >= 10
    assert '<ssc:BaseUnit K="1" offset="273.15"/>' in structure


@pytest.mark.parametrize(
    ("example", "parallel", "told"),
    [
        ("paper", False, None),
        ("paper", True, "one sample more of delay"),
        ("paper_latency", True, None),
        ("paper_latency", False, "one sample less of delay"),
        ("tank", False, None),
    ],
)
def test_a_wrong_coupling_is_noticed(
    example_case: Callable[[str], Case],
    capfd: pytest.CaptureFixture,
    example: str,
    *,
    parallel: bool,
    told: str | None,
) -> None:
    """The controller says once that the readings fit another delay, and nothing where the coupling is right.

    promise: wrong-delay
    """
    case = example_case(example)
    fmu_loop.run(case.fmus, 900, fmu_loop.Schedule(parallel=parallel))
    heard = capfd.readouterr().out
    assert heard.count("of delay in the loop than the design allows for") == (told is not None)
    assert (told or "") in heard
