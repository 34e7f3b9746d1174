"""The observer behind a low-pass filter."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from examples import chain, inline
from plain import (
    PLANTS,
    SCENARIOS,
    START,
    Array,
    error_dynamics,
    experiment,
    measured,
    run_both,
)

import hgorun
from hgorun.errors import ConfigError
from hgorun.simulation.simulate import prepare

LIMITS = {1: 8 / 9, 2: 0.28222, 3: 1 / 6}  # of rho, with G = (3, 3, 1)


@pytest.mark.costly
@pytest.mark.parametrize("r", LIMITS)
def test_the_admissible_range_is_that_of_the_matrix(r: int) -> None:
    """On either side of the limit: accepted and stable, refused with the limit in the message."""
    limit = LIMITS[r]
    M, _ = error_dynamics(chain(3), {"type": "lowpass", "theta": 1, "r": r, "rho": 0.999 * limit})
    assert -0.01 < np.linalg.eigvals(M).real.max() < 0
    for rho in (1.001 * limit, 3 * limit, 1e3):
        with pytest.raises(ConfigError, match=rf"rho = {rho:g}; .*r = {r} .*0 < rho < {limit:.5g}") as error:
            prepare(experiment(chain(3), {"o": {"type": "lowpass", "theta": 1, "r": r, "rho": rho}}))
        assert error.value.key == "observers.o.rho"


def test_the_limit_is_where_the_eigenvalues_cross_the_axis() -> None:
    """s^n (1 + rho s)^r + g_1 s^(n-1) + ... + g_n has a root j omega there."""
    for n, r, poles in ((2, 4, [-1, -3]), (4, 2, ["-1+2j", "-1-2j", -1, -0.5]), (5, 1, -2)):
        block = {"type": "lowpass", "theta": 1, "r": r, "rho": 50, "poles": poles}
        with pytest.raises(ConfigError, match="0 < rho < ") as error:
            prepare(experiment(chain(n), {"o": block}))
        limit = float(str(error.value).rsplit(" ", 1)[1])
        M, _ = error_dynamics(chain(n), block | {"rho": limit * (1 - 1e-4)})
        values = np.linalg.eigvals(M)
        assert -0.01 < values.real.max() < 0
        G = np.poly(np.full(n, poles) if isinstance(poles, int) else np.array(poles, dtype=complex)).real
        target = np.concatenate([np.poly(np.full(r, -1 / limit)) * limit**r, np.zeros(n)])
        target[-n:] += G[1:]
        assert abs(np.roots(target).real).min() < 1e-4


def test_without_limit() -> None:
    """s (1 + rho s) + g is stable for every rho."""
    error_dynamics(chain(1), {"type": "lowpass", "theta": 1, "rho": 1e4})


def test_gains_that_no_rho_helps_are_refused() -> None:
    with pytest.raises(ConfigError, match="A - G C is not Hurwitz") as error:
        prepare(experiment(chain(3), {"o": {"type": "lowpass", "theta": 1, "rho": 0.1, "gains": [1, 1, 4]}}))
    assert error.value.key == "observers.o.gains"


def test_rho_to_zero_is_the_standard_observer() -> None:
    """The slow eigenvalues approach the poles like rho."""
    poles = [-0.8, -1.5, -2.5]
    for rho in (1e-3, 1e-4):
        M, _ = error_dynamics(chain(3), {"type": "lowpass", "theta": 1, "r": 2, "rho": rho, "poles": poles})
        slow = np.sort(np.linalg.eigvals(M).real)[-3:]
        np.testing.assert_allclose(slow[::-1], poles, atol=100 * rho)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_order_zero_is_the_standard_observer(scenario: str) -> None:
    blocks = {
        "S": {"type": "shgo", "theta": 1.5},
        "L": {"type": "lowpass", "theta": 1.5, "r": 0, "rho": 7},
    }
    plant = PLANTS["pendulum"][1]
    result = hgorun.simulate(experiment(plant, blocks, measurement=measured(**SCENARIOS[scenario])))
    np.testing.assert_array_equal(result.observers["L"].xhat, result.observers["S"].xhat)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_one_filter_is_fhgo2_with_one_filter(scenario: str) -> None:
    """rho eta of the one is eta of the other with K_r = 1/rho, K_n = G/rho."""
    rho, G = 0.3, [3, 3.5, 1.2]
    blocks = {
        "L": {"type": "lowpass", "theta": 1.5, "rho": rho, "gains": G},
        "F": {"type": "fhgo2", "theta": 1.5, "gains": [1 / rho, *(g / rho for g in G)]},
    }
    plant = PLANTS["pendulum"][1]
    result = hgorun.simulate(experiment(plant, blocks, measurement=measured(**SCENARIOS[scenario])))
    one, two = result.observers["L"], result.observers["F"]
    np.testing.assert_allclose(one.xhat, two.xhat, rtol=0, atol=1e-12)
    np.testing.assert_allclose(rho * one.internal["eta"], two.internal["eta"], rtol=0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("plant", PLANTS)
def test_against_the_plain_simulator(plant: str, scenario: str) -> None:
    theta, rho, r = 1.5, 0.1, 3

    def observer(f: Callable[[Array], Array], n: int) -> Callable[[Array, float], tuple[Array, float]]:
        G = np.poly(-np.ones(n))[1:]
        filters = np.array([[-1.0, 0, 0], [1, -1, 0], [0, 1, -1]])
        kappa = theta ** np.arange(1, n + 1) * G

        def rates(w: Array, innovation: float) -> tuple[Array, float]:
            xhat, eta = w[:n], w[n:]
            deta = theta / rho * (filters @ eta + np.array([innovation, 0, 0]))
            return np.concatenate([f(xhat) - kappa * eta[2], deta]), kappa[0] * eta[2]

        return rates

    block = {"type": "lowpass", "theta": theta, "rho": rho, "r": r}
    found, plain = run_both(block, observer, lambda n: np.append(START[:n], np.zeros(r)), plant, scenario)
    n = found.xhat.shape[1]
    np.testing.assert_allclose(found.xhat, plain[:, :n], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.internal["eta"], plain[:, n:], rtol=0, atol=1e-9)


def test_each_chain_has_its_own_range() -> None:
    """Chains of three and of two with r = 2: the longer one allows less."""
    plant = inline({"a": "b", "b": "c", "c": "-b", "f": "g", "g": "-f"}, ["a", "f"], start=0.1)
    block = {"type": "lowpass", "theta": 1, "r": 2}
    prepare(experiment(plant, {"o": block | {"rho": 0.28}}))
    with pytest.raises(ConfigError, match=r"0 < rho < 0\.28222"):
        prepare(experiment(plant, {"o": block | {"rho": 0.29}}))
