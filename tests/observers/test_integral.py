"""The observer of the output's integral: FHGO II in other filter coordinates."""

from __future__ import annotations

from collections.abc import Callable
from math import comb

import numpy as np
import pytest
from examples import chain
from plain import (
    PLANTS,
    SCENARIOS,
    START,
    Array,
    as_text,
    assert_assigned,
    error_dynamics,
    experiment,
    measured,
    random_poles,
    run_both,
)

import hgorun
from hgorun.errors import ConfigError
from hgorun.simulation.simulate import prepare


@pytest.mark.slow
@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("plant", PLANTS)
def test_from_rest_it_is_fhgo2(plant: str, scenario: str) -> None:
    """eta_j of fhgo2 is theta^(r+1-j) eta_j."""
    theta = 2.0
    blocks = {
        f"{name} {r}": {"type": name, "theta": theta, "r": r, "initial": {"x1": 0.2}}
        for name in ("integral", "fhgo2")
        for r in (1, 2, 3)
    }
    config = PLANTS[plant][1]
    result = hgorun.simulate(experiment(config, blocks, measurement=measured(**SCENARIOS[scenario])))
    for r in (1, 2, 3):
        one, two = result.observers[f"integral {r}"], result.observers[f"fhgo2 {r}"]
        np.testing.assert_allclose(one.xhat, two.xhat, rtol=0, atol=1e-12)
        scale = theta ** np.arange(r, 0, -1)
        np.testing.assert_allclose(scale * one.internal["eta"], two.internal["eta"], rtol=0, atol=1e-12)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_order_zero_is_the_standard_observer(scenario: str) -> None:
    blocks = {"S": {"type": "shgo", "theta": 1.5}, "I": {"type": "integral", "theta": 1.5, "r": 0}}
    plant = PLANTS["pendulum"][1]
    result = hgorun.simulate(experiment(plant, blocks, measurement=measured(**SCENARIOS[scenario])))
    np.testing.assert_array_equal(result.observers["I"].xhat, result.observers["S"].xhat)


@pytest.mark.parametrize(("n", "r"), [(1, 1), (2, 3), (3, 2), (4, 4)])
def test_poles_are_assigned(n: int, r: int) -> None:
    poles = random_poles(r + n, 10 * n + r)
    M, _ = error_dynamics(chain(n), {"type": "integral", "theta": 3, "r": r, "poles": as_text(poles)})
    assert_assigned(M, [3 * p for p in poles])


@pytest.mark.costly
@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("plant", PLANTS)
def test_against_the_plain_simulator(plant: str, scenario: str) -> None:
    theta, r = 1.5, 2

    def observer(f: Callable[[Array], Array], n: int) -> Callable[[Array, float], tuple[Array, float]]:
        k = [comb(r + n, i) for i in range(1, r + n + 1)]
        kappa = np.array([theta ** (r + i) * k[r + i - 1] for i in range(1, n + 1)])

        def rates(w: Array, innovation: float) -> tuple[Array, float]:
            xhat, eta = w[:n], w[n:]
            deta = [eta[1] - theta * k[0] * eta[0], innovation - theta**2 * k[1] * eta[0]]
            return np.concatenate([f(xhat) - kappa * eta[0], deta]), kappa[0] * eta[0]

        return rates

    block = {"type": "integral", "theta": theta, "r": r}
    found, plain = run_both(block, observer, lambda n: np.append(START[:n], np.zeros(r)), plant, scenario)
    n = found.xhat.shape[1]
    np.testing.assert_allclose(found.xhat, plain[:, :n], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.internal["eta"], plain[:, n:], rtol=0, atol=1e-9)


def test_the_number_of_poles_is_checked() -> None:
    block = {"type": "integral", "theta": 2, "r": 2, "poles": [-1, -2]}
    with pytest.raises(ConfigError, match="expected 5 numbers, or one number for all; found 2") as error:
        prepare(experiment(PLANTS["pendulum"][1], {"o": block}))
    assert error.value.key == "observers.o.poles"
