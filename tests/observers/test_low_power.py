"""The low-power observer, against its own equations in xi."""

from __future__ import annotations

from collections.abc import Callable
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

KNOWN: dict[int, list[tuple[float, float]]] = {  # all poles at -1
    2: [(2, 1)],
    3: [(2, 2), (2, 1 / 2)],
    4: [(2, 3), (2, 1), (2, 1 / 3)],
    5: [(2, 4), (2, 3 / 2), (2, 2 / 3), (2, 1 / 4)],
}


@pytest.mark.costly
@pytest.mark.parametrize("n", range(2, 9))
def test_poles_are_assigned(n: int) -> None:
    for seed in range(4):
        poles = random_poles(2 * n - 2, seed)
        M, _ = error_dynamics(chain(n), {"type": "low_power", "theta": 1, "poles": as_text(poles)})
        assert_assigned(M, poles)


def test_theta_scales_the_poles() -> None:
    poles = random_poles(6, 3)
    M, _ = error_dynamics(chain(4), {"type": "low_power", "theta": 4, "poles": as_text(poles)})
    assert_assigned(M, [4 * p for p in poles])


@pytest.mark.parametrize("n", KNOWN)
def test_equal_poles_have_the_known_gains(n: int) -> None:
    result = hgorun.simulate(experiment(chain(n), {"o": {"type": "low_power", "theta": 2}}))
    found = result.observers["o"]
    np.testing.assert_allclose(found.gains["K"], KNOWN[n], rtol=1e-12)
    assert found.dimension == 2 * n - 2


def test_gains_are_taken_block_by_block() -> None:
    gains = [2, 3, 2, 1, 2, 1 / 3]
    blocks = {
        "poles": {"type": "low_power", "theta": 2},
        "gains": {"type": "low_power", "theta": 2, "gains": gains},
    }
    one, two = hgorun.simulate(experiment(chain(4), blocks)).observers.values()
    np.testing.assert_allclose(one.xhat, two.xhat, rtol=0, atol=1e-12)


@pytest.mark.costly
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_two_states_are_the_standard_observer(scenario: str) -> None:
    blocks = {name: {"type": name, "theta": 1.5, "poles": [-1, -2]} for name in ("low_power", "shgo")}
    plant = PLANTS["van der pol"][1]
    result = hgorun.simulate(experiment(plant, blocks, measurement=measured(**SCENARIOS[scenario])))
    one, two = (o.xhat for o in result.observers.values())
    np.testing.assert_allclose(one, two, rtol=0, atol=1e-13)


def in_xi(f: Callable[[Array], Array], n: int, theta: float) -> Callable[[Array, float], tuple[Array, float]]:
    """The published equations: w = (xi_11, xi_12, xi_21, ...), e = -e_1."""
    k = KNOWN[n]

    def rates(w: Array, innovation: float) -> tuple[Array, float]:
        xi = w.reshape(n - 1, 2)
        xhat = np.append(xi[:, 0], xi[-1, 1])
        dxi = np.zeros_like(xi)
        for i in range(n - 1):
            e_i = -innovation if i == 0 else xi[i - 1, 1] - xi[i, 0]
            following = xi[i + 1, 1] if i < n - 2 else f(xhat)[-1]
            dxi[i] = xi[i, 1] + theta * k[i][0] * e_i, following + theta**2 * k[i][1] * e_i
        return dxi.ravel(), theta * k[0][0] * innovation

    return rates


@pytest.mark.costly
@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("plant", PLANTS)
def test_against_the_plain_simulator(plant: str, scenario: str) -> None:
    theta = 1.5
    block: dict[str, Any] = {"type": "low_power", "theta": theta}

    def start(n: int) -> Array:
        return np.array([START[i : i + 2] for i in range(n - 1)]).ravel()

    found, plain = run_both(block, lambda f, n: in_xi(f, n, theta), start, plant, scenario)
    n = found.xhat.shape[1]
    xi = plain.reshape(-1, n - 1, 2)
    np.testing.assert_allclose(found.xhat, np.column_stack([xi[:, :, 0], xi[:, -1, 1]]), rtol=0, atol=1e-9)
    if n > 2:
        np.testing.assert_allclose(found.internal["e"], xi[:, :-1, 1] - xi[:, 1:, 0], rtol=0, atol=1e-9)


def test_blocks_may_start_apart() -> None:
    """xi_12 = xhat_2 + e_2."""
    block = {"type": "low_power", "theta": 1.5, "internal": {"e": 0.4}}

    def start(n: int) -> Array:
        return np.array([START[0], START[1] + 0.4, START[1], START[2]])

    found, plain = run_both(block, lambda f, n: in_xi(f, n, 1.5), start, "pendulum", "continuous")
    np.testing.assert_allclose(found.xhat, plain[:, [0, 2, 3]], rtol=0, atol=1e-9)


def inline(dynamics: dict[str, str], output: Any = "a", **more: Any) -> dict[str, Any]:
    return {
        "states": list(dynamics),
        "dynamics": dynamics,
        "output": output,
        "initial": {state: 0.3 for state in dynamics},
        **more,
    }


@pytest.mark.costly
@pytest.mark.parametrize(
    ("plant", "words"),
    [
        (chain(1), "needs n >= 2, found n = 1; .*observers for this plant are .*shgo"),
        (inline({"a": "b", "b": "-a", "c": "d", "d": "-c"}, ["a", "c"]), "one output, found a, c"),
        (inline({"a": "b", "b": "c + sin(t)", "c": "-a"}), "derivative of the state b has a further term"),
        (inline({"a": "2*b + u", "b": "-a"}, inputs={"u": "sin(t)"}), "derivative of z1 has a further term"),
        (
            inline({"a": "2*b", "b": "c - u*b", "c": "-a"}, inputs={"u": "1"}),
            "derivative of z2 has a further term",
        ),
    ],
)
def test_a_plant_outside_the_class_is_refused_with_the_reason(plant: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words) as error:
        prepare(experiment(plant, {"o": {"type": "low_power", "theta": 2}}))
    assert error.value.key == "plant"


@pytest.mark.parametrize(
    "plant",
    [
        inline({"a": "b", "b": "c", "c": "-a + u"}, inputs={"u": "sin(t)"}),
        inline({"a": "2*b - a", "b": "c - b**3", "c": "-a + u"}, inputs={"u": "sin(t)"}),
        inline({"a": "b - a", "b": "c - b**3", "c": "-a + u"}, inputs={"u": "sin(t)"}),
    ],
    ids=["chain", "other coordinates", "other coordinates of a chain"],
)
def test_inputs_in_the_last_equation_are_in_the_class(plant: dict[str, Any]) -> None:
    """The estimate arrives at the truth."""
    result = hgorun.simulate(experiment(plant, {"o": {"type": "low_power", "theta": 10}}))
    np.testing.assert_allclose(result.observers["o"].xhat[-1], result.x[-1], atol=1e-3)


def test_the_number_of_poles_is_checked() -> None:
    with pytest.raises(ConfigError, match="expected 4 numbers, or one number for all; found 3") as error:
        prepare(experiment(chain(3), {"o": {"type": "low_power", "theta": 2, "poles": [-1, -2, -3]}}))
    assert error.value.key == "observers.o.poles"
