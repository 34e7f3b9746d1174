"""The adaptive high-gain Kalman filter: what its predictions cost, and what theta makes of it."""

from __future__ import annotations

import numpy as np
import pytest
from examples import VAN_DER_POL, Block, experiment, inline, simulated

import hgorun
from hgorun import Result
from hgorun.errors import ConfigError
from hgorun.observers.aekf import AdaptiveFilter, AdaptiveKalmanFilter, SampledAdaptiveFilter
from hgorun.testing import check_observer

VDP: Block = VAN_DER_POL | {"parameters": {"mu": 0.5}, "initial": {"x1": 1, "x2": 0}}
NOISE: Block = {"noise": [{"type": "expression", "value": "0.05*sin(40*t)"}]}
STEP = 0.02


def of(**keys: object) -> Block:
    return {"type": "aekf", "theta_1": 3, "m": 0.02, "copies": 5, **keys}


@pytest.mark.measured("AdaptiveKalmanFilter-block0")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("cls", "block"),
    [(AdaptiveKalmanFilter, {}), (SampledAdaptiveFilter, {"type": "aekf", "update": "jump", "interval": 0.1})],
)
def test_contract(cls: type[AdaptiveFilter], block: Block) -> None:
    check_observer(cls, block | {"copies": 1})


@pytest.fixture(scope="module")
def run() -> Result:
    return simulated(VDP, {"K": of(window=1.0)}, end=12, output_step=STEP, step=STEP, measurement=NOISE)


def field(x: np.ndarray) -> np.ndarray:
    return np.array([x[1], -x[0] + 0.5 * (1 - x[0] ** 2) * x[1]])


def cost(result: Result, row: int, steps: int) -> float:
    """I by integrating again from the estimate so many steps before: truth, prediction and cost together."""
    first = row - steps
    z = np.concatenate([result.observers["K"].xhat[first], result.x[first], [0]])

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        y = z[2] + 0.05 * np.sin(40 * t)
        return np.concatenate([field(z[:2]), field(z[2:4]), [(y - z[0]) ** 2]])

    for k in range(steps):
        t = (first + k) * STEP
        a = rate(t, z)
        b = rate(t + STEP / 2, z + STEP / 2 * a)
        c = rate(t + STEP / 2, z + STEP / 2 * b)
        z = z + STEP / 6 * (a + 2 * b + 2 * c + rate(t + STEP, z + STEP * c))
    return float(z[4])


@pytest.mark.costly
def test_cost_is_that_of_a_prediction_from_the_estimate(run: Result) -> None:
    """At t = j d/N, from t = d on; between it is held, and before it is zero."""
    found = np.asarray(run.observers["K"].internal["I"])
    assert np.all(found[:50] == 0)
    for row in (50, 60, 70, 200, 600):
        assert found[row] == pytest.approx(cost(run, row, 50), abs=1e-12)
        assert np.all(found[row : row + 10] == found[row])


def test_theta_grows_and_returns_and_stays_inside(run: Result) -> None:
    theta = np.asarray(run.observers["K"].internal["theta"])
    assert np.all((theta >= 1) & (theta <= 6))
    assert theta[90] > 5.5
    assert theta[-1] < 0.6 * theta[90]
    assert np.max(np.abs(run.observers["K"].xhat[200:] - run.x[200:])) < 0.1


@pytest.mark.slow
def test_started_at_the_truth_it_is_the_kalman_filter() -> None:
    """No noise, no cost, theta at 1; with beta m = 600 exactly."""
    start = {"x1": 1}
    blocks = {
        "A": of(beta=30000, initial=start),
        "K": {"type": "kalman_bucy", "Q": {"x1": 1, "x2": 1}, "R": 1, "initial": start},
        "off": of(beta=30000, m=1e3),
        "of": {"type": "hg_ekf", "theta": 1},
    }
    found = simulated(VDP, blocks, end=6, step=STEP).observers
    np.testing.assert_allclose(found["A"].xhat, found["K"].xhat, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found["A"].internal["P"], found["K"].internal["P"], rtol=1e-12)
    assert np.all(np.asarray(found["A"].internal["theta"]) == 1)
    np.testing.assert_allclose(found["off"].xhat, found["of"].xhat, rtol=0, atol=1e-14)


