"""Poles that follow from theta and the time between samples."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from examples import Block, chain, findings, inline, simulated
from scipy.linalg import expm, solve_discrete_lyapunov

from hgorun import Experiment
from hgorun.analysis.convergence.gains import error_dynamics
from hgorun.analysis.report import analyze
from hgorun.errors import ConfigError
from hgorun.explore.knobs import knobs_of
from hgorun.observers.sampled_poles import damping
from hgorun.simulation.preparation.preparation import prepare


def config(observer: Block, plant: Block | None = None) -> dict[str, Any]:
    time = {"end": 1, "output_step": 0.1}
    return {"time": time, "plant": plant or chain(2), "observers": {"S": {"type": "shgo", **observer}}}


@pytest.mark.parametrize(
    ("theta", "T", "zeta"),
    [(4, 0.1, 1.2 / np.sqrt(2)), (8, 0.2, 1.1), (5, 0.6, 1.5), (5, 2.0, 1.8), (1, 1e-9, 1 / np.sqrt(2))],
)
def test_the_error_is_that_of_these_poles(theta: float, T: float, zeta: float) -> None:
    """Of a double integrator that is measured continuously."""
    result = simulated(chain(2), {"S": {"type": "shgo", "theta": theta, "poles_for_period": T}}, step=0.002)
    matrix = np.array([[-2 * zeta * theta, 1], [-(theta**2), 0]])
    error = result.observers["S"].xhat - result.x
    expected = np.array([expm(matrix * t) @ error[0] for t in result.time])
    np.testing.assert_allclose(error, expected, rtol=0, atol=1e-6)


def test_it_is_the_best_damping_of_the_velocity() -> None:
    """The law of the docstring: within 2 % of the smallest error between samples, at the theta of the position.

    White noise of density 1 accelerates; samples every T = 1 have the variance r. The error is (x_1, x_2, e), e' =
    -theta g_1 e, and at a sample e becomes x_1 and noise.
    """
    reset, noisy = np.array([[1.0, 0, 0], [0, 1, 0], [1, 0, 0]]), np.diag([0.0, 0, 1])

    def flow(A: np.ndarray, s: float) -> tuple[np.ndarray, np.ndarray]:
        both = expm(np.block([[-A, np.diag([0.0, 1, 0])], [np.zeros((3, 3)), A.T]]) * s)  # Van Loan
        F = both[3:, 3:].T
        return F, F @ both[:3, 3:]

    def errors(theta: float, zeta: float, r: float) -> np.ndarray:
        g = np.array([2 * zeta * theta, theta**2])
        A = np.array([[0, 1, -g[0]], [0, 0, -g[1]], [0, 0, -g[0]]])
        F, Q = flow(A, 1.0)
        if np.max(np.abs(np.linalg.eigvals(F @ reset))) >= 1:
            return np.full(2, np.inf)
        after = reset @ solve_discrete_lyapunov(F @ reset, F @ (r * noisy) @ F.T + Q) @ reset.T + r * noisy
        between = [F @ after @ F.T + Q for F, Q in (flow(A, s) for s in (0.2, 0.4, 0.6, 0.8))]
        return np.sqrt(np.diag(np.mean(between, axis=0))[:2])

    for r, thetas in ((3.0, (0.8, 1.2)), (30.0, (0.4, 0.55)), (1000.0, (0.14, 0.21))):
        of_zeta, chosen = {}, {}
        for zeta in (0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.3):
            found = {theta: errors(theta, zeta, r) for theta in np.linspace(*thetas, 7)}
            theta = min(found, key=lambda one: found[one][0])
            of_zeta[zeta], chosen[zeta] = found[theta][1], theta
        rule = damping(chosen[0.9])
        nearest = min(of_zeta, key=lambda zeta: abs(zeta - rule))
        assert of_zeta[nearest] <= 1.02 * min(of_zeta.values())


def test_a_sweep_of_theta_has_the_poles_of_each() -> None:
    """Poles are not written beside the key, and the matrix of the linear theory is that at its own theta."""
    base = Experiment(config({"theta": 4, "poles_for_period": 0.1}))
    for theta in (2.0, 8.0, 40.0):
        design = base.design_with("S", {"observers.S.theta": theta})
        assert "poles" not in design.observer.model_dump(exclude_none=True)
        matrix, zeta = error_dynamics(design.observer, design.form).A, damping(theta * 0.1)
        expected = np.array([[-2 * zeta, 1.0], [-1.0, 0.0]])
        np.testing.assert_allclose(matrix, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("other", [{"poles": -1}, {"gains": [2, 1]}])
def test_one_key_decides(other: Block) -> None:
    with pytest.raises(ConfigError, match=r"observers\.S: give only one of poles, gains and poles_for_period"):
        Experiment(config({"theta": 4, "poles_for_period": 0.1, **other}))


def test_only_for_chains_of_two_states() -> None:
    said = r"observers\.S\.poles_for_period: only for chains of two states; here a chain has 3: give poles"
    with pytest.raises(ConfigError, match=said):
        prepare(Experiment(config({"theta": 4, "poles_for_period": 0.1}, chain(3))))


@pytest.mark.parametrize(
    ("block", "expected"),
    [({"theta": 4, "poles_for_period": 0.1}, 0), ({"theta": 4, "gains": [2, 1]}, 0), ({"theta": 4}, 1)],
)
def test_a_live_page_varies_poles_where_they_decide(block: Block, expected: int) -> None:
    names = [knob.name for knob in knobs_of(Experiment(config(block)))]
    assert len([name for name in names if "poles" in name and "period" not in name]) == expected


@pytest.mark.costly
@pytest.mark.parametrize(
    ("theta", "period", "delay", "T"), [(20, 0.02, 0.6, 0.4), (60, 0.2, 0.0, 0.02), (60, 0.2, 0.0, 0.5)]
)
def test_what_is_advised_once_holds(theta: float, period: float, delay: float, T: float) -> None:
    """The theta that is told is with the poles that belong to it."""
    plant = inline({"x1": "x2", "x2": "-x1"}, "x1") | {"initial": {"x1": 1, "x2": 0}}
    more: Block = {"measurement": {"sampling": {"period": period}, "delay": delay}, "end": 60, "output_step": 0.05}

    def found(theta: float) -> Any:
        observer: Block = {"type": "shgo", "theta": theta, "poles_for_period": T, "initial": {"x1": 0.5, "x2": 0}}
        return simulated(plant, {"S": observer}, **more).observers["S"]

    said = re.search(r"theta of at most ([0-9.]+)", found(theta).reason or "")
    assert said is not None
    assert float(said[1]) * (period + delay) > 1  # not so small that anything would do
    assert found(float(said[1])).status == "ok"


@pytest.mark.parametrize(("block", "expected"), [({"poles_for_period": 0.1}, 1), ({"poles": -1}, 0)])
def test_the_bound_on_theta_is_said_to_be_with_the_present_poles(block: Block, expected: int) -> None:
    wanted = [one for one in findings("convergence") if one.name == "theta_bound"]
    found = analyze(Experiment(config({"theta": 4, **block})), wanted).observers["S"]
    assert found.values["theta_bound"] == 1  # phi = 0: no slope has to be overcome
    assert len([one for one in found.remarks if one.startswith("theta_bound is with the poles at")]) == expected


def test_a_chain_at_a_speed_has_the_poles_of_its_own_theta() -> None:
    """As fast as an observer with a quarter of theta: theta T = 1 of the one and 0.25 of the other chain."""
    two = inline({"a": "a2", "a2": "0", "b": "b2", "b2": "0"}, {"y_a": "a", "y_b": "b"})
    block: Block = {"type": "shgo", "theta": 10, "poles_for_period": 0.1, "speed": {"y_b": 0.25}}
    result = simulated(two, {"S": block}, step=0.005)
    start = (result.observers["S"].xhat - result.x)[0]
    for place, theta in ((0, 10.0), (2, 2.5)):
        zeta = min(1.1, (1 + theta * 0.1 / 2) / np.sqrt(2))
        matrix = np.array([[-2 * zeta * theta, 1], [-(theta**2), 0]])
        expected = np.array([expm(matrix * t) @ start[place : place + 2] for t in result.time])
        error = (result.observers["S"].xhat - result.x)[:, place : place + 2]
        np.testing.assert_allclose(error, expected, rtol=0, atol=1e-5)
