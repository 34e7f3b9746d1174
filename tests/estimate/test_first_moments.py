"""Automatic steps of filters whose first moments are faster than all else, and observers that steps alone lose."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from recordings import recording, signal, source
from scipy.integrate import solve_ivp

from hgorun.estimate import prepared
from hgorun.estimate.carrying import lost_apart
from hgorun.estimate.completed import completed
from hgorun.estimate.estimate import estimate, estimate_prepared
from hgorun.estimate.prepared import prepare_estimate
from hgorun.result.result import Result
from hgorun.simulation.preparation.first_step import first_moments, nominal_step

PLANT = {"states": ["x", "v"], "dynamics": {"x": "v", "v": "-x"}, "output": "x"}
KALMAN = {"KB": {"type": "kalman_bucy", "Q": {"v": 0.001}}}
TAKEN = np.arange(41) / 10


def of_log(observers: dict[str, Any], std: float, **more: Any) -> tuple[Any, Any]:
    values = np.cos(TAKEN) + std * np.random.default_rng(2).normal(size=TAKEN.size)
    return source({"plant": PLANT, "observers": observers, **more}), recording(signal("x", TAKEN, values, std=std))


def estimated(observers: dict[str, Any], std: float, **more: Any) -> Result:
    return estimate(*of_log(observers, std, **more), sensitivity=False)


def riccati(R: float, times: np.ndarray) -> np.ndarray:
    """P(t) of x' = v, v' = -x with Q = diag(0, 0.001) and P(0) = I, as P11, P12, P22."""

    def slope(t: float, P: np.ndarray) -> list[float]:
        a, b, c = P
        return [2 * b - a * a / R, c - a - a * b / R, -2 * b + 0.001 - b * b / R]

    return np.asarray(solve_ivp(slope, (0.0, times[-1]), [1.0, 0.0, 1.0], "LSODA", times, rtol=1e-9, atol=1e-13).y.T)


@pytest.mark.parametrize("std", [0.01, 0.001])
def test_a_large_first_covariance_is_followed(std: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepared, "nominal_step", lambda _: 0.004)  # as of a long log, in few steps
    result = estimated(KALMAN, std)
    found = result.observers["KB"]
    assert found.verdict.status == "ok"
    P = found.internal["P"].reshape(-1, 4)[:, [0, 1, 3]]
    np.testing.assert_allclose(P[1:], riccati(std**2 * 0.1, result.time)[1:], rtol=1e-5)
    assert abs(float(found.xhat[-1, 0]) - np.cos(4.0)) < 5 * std + 0.02


def test_times_close_behind_the_start() -> None:
    experiment = completed(*of_log(KALMAN, 0.01), "estimate", "")
    rate, step = 2 / (0.01**2 * 0.1), 0.004
    times = first_moments(experiment, step, 0.0)
    steps = np.diff(np.concatenate([[0.0], times]))
    assert steps[0] == pytest.approx(0.05 / rate)
    assert step / 1.05 < steps[-1] < step * 1.05
    apart = first_moments(experiment, step, 3 * steps[0])
    np.testing.assert_array_equal(apart, times[steps > 3 * steps[0]])
    np.testing.assert_allclose(steps[1:] * 2 / (times[:-1] + 2 / rate), 0.05, rtol=1e-9)
    slow = completed(*of_log(KALMAN, 1.0), "estimate", "")
    assert first_moments(slow, nominal_step(slow), 0.0).size == 0
    given = completed(*of_log(KALMAN, 0.01, solver={"step": step}), "estimate", "")
    assert first_moments(given, step, 0.0).size == 0


def test_steps_are_halved_for_an_observer_that_they_lose() -> None:
    result = estimated({"UKF": {"type": "ukf", "theta": 3}, "SHGO": {"type": "shgo", "theta": 3, "poles": -1}}, 0.01)
    assert [one.verdict.status for one in result.observers.values()] == ["ok", "ok"]


def test_given_steps_that_lose_an_observer_are_said_to_be_too_long() -> None:
    result = estimated({"SHGO": {"type": "shgo", "theta": 40, "poles": -1}}, 0.01, solver={"step": 0.09})
    verdict = result.observers["SHGO"].verdict
    assert verdict.status == "inaccurate"
    assert verdict.reason is not None
    assert "diverges with steps of 0.09" in verdict.reason
    assert "give a shorter solver.step" in verdict.reason
    assert estimated({"SHGO": {"type": "shgo", "theta": 200, "poles": -1}}, 0.01).observers["SHGO"].status == "diverged"


def test_given_steps_that_a_first_covariance_is_too_fast_for() -> None:
    """It is lost in the first step, as one may be that is lost with any step: its rate tells that it is not."""
    verdict = estimated(KALMAN, 0.01, solver={"step": 0.05}).observers["KB"].verdict
    assert (verdict.status, verdict.at) == ("inaccurate", 0.05)


def at_once(plant: dict[str, Any], observer: dict[str, Any], gap: float, step: float, *, with_error: bool) -> Result:
    """Samples of y = 2 all along."""
    taken = gap * np.arange(round(2 / gap) + 1)
    log = recording(signal("y", taken, np.full(taken.size, 2.0)))
    text = {"plant": plant, "observers": {"O": observer}, "time": {"start": 0.0, "end": 2.0, "output_step": 0.5}}
    experiment = completed(source(text | {"solver": {"step": step}}), log, "estimate", "")
    return estimate_prepared(prepare_estimate(experiment, log), log, {}, with_error=with_error)


@pytest.mark.parametrize("with_error", [True, False])
@pytest.mark.parametrize(("gap", "step"), [(1.0, 0.25), (1.0, 0.03125), (0.125, 1.0), (0.00390625, 0.25)])
def test_a_first_step_that_is_too_long_is_told_where_no_rate_is_known(
    gap: float, step: float, with_error: bool
) -> None:
    """Since the output is no state: h = x + x^3 has the slope 4 where it is 2, so that P = 1/(1 + 16 t/R)."""
    plant = {"states": ["x"], "dynamics": {"x": "0"}, "output": {"y": "x + x**3"}}
    filtered = {"type": "kalman_bucy", "Q": {"x": 1e-12}, "R": 0.01, "initial": {"x": 1.0}, "internal": {"P": [[1.0]]}}
    verdict = at_once(plant, filtered, gap, step, with_error=with_error).observers["O"].verdict
    assert verdict.status == "inaccurate"
    assert verdict.at is not None
    assert verdict.at <= step
    assert f"it diverges with steps of {step:.3g}, but not at that time with others" in str(verdict.reason)
    if gap == step * 4:
        followed = at_once(plant, filtered, gap, 2.0**-12, with_error=with_error).observers["O"]
        assert followed.status == "ok"
        P = followed.internal["P"].ravel()
        np.testing.assert_allclose(P[1:], 1 / (1 + 16 * np.arange(0.5, 2.1, 0.5) / 0.01), rtol=1e-3)


@pytest.mark.parametrize("with_error", [True, False])
def test_an_escape_within_any_step_is_told_as_one(with_error: bool) -> None:
    """x'' = x^3 from x = 1e13 on is infinite after 2.6e-13."""
    plant = {"states": ["x", "v"], "dynamics": {"x": "v", "v": "x**3"}, "output": {"y": "x"}}
    start = {"type": "shgo", "theta": 3, "initial": {"x": 1e13, "v": 0.0}}
    verdict = at_once(plant, start, 0.5, 0.25, with_error=with_error).observers["O"].verdict
    assert (verdict.status, verdict.at) == ("diverged", 0.25)


def test_when_losses_are_apart() -> None:
    inf = np.inf
    own = np.array([inf, 1.0, 1.0, inf, 1.0, 0.0])
    other = np.array([inf, 1.04, 1.6, 2.0, inf, 0.0])
    assert lost_apart(own, other).tolist() == [False, False, True, True, True, False]


@pytest.mark.parametrize(
    ("kind", "P", "std", "told"),
    [
        ("kalman_bucy", 1e4, 1e-3, "its P(0) of 1e+04 is too large beside R"),
        ("kalman_bucy", 5e3, 1e-3, "its P(0) of 5e+03 is too large beside R"),  # lost on the way
        ("kalman_bucy", 620.0, 1e-3, None),
        ("ekf", 1e5, 1e-3, None),
    ],
)
def test_a_first_covariance_that_no_step_resolves_is_named(
    kind: str, P: float, std: float, told: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prepared, "nominal_step", lambda _: 0.004)
    result = estimated({"KB": {"type": kind, "Q": {"v": 0.001}, "internal": {"P": P}}}, std)
    verdict = result.observers["KB"].verdict
    assert verdict.status == ("inaccurate" if told else "ok")
    if told:
        assert verdict.reason is not None
        assert verdict.reason.startswith(told)
        assert f"a P(0) up to 6.3e+02 would do (internal: {{P: ...}}), or an R {P / 625:.2g} times" in verdict.reason
