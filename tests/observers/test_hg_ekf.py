"""The high-gain Kalman filter, against Riccati's equation, other observers, and a trajectory computed elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from examples import CONTOIS, Block, chain, experiment, findings, inline, said, simulated
from scipy.linalg import solve_continuous_are

import hgorun
from hgorun.errors import ConfigError
from hgorun.observers.hg_ekf import HighGainFilter, HighGainKalmanFilter, SampledHighGainFilter
from hgorun.testing import check_observer

JERK = chain(3, "-0.6*x3 - x2 - sin(x1)", [1, 0, 0])
SAMPLED: Block = {"sampling": {"period": 0.1}}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cls", "block"),
    [
        (HighGainKalmanFilter, {}),
        (SampledHighGainFilter, {"type": "hg_ekf", "update": "jump", "interval": 0.1}),
    ],
)
def test_contract(cls: type[HighGainFilter], block: Block) -> None:
    check_observer(cls, block)


# an independent simulator, RK4 with steps of 0.002
TRAJECTORY = {
    0.5: (0.680829, 0.153114, -0.261306),
    1: (0.911164, 0.080928, -0.594665),
    2: (0.328765, -0.822813, -0.452766),
    10: (-1.318287, 0.382032, 1.445172),
}


def test_trajectory_computed_elsewhere() -> None:
    found = simulated(JERK, {"K": {"type": "hg_ekf", "theta": 2}}, end=10, output_step=0.5, step=2e-3).observers["K"]
    for t, expected in TRAJECTORY.items():
        np.testing.assert_allclose(found.xhat[round(2 * t)], expected, rtol=0, atol=6e-7)
    np.testing.assert_allclose(np.diag(found.internal["P"][-1])[[0, 2]], [2.015085, 17.748184], rtol=0, atol=6e-7)


@pytest.mark.parametrize(("n", "G"), [(2, (np.sqrt(3), 1)), (3, (1 + np.sqrt(2), 1 + np.sqrt(2), 1))])
def test_at_rest_on_a_chain_it_is_the_standard_observer(n: int, G: tuple[float, ...]) -> None:
    found = simulated(chain(n), {"K": {"type": "hg_ekf", "theta": 3}}, end=12, step=2e-3).observers["K"]
    gain = found.internal["P"][-1][:, 0] * 3  # P C^T theta/R
    np.testing.assert_allclose(gain, [g * 3**i for i, g in enumerate(G, 1)], rtol=1e-6)


def test_theta_one_is_kalman_bucy() -> None:
    blocks = {
        "high": {"type": "hg_ekf", "theta": 1, "Q": [[1, 0, 0], [0, 2, 0.5], [0, 0.5, 3]], "R": 0.2},
        "plain": {"type": "kalman_bucy", "Q": [[1, 0, 0], [0, 2, 0.5], [0, 0.5, 3]], "R": 0.2},
    }
    found = simulated(JERK, blocks, end=3, step=0.01).observers
    np.testing.assert_allclose(found["high"].xhat, found["plain"].xhat, rtol=0, atol=1e-13)


def test_two_outputs_have_a_chain_each() -> None:
    """Against scipy's Riccati equation with Q between powers of theta, chain by chain."""
    plant = inline({"a": "b", "b": "-a", "c": "a - c"}, {"y": "a", "z": "c"})
    block = {"type": "hg_ekf", "theta": 2, "Q": 0.5, "R": {"y": 0.1, "z": 0.3}}
    found = simulated(plant, {"K": block}, end=15, step=2e-3).observers["K"]
    F, C = np.array([[0, 1, 0], [-1, 0, 0], [1, 0, -1.0]]), np.eye(3)[[0, 2]]
    D = np.diag([1, 2, 1.0])
    P = solve_continuous_are(F.T, C.T, 2 * D @ (0.5 * np.eye(3)) @ D, np.diag([0.1, 0.3]) / 2)
    np.testing.assert_allclose(found.internal["P"][-1], P, rtol=0, atol=1e-8)


def test_sampled_gain_tends_to_butterworths() -> None:
    """K/(T theta^i) with Q = B B^T, first order in T."""
    for T, gains in {0.1: (1.1525, 0.8089), 0.05: (1.2743, 0.8994)}.items():
        block = {"type": "hg_ekf", "theta": 3, "update": "jump", "Q": [[0, 0], [0, 1]]}
        found = simulated(
            chain(2), {"K": block}, end=6, output_step=T, step=T / 20, measurement={"sampling": {"period": T}}
        )
        P = found.observers["K"].internal["P"][-1]  # after the sample: K = P H^T/R, R = 1/(theta T)
        np.testing.assert_allclose(P[:, 0] * 3 / [3, 9], gains, atol=6e-5)


