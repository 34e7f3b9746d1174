"""Kalman filters at rest: closed forms, a naive filter, and what the simulated filter comes to."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, experiment, inline
from scipy.linalg import expm

import hgorun
from hgorun.analysis.findings.kalman import stationary_error, stationary_gain, stationary_poles
from hgorun.analysis.linear.stationary import Model, continuous, sampled
from hgorun.analysis.reasons import NoValue

ASKED = (stationary_gain, stationary_poles, stationary_error)
CHAIN = np.array([[0.0, 1.0], [0.0, 0.0]])
FIRST = np.array([[1.0, 0.0]])


def chain(q: float, R: float) -> Model:
    """A double integrator, its acceleration noise."""
    return Model(CHAIN, FIRST, np.diag([0.0, q]), np.array([[R]]))


@pytest.mark.parametrize(("q", "R"), [(1.0, 1.0), (3e-5, 0.2), (40.0, 1e-6)])
def test_a_chain_has_butterworth_poles(q: float, R: float) -> None:
    found, theta = continuous(chain(q, R)), (q / R) ** 0.25
    np.testing.assert_allclose(found.K[:, 0], [np.sqrt(2) * theta, theta**2], rtol=1e-8)
    np.testing.assert_allclose(np.sort_complex(found.poles), theta * np.sqrt(0.5) * np.array([-1 - 1j, -1 + 1j]))
    np.testing.assert_allclose(found.P[0, 0], np.sqrt(2) * R * theta, rtol=1e-8)


def test_a_sampled_filter_comes_to_what_a_naive_one_does() -> None:
    rng = np.random.default_rng(2)
    F, H = rng.standard_normal((3, 3)), rng.standard_normal((2, 3))
    Q, R, period = np.diag([0.1, 0.0, 0.3]), np.diag([0.2, 0.05]), 0.3
    fine = 3000
    A_fine, A = expm(F * period / fine), expm(F * period)
    Q_T = np.zeros((3, 3))  # the integral by the rule of the middle
    at = expm(F * period / fine / 2)
    for _ in range(fine):
        Q_T += at @ Q @ at.T * period / fine
        at = A_fine @ at
    P = np.eye(3)
    for _ in range(400):
        before = A @ P @ A.T + Q_T
        K = before @ H.T @ np.linalg.inv(H @ before @ H.T + R)
        P = (np.eye(3) - K @ H) @ before
    found = sampled(Model(F, H, Q, R), period)
    np.testing.assert_allclose(found.K, K, rtol=1e-6)
    np.testing.assert_allclose(found.P, P, rtol=1e-6)
    np.testing.assert_allclose(
        np.sort_complex(found.poles), np.sort_complex(np.linalg.eigvals((np.eye(3) - K @ H) @ A))
    )


@pytest.mark.parametrize("solve", [continuous, lambda model: sampled(model, 0.1)])
def test_a_filter_that_never_rests_has_no_gain_and_the_reason_is_said(solve: object) -> None:
    assert callable(solve)
    for model in (
        chain(0.0, 1.0),  # nothing is trusted in the end
        Model(CHAIN, FIRST[:, ::-1], np.eye(2), np.eye(1)),  # the position is not seen
    ):
        with pytest.raises(NoValue, match="no solution with a stable error"):
            solve(model)


PLANT = inline({"a": "b", "b": "-2*a - 0.3*b - 0.1*a**3"}, "a", initial={"a": 0.4, "b": 0.0})


@pytest.mark.parametrize("kind", ["ekf", "kalman_bucy"])
def test_what_the_simulated_filter_comes_to_is_what_it_is_at_rest(kind: str) -> None:
    block: Block = {"type": kind, "Q": {"b": 0.1}, "R": 0.01, "initial": {"a": 0.4}}
    measurement = {"sampling": {"period": 0.1}} if kind == "ekf" else {}
    blocks = {"K": block, "S": {"type": "shgo", "theta": 2, "poles": -1}}
    analysis = hgorun.analyze(experiment(PLANT, blocks, end=12, measurement=measurement), ASKED)
    found = analysis.as_json("x")["observers"]
    P = analysis.result.observers["K"].internal["P"][-1]
    gain = [found["K"]["stationary_gain"][state][0] for state in "ab"]
    np.testing.assert_allclose(gain, P[:, 0] / 0.01, rtol=5e-3)  # behind a sample, too: P+ H^T R^-1
    error = [found["K"]["stationary_error"][state] for state in "ab"]
    np.testing.assert_allclose(error, np.sqrt(np.diag(P)), rtol=5e-3)
    assert len(found["K"]["stationary_poles"]) == 2
    assert not found["S"].keys() & {one.name for one in ASKED}


def test_uneven_samples_have_no_stationary_gain() -> None:
    block: Block = {"type": "ekf", "Q": {"b": 0.1}, "R": 0.01}
    times = [0.1, 0.2, 0.4, 0.7, 0.9]
    run = experiment(PLANT, {"K": block}, end=1, measurement={"sampling": {"times": times}})
    found = hgorun.analyze(run, ASKED).as_json("x")["observers"]["K"]
    assert found["stationary_gain"] is None
    assert "uneven times" in found["reasons"]["stationary_gain"]
