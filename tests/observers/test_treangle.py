"""The Treangle observer."""

from __future__ import annotations

from collections.abc import Callable
from math import comb
from typing import Any

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


@pytest.mark.costly
@pytest.mark.parametrize("n", range(1, 9))
def test_poles_are_assigned(n: int) -> None:
    for seed in range(4):
        poles = random_poles(2 * n, seed)
        M, _ = error_dynamics(chain(n), {"type": "treangle", "theta": 1, "poles": as_text(poles)})
        assert_assigned(M, poles)


def test_theta_scales_the_poles() -> None:
    poles = random_poles(6, 7)
    M, _ = error_dynamics(chain(3), {"type": "treangle", "theta": 5, "poles": as_text(poles)})
    assert_assigned(M, [5 * p for p in poles])


def test_wide_sets_of_poles() -> None:
    """Sixteen poles over four decades, and eight pairs with hardly any damping."""
    wide = [complex(-(10**d)) for d in np.linspace(-2, 2, 16)]
    pairs = [complex(-0.001 * w, sign * w) for w in np.linspace(0.5, 3, 8) for sign in (1, -1)]
    for poles in (wide, pairs):
        block = {"type": "treangle", "theta": 1, "poles": as_text(poles)}
        gains = hgorun.simulate(experiment(chain(8, start=0), {"o": block})).observers["o"].gains
        s = np.array([1.0, 0.3 + 1j, -2 + 0.5j, 3j, 0.01, -0.1])
        p = np.ones_like(s)
        for d, k in zip(gains["delta"], gains["K"], strict=True):
            p = s * (s + d) * p + k
        np.testing.assert_allclose(p, np.prod(s[:, None] - np.array(poles), axis=1), rtol=1e-9)
        assert min(gains["delta"]) > 0


@pytest.mark.parametrize("pole", [-1.0, -2.5])
def test_equal_poles_have_the_known_gains(pole: float) -> None:
    result = hgorun.simulate(experiment(chain(5), {"o": {"type": "treangle", "theta": 2, "poles": pole}}))
    found = result.observers["o"]
    np.testing.assert_allclose(found.gains["delta"], np.full(5, -2 * pole), rtol=1e-12)
    np.testing.assert_allclose(found.gains["K"], [comb(5, i) * pole ** (2 * i) for i in range(1, 6)], rtol=1e-12)
    assert found.dimension == 10
    assert found.internal["e"].shape == (301, 5)


@pytest.mark.costly
@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("plant", PLANTS)
def test_against_the_plain_simulator(plant: str, scenario: str) -> None:
    theta = 1.5

    def observer(f: Callable[[Array], Array], n: int) -> Callable[[Array, float], tuple[Array, float]]:
        # all poles at -1: delta_i = 2, k_i = binomial(n, i)
        K = np.diag([comb(n, i) for i in range(1, n + 1)])
        D, A_T, C_T = 2 * np.eye(n), np.eye(n, k=-1), np.eye(n)[:, 0]

        def rates(w: Array, innovation: float) -> tuple[Array, float]:
            xhat, e = w[:n], w[n:]
            dxhat = f(xhat) - theta * K @ e
            de = -theta * D @ e + theta**2 * A_T @ e + theta * C_T * innovation
            return np.concatenate([dxhat, de]), theta * K[0, 0] * e[0]

        return rates

    found, plain = run_both(
        {"type": "treangle", "theta": theta},
        observer,
        lambda n: np.append(START[:n], np.zeros(n)),
        plant,
        scenario,
    )
    n = found.xhat.shape[1]
    np.testing.assert_allclose(found.xhat, plain[:, :n], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.internal["e"], plain[:, n:], rtol=0, atol=1e-9)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_one_state_is_fhgo2_with_one_filter(scenario: str) -> None:
    """eta' = theta (-delta eta + e), xhat' = phi - theta k eta."""
    blocks = {name: {"type": name, "theta": 1.5, "gains": [3, 1.7]} for name in ("treangle", "fhgo2")}
    plant = chain(1, "-sin(x1) + cos(t)")
    result = hgorun.simulate(experiment(plant, blocks, measurement=measured(**SCENARIOS[scenario])))
    one, two = (o.xhat for o in result.observers.values())
    np.testing.assert_allclose(one, two, rtol=0, atol=1e-13)


def test_fhgo1_with_a_stationary_gain_is_treangle_with_equal_filters() -> None:
    """P = P_inf, delta = 4, all poles at -2: P C^T are binomials; the filters carry one more factor delta."""
    k = [3, 3, 1]
    P = [[3, 3, 1], [3, 5, 2], [1, 2, 1]]
    blocks = {
        "one": {"type": "fhgo1", "theta": 2, "delta": 4, "internal": {"P": P}},
        "two": {"type": "treangle", "theta": 2, "poles": -2},
    }
    plant = chain(3)
    result = hgorun.simulate(experiment(plant, blocks, measurement=measured(period=0.1)))
    assert result.observers["two"].gains["delta"] == pytest.approx([4, 4, 4])
    assert result.observers["two"].gains["K"] == pytest.approx([k_i * 4**i for i, k_i in enumerate(k, start=1)])
    one, two = (o.xhat for o in result.observers.values())
    np.testing.assert_allclose(one, two, rtol=0, atol=1e-10)


