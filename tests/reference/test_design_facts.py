"""What a finished design claims, recomputed from the plant and the shipped gains alone."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov

import commands
import design_file
import record
from synthesis import Augmented, Task, augment, closed_loop

if TYPE_CHECKING:
    from pathlib import Path

WEIGHTS = (1.0, 0.3, 0.1)


@dataclass(frozen=True)
class Finished:
    """A design: the request, the report and the record that is shipped."""

    request: dict
    report: dict
    record: dict

    @property
    def modes(self) -> list[record.Mode]:
        """The plant's modes."""
        return record.modes(self.record)

    def loops(self, weights: tuple[float, float, float] = WEIGHTS) -> list[Augmented]:
        """Returns the closed loop of each mode, with B and D zero, made from the shipped gains."""
        feedback = self.record["controller"]["feedback"]
        task = Task(
            [vars(mode) for mode in self.modes],
            record.sample_time(self.record),
            feedback["tracked"],
            feedback["latency"],
            self.report["lyapunov"],
            self.report["decay"],
            weights,
        )
        gains = [
            np.hstack([np.array(mode[key]) for key in ("state_feedback", "previous_input", "integral")])
            for mode in feedback["modes"]
        ]
        return [closed_loop(augment(task, mode), gain) for mode, gain in zip(task.modes, gains, strict=True)]


