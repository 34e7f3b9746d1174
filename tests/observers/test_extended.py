"""The extended observer, against exact errors, the standard observer, and trajectories computed elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from examples import chain, experiment, inline, simulated

import hgorun
from hgorun.errors import ConfigError
from hgorun.observers.extended import ExtendedObserver
from hgorun.testing import check_observer

# t: xhat_1, xhat_2, sigma; an independent simulator, RK4 with steps of 1e-3
TRAJECTORY = {
    0.1: (1.01162, 4.74118, 8.29074),
    0.2: (1.20042, 3.74004, 5.23275),
    0.5: (1.02448, -0.09763, -1.93186),
    1: (1.05600, -0.08423, 0.17834),
    2: (1.40364, 0.36441, 1.44695),
    5: (0.54986, -1.00521, 0.53250),
    10: (2.17641, -0.56140, 1.03697),
}


def test_trajectory_computed_elsewhere() -> None:
    plant = {
        "type": "van_der_pol",
        "parameters": {"mu": 0.5},
        "initial": {"x1": 1, "x2": 0},
        "disturbance": {"x2": "1 + 0.5*sin(t)"},
    }
    found = simulated(plant, {"E": {"type": "extended", "theta": 6}}, end=10, step=1e-3).observers["E"]
    values = np.column_stack([found.xhat, found.internal["sigma"]])
    for t, expected in TRAJECTORY.items():
        np.testing.assert_allclose(values[round(10 * t)], expected, atol=6e-6)


def test_constant_disturbance_is_found() -> None:
    plant = inline({"x1": "x2", "x2": "-x1 - x2"}, "x1", disturbance={"x2": "1.5"})
    found = simulated(plant, {"E": {"type": "extended", "theta": 5}}, end=20).observers["E"]
    assert found.internal["sigma"][-1] == pytest.approx(1.5, abs=1e-8)


def test_ramp_leaves_the_errors_of_the_formula() -> None:
    """-s (1, k_1, k_2)/k_3 with k_i = theta^i g_i."""
    plant = {**chain(2), "disturbance": {"x2": "0.7*t"}}
    result = simulated(plant, {"E": {"type": "extended", "theta": 5}}, end=12)
    found = result.observers["E"]
    errors = [*(found.xhat - result.x)[-1], found.internal["sigma"][-1, 0] - 0.7 * 12]
    np.testing.assert_allclose(errors, [-0.0056, -0.084, -0.42], rtol=1e-6)


def test_two_integrators_follow_a_ramp() -> None:
    plant = {**chain(2), "disturbance": {"x2": "0.7*t - 1"}}
    found = simulated(plant, {"E": {"type": "extended", "theta": 5, "extend": 2}}, end=12).observers["E"]
    np.testing.assert_allclose(found.internal["sigma"][-1], [0.7 * 12 - 1, 0.7], atol=1e-7)


@pytest.mark.parametrize(
    "measurement", [{}, {"sampling": {"period": 0.1}}, {"sampling": {"period": 0.1}, "delay": 0.05}]
)
def test_of_a_chain_of_integrators_it_is_the_standard_observer_of_one_order_more(
    measurement: dict[str, object],
) -> None:
    """phi = 0: sigma is the state x_(n+1)."""
    short = {**chain(2), "disturbance": {"x2": "0.5"}}
    one = simulated(short, {"E": {"type": "extended", "theta": 3}}, end=4, step=1e-2, measurement=measurement)
    two = simulated(chain(3), {"S": {"type": "shgo", "theta": 3}}, end=4, step=1e-2, measurement=measurement)
    e = one.observers["E"]
    np.testing.assert_allclose(np.column_stack([e.xhat, e.internal["sigma"]]), two.observers["S"].xhat, atol=1e-11)


def test_one_unknown_input_for_each_output() -> None:
    plant = inline({"a": "b", "b": "-a", "c": "-c"}, ["a", "c"], disturbance={"b": "0.3", "c": "-0.8"})
    found = simulated(plant, {"E": {"type": "extended", "theta": 6}}, end=10).observers["E"]
    np.testing.assert_allclose(found.internal["sigma"][-1].ravel(), [0.3, -0.8], atol=1e-6)


def test_outputs_that_measure_the_same_are_refused() -> None:
    plant = inline({"a": "b", "b": "-a"}, ["a", "b"])
    with pytest.raises(ConfigError, match="outputs that measure the same have one unknown input"):
        hgorun.simulate(experiment(plant, {"E": {"type": "extended", "theta": 6, "chains": {"a": 2, "b": 1}}}))


@pytest.mark.slow
def test_it_keeps_the_contract_with_two_integrators() -> None:
    check_observer(ExtendedObserver, {"extend": 2})