RELATIVES = {
    "treangle": {"type": "treangle", "theta": 2, "poles": -1.5},
    "lowpass": {"type": "lowpass", "theta": 2, "rho": 0.2, "r": 2},
    "integral": {"type": "integral", "theta": 2, "r": 2},
}


@pytest.mark.costly
@pytest.mark.parametrize("name", RELATIVES)
def test_two_outputs_are_two_observers(name: str) -> None:
    """Chains of three and of two that do not meet."""
    parts = {"a": {"a": "b", "b": "c", "c": "-a - sin(b)"}, "d": {"d": "g", "g": "-2*sin(d)"}}

    def inline(dynamics: dict[str, str], output: Any) -> dict[str, Any]:
        initial = {s: 0.3 + 0.1 * "abcdg".index(s) for s in dynamics}
        return {"states": list(dynamics), "dynamics": dynamics, "output": output, "initial": initial}

    def run(plant: dict[str, Any]) -> Array:
        return hgorun.simulate(experiment(plant, {"o": RELATIVES[name]}, measurement=measured(0.1))).observers["o"].xhat

    together = run(inline(parts["a"] | parts["d"], ["a", "d"]))
    apart = np.hstack([run(inline(dynamics, output)) for output, dynamics in parts.items()])
    np.testing.assert_allclose(together, apart, rtol=0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*RELATIVES, "low_power"])
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_plant_in_other_coordinates_is_observed_through_the_jacobian(name: str, scenario: str) -> None:
    """z = (a, b, sinh c) is a chain of integrators with phi = -z2 sqrt(1 + z3^2)."""
    block = RELATIVES.get(name, {"type": "low_power", "theta": 2})
    curved = {
        "states": ["a", "b", "c"],
        "dynamics": {"a": "b", "b": "sinh(c)", "c": "-b"},
        "output": "a",
        "initial": {"a": 0.5, "b": 0.4, "c": float(np.arcsinh(0.3))},
    }
    straight = chain(3, "-x2*sqrt(1 + x3**2)") | {"initial": {"x1": 0.5, "x2": 0.4, "x3": 0.3}}
    more = {"measurement": measured(**SCENARIOS[scenario]), "solver": {"step": 0.002}}
    x, z = (
        hgorun.simulate(experiment(plant, {"o": block}, **more)).observers["o"].xhat for plant in (curved, straight)
    )
    np.testing.assert_allclose(np.column_stack([x[:, :2], np.sinh(x[:, 2])]), z, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", RELATIVES)
def test_canonical_and_original_coordinates_agree(name: str) -> None:
    contois = {
        "type": "contois",
        "inputs": {"D": "mu*(1 - abs(sin(t))/2)"},
        "initial": {"x1": 1.5, "x2": 15},
    }
    block = RELATIVES[name] | {"initial": {"x1": 1, "x2": 14}}
    observers = {c: block | {"coordinates": c} for c in ("original", "canonical")}
    more = {"measurement": measured(0.1), "solver": {"step": 0.002}}
    one, two = (o.xhat for o in hgorun.simulate(experiment(contois, observers, **more)).observers.values())
    np.testing.assert_allclose(one, two, rtol=1e-7)


@pytest.mark.parametrize("block", [*RELATIVES.values(), {"type": "low_power", "theta": 2, "poles": [-1, -2, -3, -4]}])
def test_fastest_rate_is_the_spectral_radius(block: dict[str, Any]) -> None:
    e = experiment(chain(3), {"o": block})
    M, _ = error_dynamics(chain(3), block)
    radius = np.max(np.abs(np.linalg.eigvals(M)))
    assert e.observers["o"].fastest_rate(e.forms["o"]) == pytest.approx(radius, rel=0.05)  # defective eigenvalues


@pytest.mark.parametrize(
    ("more", "key", "words"),
    [
        ({"poles": [-1, -2]}, "poles", "expected 6 numbers, or one number for all; found 2"),
        ({"gains": [1, 2, 3]}, "gains", "expected 6 numbers; found 3"),
        ({"poles": -1e60}, "poles", "product of these 6 poles is beyond the range of double precision"),
        ({"poles": -1e-60}, "poles", "put the speed into theta"),
    ],
)
def test_refusals(more: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words) as error:
        prepare(experiment(chain(3), {"o": {"type": "treangle", "theta": 2, **more}}))
    assert error.value.key == f"observers.o.{key}"