@pytest.mark.costly
def test_samples() -> None:
    """J = T sum |y - yhat|^2 over N samples, from the estimate after the sample N before; the gain of hg_ekf."""
    T, N = 0.2, 4
    measurement: Block = {"sampling": {"period": T, "offset": T}, "noise": [{"type": "gaussian", "std": 0.05}]}
    blocks = {
        "K": of(update="jump", copies=N),
        "off": of(update="jump", m=1e3, beta=1),
        "H": {"type": "hg_ekf", "theta": 1, "update": "jump"},
    }
    result = simulated(VDP, blocks, end=6, output_step=T, step=STEP, measurement=measurement)
    found, y = result.observers["K"], result.measurements.y[:, 0]
    np.testing.assert_allclose(result.observers["off"].xhat, result.observers["H"].xhat, rtol=0, atol=1e-13)
    for row in (5, 12, 30):
        x, total = found.xhat[row - N].copy(), 0.0
        for k in range(row - N, row):
            for _ in range(round(T / STEP)):
                a = field(x)
                b = field(x + STEP / 2 * a)
                c = field(x + STEP / 2 * b)
                x = x + STEP / 6 * (a + 2 * b + 2 * c + field(x + STEP * c))
            total += T * (y[k] - x[0]) ** 2
        assert np.asarray(found.internal["I"])[row] == pytest.approx(total, abs=1e-12)
    assert np.all(np.asarray(found.internal["I"])[: N + 1] == 0)


@pytest.mark.slow
def test_threshold_is_four_times_what_the_noise_costs() -> None:
    held: Block = {"noise": [{"type": "gaussian", "std": 0.1, "hold": 0.1}]}
    sampled: Block = {"noise": [{"type": "gaussian", "std": 0.1}], "sampling": {"period": 0.1, "offset": 0.1}}
    base = {"type": "aekf", "theta_1": 3, "copies": 2}
    for keys, measurement, m in (
        ({"window": 1}, held, 4 * 0.01 * 1),
        ({"window": 1}, sampled, 4 * 0.01 * 1),
        ({"update": "jump"}, sampled, 4 * 0.01 * 0.2),
    ):
        blocks = {"own": base | keys, "given": base | keys | {"m": m}}
        found = simulated(VDP, blocks, end=2, step=STEP, measurement=measurement).observers
        np.testing.assert_allclose(found["own"].xhat, found["given"].xhat, rtol=0, atol=1e-12)


@pytest.mark.costly
def test_a_triangular_plant_and_two_outputs() -> None:
    seldom = {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "u*x2 - x1", "x2": "-0.2*x2 + 0.3"},
        "inputs": {"u": "sin(t)"},
        "output": "x1",
        "initial": {"x1": 0.5, "x2": 2},
    }
    two = inline({"a": "b", "b": "-a", "c": "-c"}, {"y": "a", "z": "c"})
    for plant in (seldom, two):
        result = simulated(plant, {"K": of(copies=2)}, end=12, step=STEP)
        np.testing.assert_allclose(result.observers["K"].xhat[-1], result.x[-1], atol=0.02)


SAMPLED: Block = {"sampling": {"period": 0.1}}


@pytest.mark.parametrize(
    ("keys", "measurement", "message"),
    [
        ({"theta_1": 1}, {}, "theta_1: expected a number above 1"),
        ({"copies": 0}, {}, "K.copies"),
        ({"copies": 21}, {}, "K.copies"),
        ({"m": 0}, {}, "above 0"),
        ({"beta": 200}, {}, "beta m = 4 is below 5"),
        ({"window": -1}, {}, "above 0"),
        ({"interval": 0.1}, {}, "interval is not a key of update: flow"),
        ({"update": "jump", "window": 1}, SAMPLED, "window is not a key of update: jump; d = N T"),
        ({"update": "jump"}, {}, "needs sampled outputs"),
        (
            {"update": "jump"},
            {"sampling": {"times": [0.1, 0.2, 0.35]}},
            "samples of x1 are 0.1 to 0.15 apart, not whole",
        ),
        ({"coordinates": "canonical"}, {}, "in the plant's coordinates"),
        ({"internal": {"theta": 7}}, {}, "from 1 to 2 theta_1 = 6"),
        ({"internal": {"turn": 1}}, {}, "the copies begin at the estimate"),
        ({"internal": {"P": -1}}, {}, "must be positive definite"),
        ({"window": 0.05}, {}, "K"),
    ],
)
def test_what_cannot_be_is_refused(keys: Block, measurement: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(VDP, {"K": of(**keys)}, step=STEP, measurement=measurement))


def test_threshold_without_noise_is_refused() -> None:
    with pytest.raises(ConfigError, match="m does not follow from the noise"):
        hgorun.simulate(experiment(VDP, {"K": {"type": "aekf", "theta_1": 3}}))
