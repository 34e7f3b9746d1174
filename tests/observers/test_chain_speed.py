"""Chains of several outputs at speeds of their own, against exact errors: the matrix exponential of each chain."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, experiment, inline, simulated
from scipy.linalg import expm

from hgorun.analysis.convergence.gains import error_dynamics
from hgorun.analysis.linear.nominal import chain
from hgorun.errors import ConfigError
from hgorun.simulation.preparation.preparation import prepare

TWO = inline({"a": "a2", "a2": "0", "b": "b2", "b2": "0"}, {"y_a": "a", "y_b": "b"})
THETA, SPEED = 4.0, 0.5
TIMES = np.arange(0, 1.01, 0.1)


def errors(matrix: np.ndarray, start: np.ndarray, places: list[int]) -> np.ndarray:
    """Estimate minus truth of some components of a linear error, a row for each time."""
    return np.array([(expm(matrix * t) @ start)[places] for t in TIMES])


@pytest.mark.parametrize(("place", "theta"), [(0, THETA), (2, THETA * SPEED)])
def test_the_standard_observer_has_another_theta_for_a_chain(place: int, theta: float) -> None:
    """Poles -1 and -3: g = (4, 3)."""
    block: Block = {"type": "shgo", "theta": THETA, "poles": [-1, -3], "speed": {"y_b": SPEED}}
    result = simulated(TWO, {"S": block}, step=0.005)
    matrix = np.array([[-4 * theta, 1], [-3 * theta**2, 0]])
    found = (result.observers["S"].xhat - result.x)[:, place : place + 2]
    np.testing.assert_allclose(found, errors(matrix, np.array([-0.5, -0.5]), [0, 1]), rtol=0, atol=1e-6)


@pytest.mark.parametrize(("place", "theta"), [(0, THETA), (2, THETA * SPEED)])
def test_so_has_its_filter(place: int, theta: float) -> None:
    """r = 1, poles -1: eta' = theta (-3 eta + e), e_1' = e_2 - 3 theta eta, e_2' = -theta^2 eta.

    eta of the chain is that of an observer with theta = 2 at another scale, which its zero start hides.
    """
    block: Block = {"type": "fhgo2", "r": 1, "theta": THETA, "speed": {"y_b": SPEED}}
    result = simulated(TWO, {"F": block}, step=0.005)
    matrix = np.array([[-3 * theta, theta, 0], [-3 * theta, 0, 1], [-(theta**2), 0, 0]])
    found = (result.observers["F"].xhat - result.x)[:, place : place + 2]
    np.testing.assert_allclose(found, errors(matrix, np.array([0, -0.5, -0.5]), [1, 2]), rtol=0, atol=1e-6)


def test_an_output_that_there_is_not() -> None:
    with pytest.raises(ConfigError, match=r"speed\.a: no output of the plant; there are y_a, y_b"):
        simulated(TWO, {"S": {"type": "shgo", "theta": 4, "speed": {"a": 2}}})


def test_steps_are_short_enough_for_the_fastest_chain() -> None:
    """Without a step given the estimate is as accurate as is asked for."""
    result = simulated(TWO, {"S": {"type": "shgo", "theta": 4, "speed": {"y_b": 10}}})
    assert result.observers["S"].status == "ok"
    matrix = np.array([[-80.0, 1], [-1600.0, 0]])
    expected = errors(matrix, np.array([-0.5, -0.5]), [0, 1])[:, 0]
    found = (result.observers["S"].xhat - result.x)[:, 2]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3)


@pytest.mark.parametrize("names", [("y_a", "y_b"), ("y2", "y1")], ids=["other names", "names of another order"])
def test_the_theory_takes_the_chain_of_the_output(names: tuple[str, str]) -> None:
    """Poles of the chain of three -1, of the chain of one -1/2, whatever the outputs are called."""
    plant = inline({"a": "a2", "a2": "a3", "a3": "-a", "b": "0.1*a"}, dict(zip(names, ("a", "b"), strict=True)))
    block: Block = {"type": "shgo", "theta": THETA, "poles": -1, "speed": {names[1]: SPEED}}
    made = experiment(plant, {"S": block}, end=2, step=0.01)
    run = prepare(made)
    error = error_dynamics(made.observers["S"], run.forms["S"])
    np.testing.assert_allclose(np.poly(error.A), np.poly([-1, -1, -1, -SPEED]), rtol=1e-12)
    alone, _ = chain(run, "S")
    assert alone.experiment.observers["S"].model_dump()["speed"] == {"y2": SPEED}  # whose outputs are y1 and y2
