"""The loop in several masters that step both FMUs at once: one sample of delay, designed for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import sizes

import masters

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Case

SAME = {"rtol": 1e-12, "atol": 1e-12}
EACH_MASTER = pytest.mark.parametrize("master", masters.ALL)


def _assert_native(loop: masters.Loop, case: Case) -> None:
    """After step k a master holds the command of tick k and the measurement of tick k + 1."""
    native = case.run.trajectories
    steps = len(loop["u"])
    np.testing.assert_allclose(loop["u"], native["ftc.u"][:steps], **SAME)
    np.testing.assert_allclose(loop["y"], native["ftc.y"][1 : steps + 1], **SAME)


@EACH_MASTER
def test_the_paper_with_one_sample_of_delay(example_case: Callable[[str], Case], master: str) -> None:
    """Every master gives the native run of the design that allows for the delay.

    promise: other-masters
    promise: ssp-package
    """
    case = example_case("paper_latency")
    _assert_native(masters.ALL[master](case.fmus, case.run.trajectories.ticks - 1), case)


@pytest.mark.parametrize("of", sizes.ALL, ids=str)
def test_designs_of_all_sizes(make_case: Callable[[dict], Case], of: sizes.Sizes) -> None:
    """The toolbox finds nothing to say against ten pairs of all sizes, and every master runs them.

    promise: other-masters
    """
    case = make_case(sizes.design(of, latency=1))
    assert masters.toolbox_errors(case.fmus.controller) == []
    assert masters.toolbox_errors(case.fmus.plant) == []
    for run in masters.ALL.values():
        _assert_native(run(case.fmus, case.run.trajectories.ticks - 1), case)


def test_the_delay_is_harmless_where_it_was_designed_for(example_case: Callable[[str], Case]) -> None:
    """The true outputs follow their references as well as in the native run, to within 5 %.

    promise: other-masters
    """
    case = example_case("paper_latency")
    native = case.run.trajectories
    loop = masters.run_fmpy(case.fmus, native.ticks, masters.Schedule(parallel=True))

    def error(y_true: np.ndarray, y_ref: np.ndarray) -> np.ndarray:
        return ((y_ref - y_true) ** 2).mean(axis=0)

    ours = error(loop["y_true"], loop["y_ref"])
    assert np.all(ours <= 1.05 * error(native["ftc.y_true"], native["y_ref"]))
    assert np.all(ours < 0.1 * native["y_ref"].var(axis=0))


def test_a_delay_that_was_not_designed_for_costs(example_case: Callable[[str], Case]) -> None:
    """The design without delay, stepped in parallel, does worse than it was designed to.

    promise: other-masters
    """
    case = example_case("paper")
    loop = masters.run_fmpy(case.fmus, case.run.trajectories.ticks, masters.Schedule(parallel=True))
    native = case.run.trajectories

    def error(y_true: np.ndarray) -> np.ndarray:
        return ((native["y_ref"] - y_true) ** 2).mean(axis=0)

    designed_for = error(native["ftc.y_true"])
    assert np.all(error(loop["y_true"]) > designed_for)
    assert np.all(designed_for < 0.1 * error(np.zeros_like(native["y_ref"])))
