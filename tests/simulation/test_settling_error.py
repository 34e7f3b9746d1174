"""The error of a run's steps, where settling times jump: against the same filter, solved with tolerances of 1e-12."""

from __future__ import annotations

import numpy as np
import pytest
from examples import VAN_DER_POL, Block, experiment, inline, simulated
from scipy.integrate import solve_ivp

from hgorun.simulation.error_control.error_estimate import Estimate, difference
from hgorun.simulation.preparation.preparation import prepare

PENDULUM = inline({"x": "v", "v": "-sin(x) - 0.1*v"}, "x") | {"initial": {"x": 1, "v": 0}}
END, OUTPUT_STEP, Q = 5.0, 0.05, 0.01
EKF: Block = {"type": "ekf", "Q": {"v": Q}, "R": 0.01, "internal": {"P": 1e6}}
MORE: Block = {"measurement": {"sampling": {"period": 0.1}}, "end": END, "output_step": OUTPUT_STEP}


def pendulum(x: np.ndarray) -> np.ndarray:
    return np.array([x[1], -np.sin(x[0]) - 0.1 * x[1]])


def slope(_: float, w: np.ndarray) -> np.ndarray:
    """Of the plant, the estimate and its covariance."""
    x, xhat, P = w[:2], w[2:4], w[4:].reshape(2, 2)
    F = np.array([[0, 1], [-np.cos(xhat[0]), -0.1]])
    return np.concatenate([pendulum(x), pendulum(xhat), (F @ P + P @ F.T + np.diag([0, Q])).ravel()])


def filtered(period: float, R: float, P: float) -> tuple[np.ndarray, np.ndarray]:
    """Times of the output grid and the errors of the filter there, from an estimate that starts at zero."""
    w = np.concatenate([[1.0, 0.0, 0.0, 0.0], P * np.eye(2).ravel()])
    errors, per_sample = [], round(period / OUTPUT_STEP)
    for _ in range(round(END / period)):
        covariance = w[4:].reshape(2, 2)
        gain = covariance[:, 0] / (covariance[0, 0] + R)
        left = np.eye(2) - np.outer(gain, [1, 0])
        w[2:4] += gain * (w[0] - w[2])
        w[4:] = (left @ covariance @ left.T + R * np.outer(gain, gain)).ravel()
        times = np.linspace(0, period, per_sample + 1)
        run = solve_ivp(slope, (0, period), w, method="DOP853", t_eval=times, rtol=1e-12, atol=1e-18)
        errors.append((run.y[2:4] - run.y[:2])[:, :-1].T)
        w = run.y[:, -1].copy()
    return np.arange(round(END / OUTPUT_STEP)) * OUTPUT_STEP, np.concatenate(errors)


def test_an_error_below_the_bound_of_a_settling_time_is_told_by_its_size() -> None:
    """The filter is exact but for 1e-8 from the first sample on, and its settling time is whatever a step makes of it.

    Two passes have settling times of 0.45 and 1.95, which is no integration error of 300 %.
    """
    times, exact = filtered(0.1, 0.01, 1e6)
    off, told = {}, {}
    for step in (0.1, 0.02):
        result = simulated(PENDULUM, {"K": EKF}, step=step, **MORE)
        assert np.allclose(times, result.time[:-1])
        found = result.observers["K"].xhat[:-1] - result.x[:-1]
        size = 1e-6 * np.max(np.abs(result.x), axis=0)  # what is smaller counts as that
        off[step] = np.max(np.max(np.abs(found - exact), axis=0) / size)
        assert result.integration_error is not None
        told[step] = result.integration_error["K"]
    above = np.abs(exact) > 0.05 * np.max(np.abs(exact[times <= END / 3]), axis=0)
    last = [times[np.flatnonzero(column)[-1]] for column in above.T]
    np.testing.assert_allclose(result.observers["K"].metrics["settling"], last, rtol=1e-9)  # of the shorter step
    assert off[0.1] < 0.3
    assert off[0.1] / 2 < told[0.1] < 2 * off[0.1]
    assert told[0.02] < off[0.02]


def passes(apart: float, later: float) -> float:
    """The relative difference of two passes with an error exp(-t), so far apart at its end, and its settling time."""
    run = prepare(experiment(VAN_DER_POL, {"S": {"type": "shgo", "theta": 1}}, end=10.0))
    x = np.ones((101, 2))
    fine, coarse = x.copy(), x.copy()
    fine += np.exp(-np.linspace(0, 10, 101))[:, None]
    coarse += fine - x
    coarse[-1, 1] += apart
    metrics = {"peak": np.ones(2), "settling": np.array([3.0, 3.0])}
    moved = metrics | {"settling": np.array([3.0, 3.0 + later])}
    return float(
        difference(
            run,
            Estimate(x=x, xhat=fine, metrics=metrics),
            Estimate(x=x, xhat=coarse, metrics=moved),
            np.ones(2),
            np.ones(2),
        )
    )


def test_a_jump_of_a_settling_time_counts_where_the_errors_tell_when() -> None:
    """Its bound is 0.05, and it is right within a step of its grid, of 0.1."""
    assert passes(0.0, 6.0) == pytest.approx(5.9 / 3)
    assert passes(0.04, 6.0) == pytest.approx(5.9 / 3)
    assert passes(0.06, 6.0) == pytest.approx(0.06)
    assert passes(0.0, 0.1) == 0


def test_what_moves_truth_and_estimate_alike_is_no_difference_of_errors() -> None:
    """The two passes are 0.2 apart in the truth, and their errors are the same: the settling time counts."""
    run = prepare(experiment(VAN_DER_POL, {"S": {"type": "shgo", "theta": 1}}, end=10.0))
    x, xhat = np.ones((101, 2)), 1 + np.exp(-np.linspace(0, 10, 101))[:, None] * np.ones(2)
    a = Estimate(x=x, xhat=xhat, metrics={"peak": np.ones(2), "settling": np.array([3.0, 3.0])})
    b = Estimate(x=x + 0.2, xhat=xhat + 0.2, metrics={"peak": np.ones(2), "settling": np.array([3.0, 9.0])})
    assert float(difference(run, a, b, np.ones(2), np.ones(2))) == pytest.approx(5.9 / 3)


def test_what_gains_make_of_rounding_is_no_error_of_a_state_that_rests() -> None:
    """Of a state at 0 whose estimate has peaked at 1000, an error of 1e-8 or twice that is 1e-11 of it."""
    run = prepare(experiment(VAN_DER_POL, {"S": {"type": "shgo", "theta": 1}}, end=10.0))
    peak = 1000 * np.exp(-np.linspace(0, 100, 101))[:, None] * np.array([0, 1])

    def two(rest: float) -> float:
        x = np.tile([1.0, rest], (101, 1))
        a, b = ({"peak": np.array([1e-3, 1000]), "sup": np.array([0, sup])} for sup in (1e-8, 2e-8))
        one, other = (Estimate(x=x, xhat=x + peak, metrics=metrics) for metrics in (a, b))
        return float(difference(run, one, other, np.max(np.abs(x), axis=0), np.ones(2)))

    assert two(0.0) == pytest.approx(0.01)
    assert two(0.001) == pytest.approx(1.0, rel=0.01)
