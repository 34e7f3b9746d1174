"""Conditions of the observers by forward differences and by stochastic approximation."""

from typing import Any

import numpy as np
import pytest
from examples import experiment

from hgorun import Experiment
from hgorun.analysis.papers.lee import LeeConditions, lee_conditions
from hgorun.analysis.reasons import NoValue
from hgorun.simulation.simulate import prepare, simulate_prepared

SA = {"type": "hgo_sa", "eps": 0.01, "gains": [2, 2]}
FD = {"type": "hgo_fd", "eps": 0.01, "gains": [2, 2]}
UNIFORM = [{"type": "uniform", "low": -0.5, "high": 0.5}]
STEPS = {"steps": "0.0004/(1 + k/20000)"}


def example(observer: dict[str, Any], sampling: dict[str, Any], noise: list[Any], end: float = 2.0) -> Experiment:
    plant = {"type": "lee_second_order", "discretise": "euler", "initial": {"x1": 10, "x2": 10}}
    measurement = {"sampling": sampling, "noise": noise}
    return experiment(plant, {"o": observer}, end=end, output_step=min(0.01, end / 10), measurement=measurement)


def conditions(config: Experiment) -> LeeConditions:
    run = prepare(config)
    found = lee_conditions(run, "o", simulate_prepared(run))
    assert isinstance(found, LeeConditions)
    return found


def test_the_papers_example() -> None:
    found = conditions(example(SA, STEPS, UNIFORM))
    A_0 = np.array([[-2.0, 1.0], [-2.0, 0.0]])
    assert found.alpha == pytest.approx(0.04)
    assert found.alpha_exact == pytest.approx(1.0)  # -2 Re/|lambda|^2 of -1 +- j
    assert found.radius == pytest.approx(np.sqrt(0.96**2 + 0.04**2))
    # A_0^T P + P A_0 = -I by hand: P = [[3/4, -1/2], [-1/2, 7/8]]
    P = np.array([[0.75, -0.5], [-0.5, 0.875]])
    np.testing.assert_allclose(A_0.T @ P + P @ A_0, -np.eye(2), atol=1e-15)
    norm_A, norm_P = (np.sqrt(np.linalg.eigvalsh(M.T @ M)[-1]) for M in (A_0, P))
    assert found.alpha_sufficient == pytest.approx(1 / (norm_A**2 * norm_P))
    assert found.exponent == pytest.approx(1, abs=1e-3)
    assert all(c.holds for c in (found.A1, found.A2, found.A3, found.A4))
    assert found.measured is not None
    assert found.bound is not None
    assert 5 < found.measured <= found.bound


def test_one_matrix_solves_36_for_every_step() -> None:
    found = conditions(example(SA, STEPS, UNIFORM, 0.1))
    A_0, P = np.array([[-2.0, 1.0], [-2.0, 0.0]]), found.P
    assert P is not None
    assert np.linalg.eigvalsh(P)[0] > 0
    for b in np.geomspace(1e-6, 1, 50):
        a = 0.04 * b
        closed = np.eye(2) + a * A_0
        left = closed.T @ P @ closed - P
        np.testing.assert_allclose(left, a * (A_0.T @ P + P @ A_0 + a * A_0.T @ P @ A_0), atol=1e-15)
        # c(k) = a_k, so that no one c > 0 serves all k
        assert np.linalg.eigvalsh(left)[-1] <= -a * (1 - 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("period", [0.0004, 0.006, 0.0095])
def test_bounded_input_bounded_state(period: float) -> None:
    """The worst of many inputs of modulus 1, with steps that stay and steps that fall."""
    found = conditions(example(FD, {"period": period}, [], 0.1))
    assert found.gain is not None
    assert found.growth is not None
    A_0, H_0 = np.array([[-2.0, 1.0], [-2.0, 0.0]]), np.array([2.0, 2.0])
    generator = np.random.default_rng(1)
    largest = 0.0
    for fall in (0.0, 0.5, 1.0):
        a = period / 0.01 / (1 + np.arange(3000) / 100) ** fall
        # the input that points along the state, from a rotating direction, and random ones
        for turn in np.linspace(0, np.pi, 16):
            q, v = np.zeros(2), np.array([np.cos(turn), np.sin(turn)])
            for step in a:
                q = q + step * (A_0 @ q + H_0 * np.sign(v @ q + generator.normal(scale=0.01)))
                largest = max(largest, float(np.linalg.norm(q)))
    assert 0.15 * found.gain < largest <= found.gain
    # from q(0) without input
    q = np.array([1.0, -1.0])
    for _ in range(500):
        q = q + period / 0.01 * A_0 @ q
        assert np.linalg.norm(q) <= found.growth * np.sqrt(2)


def test_beyond_the_bound() -> None:
    found = conditions(example(FD, {"period": 0.0101}, [], 1.0))
    assert found.radius > 1
    assert found.P is None
    assert found.bound is None
    assert not found.A4.holds
    assert "spectral radius" in found.A4.why


def test_the_steps() -> None:
    assert not conditions(example(FD, {"period": 4e-4}, UNIFORM, 0.1)).A2.holds
    slow = conditions(example(FD, {"steps": "4e-4/(1 + k)**0.4"}, UNIFORM, 0.01)).A2
    assert not slow.holds
    assert "k^-0.4" in slow.why
    fast = conditions(example(FD, {"steps": "4e-4/(1 + k)**1.5"}, UNIFORM, 1e-3)).A2
    assert not fast.holds
    assert "stops before it has converged" in fast.why
    assert conditions(example(SA, {"steps": "4e-4/(1 + k)**0.7"}, UNIFORM, 0.01)).A2.holds


def test_the_noise() -> None:
    def a3(noise: list[Any]) -> bool | None:
        return conditions(example(FD, {"period": 4e-4}, noise, 0.1)).A3.holds

    assert a3([])
    assert a3([{"type": "gaussian", "std": 0.1}])
    assert not a3([{"type": "uniform", "low": 0, "high": 1}])
    assert not a3([{"type": "gaussian", "std": 0.1, "hold": 0.01}])
    assert not a3([{"type": "sinusoids", "terms": [{"amplitude": 1, "omega": 100}]}])


def test_the_lipschitz_constant() -> None:
    """(26): at x_1 = 0 the spring is stiffest; the observer's part dominates, norm of [[H_0 C, A_0]]/eps about."""
    found = conditions(example(FD, {"period": 4e-4}, [], 20.0))
    J = np.zeros((4, 4))
    J[:2, :2] = [[0, 1], [-1, -1]]
    J[2:, 0] = [200, 200]
    J[2:, 2:] = 100 * np.array([[-2.0, 1.0], [-2.0, 0.0]])
    assert found.lipschitz == pytest.approx(np.linalg.norm(J, 2), rel=1e-3)


def test_other_observers() -> None:
    plant = {"type": "lee_second_order", "initial": {"x1": 10, "x2": 10}}
    run = prepare(experiment(plant, {"o": {"type": "shgo", "theta": 1}}, measurement={"sampling": {"period": 0.1}}))
    with pytest.raises(NoValue, match="the conditions are for"):
        lee_conditions(run, "o", simulate_prepared(run))
