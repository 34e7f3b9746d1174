"""FHGO II for plants that are not uniformly observable: its two forms, and its limits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from examples import simulated

import hgorun
from hgorun.errors import ConfigError
from hgorun.observers.riccati import stationary

ACADEMIC = {
    "type": "academic",
    "initial": {"x1": 1, "x2": 1, "x3": 1},
    "disturbance": {"x3": "0.1*sin(0.1*t)"},
}
NOISE = [{"type": "sinusoids", "terms": [{"amplitude": 0.3, "omega": 20}]}]
SCENARIOS = [
    {"noise": NOISE},
    {"sampling": {"period": 0.1}, "noise": NOISE},
    {"sampling": {"period": 0.1}, "delay": "0.05*abs(cos(t))", "noise": NOISE},
    {"delay": "0.02 + 0.01*sin(t)", "noise": NOISE},
]


@pytest.mark.slow
@pytest.mark.parametrize("r", [1, 2, 3])
def test_full_and_reduced_gain_are_one(r: int) -> None:
    """Two discretisations of order four of one observer: their distance falls like h^4."""
    blocks = {g: {"type": "fhgo2_nuos", "theta": 4, "r": r, "gain": g} for g in ("reduced", "full")}
    gaps, gain_gaps = [], []
    for step in (0.002, 0.001, 0.0005):
        reduced, full = simulated(ACADEMIC, blocks, end=6, step=step, measurement=SCENARIOS[0]).observers.values()
        gaps.append(np.max(np.abs(reduced.xhat - full.xhat)))
        U, P, S = reduced.internal["U"], reduced.internal["P"], full.internal["S"]
        b = np.array([math.comb(r, j) for j in range(1, r + 1)])
        K_n = np.einsum("tij,tj->ti", P, U[:, 0])
        K = np.hstack([b + np.einsum("tij,tj->ti", U, K_n), K_n])
        gain_gaps.append(np.max(np.abs(K - np.linalg.inv(S)[:, :, 0])) / np.max(np.abs(K)))
    np.testing.assert_allclose(S[:, :r, :r], np.broadcast_to(stationary(r), (len(S), r, r)), atol=1e-12)
    for name in (gaps, gain_gaps):
        assert np.polyfit(range(3), -np.log2(name), 1)[0] == pytest.approx(4, abs=0.3)
        assert name[-1] < 1e-5
    assert (reduced.dimension, full.dimension) == (3 + r + 3 * r + 6, 3 + r + (3 + r) * (4 + r) // 2)


@pytest.mark.parametrize("r", range(1, 7))
def test_stationary_block(r: int) -> None:
    """(3.130) and (3.131), exactly."""
    S, A, C = stationary(r), np.eye(r, k=1), np.eye(1, r)
    np.testing.assert_array_equal(S + S @ A + A.T @ S, C.T @ C)
    np.testing.assert_array_equal(S @ [math.comb(r, j) for j in range(1, r + 1)], C[0])


@pytest.mark.measured("reduced-riccati-0", "full-lyapunov-1")
@pytest.mark.slow
@pytest.mark.parametrize("measurement", SCENARIOS, ids=range(len(SCENARIOS)))
@pytest.mark.parametrize(("gain", "equation"), [("reduced", "riccati"), ("full", "lyapunov")])
def test_order_zero_is_the_standard_observer(gain: str, equation: str, measurement: dict[str, Any]) -> None:
    blocks = {
        "zero": {"type": "fhgo2_nuos", "theta": 3, "r": 0, "gain": gain},
        "standard": {"type": "shgo_riccati", "theta": 3, "equation": equation},
    }
    zero, standard = simulated(ACADEMIC, blocks, end=4, step=0.01, measurement=measurement).observers.values()
    np.testing.assert_array_equal(zero.xhat, standard.xhat)
    assert zero.dimension == standard.dimension == 9


@pytest.mark.parametrize("r", [1, 2, 4])
def test_on_a_chain_the_gain_becomes_the_binomial_one(r: int) -> None:
    plant = {"type": "integrator_chain", "n": 2, "phi": "-x1", "initial": {"x1": 1, "x2": 0}}
    observer = simulated(plant, {"o": {"type": "fhgo2_nuos", "theta": 2, "r": r}}, end=30, step=0.002).observers["o"]
    U, P = observer.internal["U"][-1].reshape(r, 2), observer.internal["P"][-1]
    K_n = P @ U[0]
    K_r = [math.comb(r, j) for j in range(1, r + 1)] + U @ K_n
    np.testing.assert_allclose([*K_r, *K_n], [math.comb(r + 2, j) for j in range(1, r + 3)], rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("measurement", SCENARIOS, ids=range(len(SCENARIOS)))
@pytest.mark.parametrize("r", [1, 3])
def test_on_a_chain_it_becomes_the_observer_of_constant_gain(r: int, measurement: dict[str, Any]) -> None:
    """After its start the difference to fhgo2 decays like the error does."""
    plant = {"type": "integrator_chain", "n": 2, "phi": "-sin(x1) - x2", "initial": {"x1": 1, "x2": 0}}
    blocks = {
        "varying": {"type": "fhgo2_nuos", "theta": 3, "r": r},
        "constant": {"type": "fhgo2", "theta": 3, "r": r},
    }
    varying, constant = simulated(plant, blocks, end=30, step=0.005, measurement=measurement).observers.values()
    gap = np.max(np.abs(varying.xhat - constant.xhat), axis=1)
    assert np.max(gap) > 1e-3
    assert np.max(gap[-50:]) < 1e-7


def test_several_outputs_are_refused() -> None:
    plant = {
        "states": ["a", "b", "c"],
        "dynamics": {"a": "c", "b": "sin(t)*c", "c": "-c"},
        "output": ["a", "b"],
        "initial": {"a": 0, "b": 0, "c": 1},
    }
    with pytest.raises(ConfigError, match="one output, and the plant has 2: a, b; fhgo1") as error:
        simulated(plant, {"o": {"type": "fhgo2_nuos", "theta": 2}}, end=1, step=0.01)
    assert error.value.key == "observers.o"


@pytest.mark.parametrize(
    ("more", "key"),
    [({"r": -1}, "r"), ({"r": 1.5}, "r"), ({"gain": "half"}, "gain"), ({"internal": {"P": 0}}, "internal.P")],
)
def test_wrong_input_is_refused(more: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigError) as error:
        simulated(ACADEMIC, {"o": {"type": "fhgo2_nuos", "theta": 2, **more}}, end=1, step=0.01)
    assert error.value.key == f"observers.o.{key}"


@pytest.mark.slow
def test_a_step_of_auto_is_short_enough() -> None:
    """Sampled and late, where no noise of the output asks for a shorter one."""
    for block in (
        {"type": "fhgo2_nuos", "r": 2},
        {"type": "fhgo2_nuos", "r": 1, "gain": "full"},
        {"type": "shgo_riccati"},
        {"type": "fhgo1", "delta": 3},
    ):
        config = {
            "time": {"end": 15, "output_step": 0.1},
            "plant": ACADEMIC,
            "measurement": {"sampling": {"period": 0.2}, "delay": "0.1*abs(cos(t))", "noise": NOISE},
            "observers": {"o": {**block, "theta": 2}},
        }
        result = hgorun.simulate(hgorun.Experiment(config, name="test"), check_step=True)
        assert result.integration_error is not None
        assert result.integration_error["o"] < 1e-5
