"""Plants from what control engineers hold."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

import control
import ftc_fmu as ftc

A = [[-0.3, 1.0], [-0.5, -0.2]]
B = [[0.0, 0.2], [1.0, 0.1]]
C = [[1.0, 0.0]]
D = [[0.0, 0.0]]


def matrices(plant: ftc.Plant) -> list[np.ndarray]:
    """All matrices of the first mode."""
    mode = plant.modes[0]
    return [mode.A, mode.B, mode.C, mode.D, mode.E, mode.F]


@pytest.mark.parametrize(
    "system",
    [
        control.ss(A, B, C, D),
        scipy.signal.StateSpace(A, B, C, D),
        (A, B, C, D, 0),
        (np.array(A), np.array(B), np.array(C), np.array(D), None),
    ],
    ids=["control", "scipy", "arrays", "arrays of scipy"],
)
def test_continuous_models_are_discretised_exactly(system: object) -> None:
    """Every source gives scipy's zero-order hold."""
    plant = ftc.Plant(system, sample_time=0.5, disturbance_inputs=[1])
    Ad, Bd, *_ = scipy.signal.cont2discrete((np.array(A), np.array(B), np.array(C), np.array(D)), 0.5)
    for found, expected in zip(matrices(plant), [Ad, Bd[:, :1], C, [[0.0]], Bd[:, 1:], [[0.0]]], strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize(
    "system",
    [
        control.ss(A, B, C, D, 0.5),
        control.ss(A, B, C, D, True),  # noqa: FBT003  (python-control's word for an unsaid sample time)
        scipy.signal.StateSpace(A, B, C, D, dt=0.5),
        (A, B, C, D, 0.5),
        (A, B, C),
    ],
    ids=["control", "control without a time", "scipy", "arrays", "three arrays"],
)
def test_discrete_models_stay_as_they_are(system: object) -> None:
    """Nothing is done to a model that has the sample time."""
    for found, expected in zip(matrices(ftc.Plant(system, 0.5))[:3], [A, B, C], strict=True):
        np.testing.assert_array_equal(found, expected)


def test_several_models_in_a_tuple() -> None:
    """Are modes, as in a list; numbers of things are said as people say them."""
    model = control.ss(A, B, C, D)
    assert repr(ftc.Plant((model, model), 0.5)) == (
        "<ftc_fmu.Plant: 2 modes, 2 states, 2 inputs, 1 output, 0 disturbances, 0.5 s>"
    )


def test_a_single_disturbance_needs_no_list() -> None:
    """By its column or its name, which the first model gives to those that have none."""
    named = control.ss(A, B, C, D, inputs=["pump", "rain"])
    for disturbance in (1, np.int64(1), "rain", ["rain"]):
        plant = ftc.Plant([named, control.ss(A, B, C, D)], 0.5, disturbance)
        assert [mode.E.shape for mode in plant.modes] == [(2, 1), (2, 1)]
        assert plant.signals["inputs"] == [{"name": "pump"}]


def test_modes_of_other_signals_are_refused() -> None:
    """Of another number, or in another order, of inputs, outputs or states."""
    model = control.ss(A, B, C, D, inputs=["pump", "rain"])
    turned = control.ss(A, B, C, D, inputs=["rain", "pump"])
    with pytest.raises(ftc.DesignFileError, match=r"systems\[1\] has the inputs rain, pump, systems\[0\] pump, rain"):
        ftc.Plant([model, turned], 0.5)
    with pytest.raises(ftc.DesignFileError, match=r"systems\[1\] has 1 states, 1 inputs and 1 outputs, systems"):
        ftc.Plant([model, control.ss(-1, 1, 1, 0)], 0.5)
    with pytest.raises(ftc.DesignFileError, match="outputs is 'level': give a list with an entry per signal"):
        ftc.Plant(model, 0.5, outputs="level")


def test_a_transfer_function_is_told_how_to_become_a_state_space() -> None:
    """Of either package."""
    for transfer in (control.tf([1], [1, 1]), scipy.signal.TransferFunction([1], [1, 1])):
        with pytest.raises(ftc.DesignFileError, match=r"control\.ss\(\.\.\.\) and \.to_ss\(\)"):
            ftc.Plant([transfer], 0.5)


def test_names_of_the_model_are_kept() -> None:
    """Labels that a person gave become names, and a disturbance may be named."""
    system = control.ss(A, B, C, D, inputs=["valve", "wind"], outputs=["speed"], states=["speed", "torque"])
    plant = ftc.Plant([system, system], 0.5, disturbance_inputs=["wind"])
    assert plant.signals == {
        "inputs": [{"name": "valve"}],
        "outputs": [{"name": "speed"}],
        "states": [{"name": "speed"}, {"name": "torque"}],
        "disturbances": [{"name": "wind"}],
    }
    assert plant.modes[1].E.shape == (2, 1)


@pytest.mark.parametrize(
    ("arguments", "key", "says"),
    [
        (((A, B, [[1.0]], D), 0.5), "C", "C is 1 x 1: beside the other matrices it must be 1 x 2"),
        (((A, np.ones((3, 2)), C), 0.5), "B", "B is 3 x 2: beside the other matrices it seems to be transposed"),
        (((A, B, C, D, 0.25), 0.5), "sample_time", "0.25 s"),
        (((A, B, C, D), -1.0), "sample_time", "positive"),
        (((A, [[0.0], [np.nan]], C), 0.5), "B", "no finite number"),
        ((3.0, 0.5), "systems[0]", "type float"),
        ((("a", B, C), 0.5), "A", "no array of numbers"),
        (((A, np.array(B) + 1j, C), 0.5), "B", "complex entries: give real numbers"),
        (((A, B, C, D, "fast"), 0.5), "dt", "no array of numbers"),
        (((A, B, C, D, -1.0), 0.5), "dt", "or 0 for a continuous model"),
        (((np.ones((2, 2, 2)), B, C), 0.5), "A", "3 dimensions"),
        (((A, B, C), "fast"), "sample_time", "positive number of seconds"),
        ((([[300.0]], [[1.0]], [[1.0]], 0, 0), 10.0), "sample_time", "systems[0]: the model grows"),
    ],
)
def test_what_does_not_fit_is_said(arguments: tuple, key: str, says: str) -> None:
    """One sentence, and the key."""
    with pytest.raises(ftc.DesignFileError, match=r".") as refused:
        ftc.Plant(*arguments)
    assert says in str(refused.value)
    assert refused.value.key == key


@pytest.mark.parametrize("key", ["inputs", "outputs", "states"])
def test_a_signal_is_a_name_or_a_dictionary(key: str) -> None:
    """And nothing else: the entry is named."""
    with pytest.raises(ftc.DesignFileError, match="give a name, or a dictionary") as refused:
        ftc.Plant((A, B, C, D, 0), 0.5, **{key: ["sound", 2]})
    assert refused.value.key == f"signals.{key}[2]"


def test_disturbances_that_are_not_there_are_refused() -> None:
    """By number and by name."""
    with pytest.raises(ftc.DesignFileError, match="column 2, B has columns 0 to 1"):
        ftc.Plant((A, B, C, D, 0), 0.5, disturbance_inputs=[2])
    with pytest.raises(ftc.DesignFileError, match="names a column twice"):
        ftc.Plant((A, B, C, D, 0), 0.5, disturbance_inputs=[1, 1])
    with pytest.raises(ftc.DesignFileError, match='no input "wind"'):
        ftc.Plant((A, B, C, D, 0), 0.5, disturbance_inputs=["wind"])


def test_a_disturbance_of_plain_arrays_has_a_name() -> None:
    """Where `inputs` names every column, commands and disturbances are told apart by name or number."""
    named = {"inputs": ["valve", {"name": "wind", "unit": "m/s"}], "disturbance_inputs": ["wind"]}
    plant = ftc.Plant((A, B, C, D, 0), 0.5, **named)
    assert plant.signals["inputs"] == [{"name": "valve"}]
    assert plant.signals["disturbances"] == [{"name": "wind", "unit": "m/s"}]
    counted = ftc.Plant((A, B, C, D, 0), 0.5, inputs=["valve"], disturbance_inputs=[1])
    np.testing.assert_array_equal(plant.modes[0].E, counted.modes[0].E)
    np.testing.assert_array_equal(plant.modes[0].B, counted.modes[0].B)
    with pytest.raises(ftc.DesignFileError, match=r'no input "wand" .valve, wind.'):
        ftc.Plant((A, B, C, D, 0), 0.5, inputs=["valve", "wind"], disturbance_inputs=["wand"])