@pytest.fixture(scope="module", params=["state", "output"])
def finished(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """Returns scenario A designed with the model's own predictor, the disturbance on either channel."""
    design = design_file.scenario_a(disturbed=request.param)
    design["estimator"]["database"] = "model"
    design["observer"]["kind"] = "uio" if request.param == "state" else "luenberger"
    folder: Path = tmp_path_factory.mktemp(request.param)
    path = design_file.write(design, folder)
    report = json.loads(commands.ftc_fmu("design", path, "--json"))
    return Finished(design, report, record.load(commands.export(path, folder).controller))


def test_model_predictor_is_the_markov_parameters(finished: Finished) -> None:
    """Y1 U1+ = [C A^(j-1) B ... C A B, C B], oldest input first."""
    estimator = finished.record["controller"]["estimator"]
    for mode, predictor in zip(finished.modes, estimator["predictors"], strict=True):
        powers = [np.linalg.matrix_power(mode.A, lag) for lag in range(estimator["response_length"])]
        markov = np.hstack([mode.C @ power @ mode.B for power in reversed(powers)])
        np.testing.assert_allclose(predictor["response"], markov, rtol=1e-12, atol=1e-15)


def test_what_the_predictor_leaves_out_is_negligible(finished: Finished) -> None:
    """After j samples the response has decayed to 1e-7 of itself."""
    length = finished.record["controller"]["estimator"]["response_length"]
    for mode in finished.modes:
        rest = mode.C @ np.linalg.matrix_power(mode.A, length)
        assert np.linalg.norm(rest) <= 1e-7 * np.linalg.norm(mode.C)


def test_decoupling_gain(finished: Finished) -> None:
    """H = E (C E)+ with the E of the mode left and the C of the mode entered; none for an output disturbance."""
    observer = finished.record["controller"]["observer"]
    for i, left in enumerate(finished.modes):
        for j, entered in enumerate(finished.modes):
            H = left.E @ np.linalg.pinv(entered.C @ left.E)
            np.testing.assert_allclose(observer["decoupling"][i][j], H, rtol=1e-12, atol=1e-15)
    kind = "uio" if any(mode.E.any() for mode in finished.modes) else "luenberger"
    assert observer["kind"] == kind


def test_state_disturbance_never_reaches_the_estimate(finished: Finished) -> None:
    """T E = 0 on every switch: the unknown input observer's purpose."""
    observer = finished.record["controller"]["observer"]
    for i, left in enumerate(finished.modes):
        for j, entered in enumerate(finished.modes):
            T = np.eye(len(left.A)) - np.array(observer["decoupling"][i][j]) @ entered.C
            np.testing.assert_allclose(T @ left.E, 0.0, atol=1e-15)


def test_observer_error_decays(finished: Finished) -> None:
    """The error dynamics T A - K C of each mode are faster than the decay asked for."""
    observer = finished.record["controller"]["observer"]
    for i, mode in enumerate(finished.modes):
        T = np.eye(len(mode.A)) - np.array(observer["decoupling"][i][i]) @ mode.C
        F = T @ mode.A - np.array(observer["gains"][i]) @ mode.C
        assert np.abs(np.linalg.eigvals(F)).max() < finished.request["observer"]["decay"]


def test_spectral_radius(finished: Finished) -> None:
    """The closed loop's eigenvalues lie within the decay asked for, and the report tells them right."""
    radii = [np.abs(np.linalg.eigvals(loop.A)).max() for loop in finished.loops()]
    assert max(radii) < finished.request["controller"]["decay"]
    np.testing.assert_allclose(finished.report["spectral_radius"], radii, rtol=1e-6)


def _step_cost(loop: Augmented, move: np.ndarray, asked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns P of the cost d' P d of a distance d from rest, and where a unit step of each reference comes to rest."""
    P = solve_discrete_lyapunov(loop.A.T, loop.H.T @ loop.H)
    return P, np.linalg.solve(np.eye(len(loop.A)) - loop.A, move + asked)


def test_feedforward_costs_least(finished: Finished) -> None:
    """No other feedforward N follows a step of the reference at less cost of tracking error and command."""
    feedback = finished.record["controller"]["feedback"]
    te, tracked = record.sample_time(finished.record), feedback["tracked"]
    weights = (WEIGHTS[0], 0.0, WEIGHTS[2])
    loops = zip(finished.modes, feedback["modes"], finished.loops(weights), strict=True)
    for mode, gains, loop in loops:
        n, r = len(mode.A), len(tracked)
        N = np.array(gains["feedforward"])
        B = np.vstack([mode.B, np.zeros((r, mode.B.shape[1]))])
        R = np.vstack([np.zeros((n, r)), te * np.eye(r)])

        def cost(N: np.ndarray, loop: Augmented = loop, B: np.ndarray = B, R: np.ndarray = R) -> float:
            P, rest = _step_cost(loop, B @ N, R)
            return float(np.trace(rest.T @ P @ rest))

        least = cost(N)
        rng = np.random.default_rng(1)
        assert all(cost(N + 1e-3 * rng.standard_normal(N.shape)) > least for _ in range(50))
        assert cost(0.0 * N) > 2.0 * least


def test_attenuation_by_frequency_sweep(finished: Finished) -> None:
    """The largest gain from disturbance to performance signal over all frequencies is within the promised gamma."""
    for loop, gamma in zip(finished.loops(), finished.report["gamma"], strict=True):
        peak = max(
            np.linalg.norm(loop.H @ np.linalg.solve(z * np.eye(len(loop.A)) - loop.A, loop.E), 2)
            for z in np.exp(1j * np.linspace(0.0, np.pi, 4001))
        )
        assert 0.0 < peak <= gamma


def _in_certificate_coordinates(loop: Augmented, units: dict, basis: np.ndarray, latency: int) -> Augmented:
    """Returns a closed loop in the certificate's units and the coordinates of its Lyapunov factor."""
    state = np.array([*units["states"], *(units["inputs"] * latency), *units["integrators"]])
    L = state[:, None] * basis
    w, v = units["disturbance"], units["performance"]
    return Augmented(np.linalg.solve(L, loop.A @ L), loop.B, np.linalg.solve(L, loop.E) * w, loop.H @ L / v, loop.D)


def _least_eigenvalue(block: np.ndarray) -> float:
    """Returns the least eigenvalue of a symmetric matrix brought to a unit diagonal, which keeps its sign."""
    scale = 1.0 / np.sqrt(np.diag(block))
    return float(np.linalg.eigvalsh(block * np.outer(scale, scale)).min())


def test_state_feedback_certificate(finished: Finished) -> None:
    """Every inequality (T2) of the shipped gains is positive definite with the shipped S = L M L'."""
    proved = finished.record["proof"]["state_feedback"]
    units = proved["certificate"]["units"]
    ((basis, S),) = ((np.array(f["basis"]), np.array(f["core"])) for f in proved["certificate"]["lyapunov"])
    latency = finished.record["controller"]["feedback"]["latency"]
    for loop, level in zip(finished.loops(), finished.report["gamma"], strict=True):
        model = _in_certificate_coordinates(loop, units, basis, latency)
        (N, s), q = model.E.shape, len(model.H)
        g = (level * units["disturbance"] / units["performance"]) ** 2
        zero = np.zeros
        attenuation = np.block(
            [
                [S, zero((N, s)), (model.A @ S).T, (model.H @ S).T],
                [zero((s, N)), g * np.eye(s), model.E.T, zero((s, q))],
                [model.A @ S, model.E, S, zero((N, q))],
                [model.H @ S, zero((q, s)), zero((q, N)), np.eye(q)],
            ]
        )
        decay = np.block([[finished.report["decay"] ** 2 * S, (model.A @ S).T], [model.A @ S, S]])
        assert _least_eigenvalue(attenuation) > 0.0
        assert _least_eigenvalue(decay) > 0.0
    assert finished.report["certified"]


def test_observer_certificate(finished: Finished) -> None:
    """On every switch the estimation error shrinks in the shipped P: beta^2 P - F' P F is positive definite."""
    observer = finished.record["controller"]["observer"]
    certificate = finished.record["proof"]["observer"]["certificate"]
    units = np.array(certificate["states"])
    (P,) = (np.array(P) / np.outer(units, units) for P in certificate["lyapunov"])
    beta = finished.request["observer"]["decay"]
    for i, left in enumerate(finished.modes):
        for j, entered in enumerate(finished.modes):
            T = np.eye(len(left.A)) - np.array(observer["decoupling"][i][j]) @ entered.C
            F = T @ left.A - np.array(observer["gains"][i]) @ left.C
            assert _least_eigenvalue(np.block([[beta**2 * P, F.T @ P], [P @ F, P]])) > 0.0
