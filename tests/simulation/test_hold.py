"""What the innovation of a sampled output is until the next sample: limits of theta T, and identities."""

from __future__ import annotations

import numpy as np
import pytest
from examples import VAN_DER_POL, Block, chain, experiment, findings, inline, simulated

import hgorun
from hgorun.errors import ConfigError

VDP: Block = VAN_DER_POL | {"parameters": {"mu": 0.5}, "initial": {"x1": 1, "x2": 0}}
NOISE = [{"type": "expression", "value": "0.05*sqrt(2)*sin(12.9898*k**1.5 + k)"}]
SAMPLED: Block = {"sampling": {"period": 0.2}, "noise": NOISE}
SHGO: Block = {"type": "shgo", "theta": 3}


def shrinking(gamma: float, theta: float = 3) -> Block:
    return {"type": "shgo", "theta": theta, "hold": {"shrink": gamma}}


# an independent simulator, RK4 with steps of 0.01
TRAJECTORY = {
    0.1: (0.48809, 0.66685),
    0.2: (0.82098, 0.99471),
    0.5: (1.18405, 0.74766),
    1: (0.78113, -0.48387),
    2: (-0.69863, -1.42508),
    5: (0.67307, 1.90239),
    10: (-1.48228, 0.97992),
}


def test_the_common_innovation_is_a_predictor_and_shrinks_with_theta_g_1() -> None:
    blocks = {"S": SHGO, "P": SHGO | {"hold": "predictor"}, "G": shrinking(3 * 2), "O": shrinking(2)}
    found = simulated(VDP, blocks, end=10, output_step=0.1, step=0.01, measurement=SAMPLED).observers
    assert np.array_equal(found["P"].xhat, found["S"].xhat)
    np.testing.assert_allclose(found["G"].xhat, found["S"].xhat, rtol=0, atol=1e-13)
    assert np.max(np.abs(found["O"].xhat - found["S"].xhat)) > 1e-2
    for t, expected in TRAJECTORY.items():
        np.testing.assert_allclose(found["S"].xhat[round(10 * t)], expected, rtol=0, atol=6e-6)


@pytest.mark.parametrize("gamma", [0.0, 1.7])
def test_held_and_shrinking_innovations_against_a_few_lines(gamma: float) -> None:
    """xhat' = f - theta Delta^-1 G exp(-gamma (t - t_k)) e_k, step by step."""
    theta, T, h = 2.0, 0.25, 0.005
    measurement = {"sampling": {"period": T}}
    block = {"S": shrinking(gamma, theta)}
    run = simulated(chain(2, "-x1", [1, 0]), block, end=2, output_step=T, step=h, measurement=measurement)
    x, K = np.zeros(2), np.array([2 * theta, theta**2])

    def rate(t: float, x: np.ndarray, e: float) -> np.ndarray:
        return np.array([x[1], -x[0]]) - K * np.exp(-gamma * t) * e

    for k in range(8):
        e = x[0] - np.cos(k * T)
        for i in range(round(T / h)):
            t = i * h
            a = rate(t, x, e)
            b = rate(t + h / 2, x + h / 2 * a, e)
            c = rate(t + h / 2, x + h / 2 * b, e)
            x = x + h / 6 * (a + 2 * b + 2 * c + rate(t + h, x + h * c, e))
        np.testing.assert_allclose(run.observers["S"].xhat[k + 1], x, rtol=0, atol=1e-10)


@pytest.mark.slow
@pytest.mark.measured_once
@pytest.mark.parametrize(
    ("n", "gamma", "limit"),
    [(1, 0, 2), (2, "common", 4.9999), (2, 1, 2), (2, 0, 1), (3, "common", 2.8963), (3, 1, 1), (3, 0, 0.6752)],
)
def test_longest_periods_on_chains(n: int, gamma: float | str, limit: float) -> None:
    """theta T of the linear error, poles -1: gamma/theta is g_1, 1 or 0."""
    theta = 2.0
    block = {"type": "shgo", "theta": theta} if gamma == "common" else shrinking(float(gamma) * theta, theta)
    run = experiment(chain(n), {"S": block}, end=2, step=0.01, measurement={"sampling": {"period": 0.1 / theta}})
    found = hgorun.analyze(run, findings("stability")).observers["S"].values
    for name in ("period_critical", "period_critical_chain"):
        assert found[name] == pytest.approx(limit / theta, rel=3e-4)


@pytest.mark.costly
def test_one_without_a_limit() -> None:
    run = experiment(chain(1), {"S": shrinking(2, 2)}, end=2, step=0.01, measurement={"sampling": {"period": 0.1}})
    assert (
        "stable at every period" in hgorun.analyze(run, findings("stability")).observers["S"].reasons["period_critical"]
    )


def test_gamma_is_a_number_that_is_swept() -> None:
    """In one structure: the same bits as alone, beside others, and in a run that was varied."""
    base = experiment(VDP, {"S": shrinking(2)}, end=2, step=0.01, measurement=SAMPLED)
    varied = hgorun.simulate(base.varied({"observers.S.hold.shrink": 4.0})).observers["S"].xhat
    both = simulated(VDP, {"S": shrinking(4), "T": shrinking(2)}, end=2, step=0.01, measurement=SAMPLED).observers
    assert np.array_equal(varied, both["S"].xhat)
    assert np.array_equal(hgorun.simulate(base).observers["S"].xhat, both["T"].xhat)


def test_two_outputs_at_times_of_their_own_and_late() -> None:
    """With the gain of the common innovation it is that one, also of late samples."""
    plant = inline({"a": "b", "b": "-a", "c": "d", "d": "-c"}, {"y": "a", "z": "c"})
    late: Block = {
        "sampling": {"period": 0.3},
        "delay": "0.1",
        "outputs": {"z": {"sampling": {"period": 0.2}, "delay": 0}},
    }
    found = simulated(plant, {"S": SHGO, "G": shrinking(6)}, end=3, step=0.01, measurement=late).observers
    np.testing.assert_allclose(found["G"].xhat, found["S"].xhat, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("block", "measurement", "message"),
    [
        (shrinking(-1), SAMPLED, "S.hold.shrink: expected a number of at least 0"),
        (SHGO | {"hold": "zero"}, SAMPLED, "S.hold: expected predictor or {shrink: gamma}, found 'zero'"),
        (shrinking(2), {"delay": 0.1}, "x1 is continuous and late"),
        ({"type": "ekf", "Q": {"x2": 1}, "R": 1, "hold": "predictor"}, SAMPLED, "ekf has no innovation between"),
        ({"type": "deadbeat", "hold": {"shrink": 1}}, SAMPLED, "deadbeat has no innovation between samples"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(block: Block, measurement: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(VDP, {"S": block}, measurement=measurement))


def test_a_continuous_output_holds_nothing() -> None:
    found = simulated(VDP, {"S": SHGO, "G": shrinking(2)}, step=0.01)
    assert np.array_equal(found.observers["S"].xhat, found.observers["G"].xhat)
    assert any("observer G: hold is given, but all outputs are continuous" in remark for remark in found.remarks)