def test_in_its_own_coordinates_and_in_the_plants() -> None:
    """Two observers of a plant that is seen through Phi, both of which follow it; P is J^-1 P_z J^-T at first order."""
    blocks = {
        name: {"type": "hg_ekf", "theta": 4, "coordinates": name, "initial": {"x1": 1.2, "x2": 13}}
        for name in ("original", "canonical")
    }
    result = simulated(CONTOIS, blocks, end=6, step=2e-3)
    for found in result.observers.values():
        np.testing.assert_allclose(found.xhat[-1], result.x[-1], rtol=1e-6)
    assert np.max(np.abs(result.observers["original"].xhat - result.observers["canonical"].xhat)) > 1e-3


def test_a_plant_without_chains_is_taken_block_by_block() -> None:
    """Observable under some inputs only: F passes through zero with the input."""
    plant = {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "u*x2 - x1", "x2": "-0.2*x2 + 0.3"},
        "inputs": {"u": "sin(t)"},
        "output": "x1",
        "initial": {"x1": 0.5, "x2": 2},
    }
    result = simulated(plant, {"K": {"type": "hg_ekf", "theta": 3}}, end=12, step=5e-3)
    np.testing.assert_allclose(result.observers["K"].xhat[-1], result.x[-1], atol=1e-4)


def test_linear_theory() -> None:
    """Poles at theta = 1 and what noise does, from the gain at rest; no bound of a theorem with constants."""
    noise = {"noise": [{"type": "gaussian", "std": 0.2, "hold": 0.01}]}
    run = experiment(chain(2, "-x1"), {"K": {"type": "hg_ekf", "theta": 3}}, end=12, step=5e-3, measurement=noise)
    found = hgorun.analyze(run, findings("decay", "convergence")).observers["K"]
    np.testing.assert_allclose(np.sort(np.poly(said(found)["poles"])), np.sort([1, np.sqrt(3), 1]), rtol=1e-9)
    assert "not which" in found.reasons["theta_bound"]


@pytest.mark.parametrize(
    ("keys", "measurement", "message"),
    [
        ({"theta": 0}, {}, "above 0"),
        ({"theta": 2, "R": 0}, {}, "above 0"),
        ({"theta": 2, "R": {"z": 1}}, {}, "unknown output 'z'"),
        ({"theta": 2, "Q": [[1, 2], [2, 1]]}, {}, "expected 3 rows of 3 numbers, or a multiple of the identity"),
        ({"theta": 2, "Q": -1}, {}, "above 0"),
        ({"theta": 2, "internal": {"P": -1}}, {}, "must be positive definite"),
        ({"theta": 2, "interval": 1}, {}, "interval is a key of update: jump"),
        ({"theta": 2, "update": "jump", "interval": 0.1}, {}, "needs sampled outputs"),
        ({"theta": 2, "update": "jump"}, {}, "needs sampled outputs"),
        ({"theta": 2, "update": "jump", "late": "innovation"}, SAMPLED, "is corrected by samples"),
    ],
)
def test_what_cannot_be_is_refused(keys: Block, measurement: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(JERK, {"K": {"type": "hg_ekf", **keys}}, measurement=measurement))


def test_outputs_that_are_not_states_and_measure_the_same_are_refused() -> None:
    plant = inline({"a": "b", "b": "-a"}, {"y": "a", "z": "2*a"})
    with pytest.raises(
        ConfigError, match="more chain components than there are states; nor is it triangular: output z"
    ):
        hgorun.simulate(experiment(plant, {"K": {"type": "hg_ekf", "theta": 2}}))


def test_outputs_that_are_one_state_are_taken_block_by_block() -> None:
    """Two sensors of one variance are one of half of it."""
    two = inline({"a": "b", "b": "-a"}, {"y": "a", "z": "a"})
    one = inline({"a": "b", "b": "-a"}, "a")
    both = simulated(two, {"K": {"type": "hg_ekf", "theta": 2, "R": 0.4}}, step=0.01).observers["K"]
    alone = simulated(one, {"K": {"type": "hg_ekf", "theta": 2, "R": 0.2}}, step=0.01).observers["K"]
    np.testing.assert_allclose(both.xhat, alone.xhat, rtol=0, atol=1e-14)
