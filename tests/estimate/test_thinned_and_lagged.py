"""Samples that observers are not given because others are near, and references that lag behind: closed forms."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from examples import inline
from recordings import assessed_of, observers, of_simulation, pendulum, recording, signal, source

from hgorun.estimate.estimate import estimate
from hgorun.estimate.gains.goal import Goal, split
from hgorun.estimate.holdout import thinned
from hgorun.estimate.scores import lag as lags
from hgorun.estimate.scores.lag import Instrument, felt_of, points_between
from hgorun.result.result import Result


def lagged(t: np.ndarray, x: np.ndarray, lag: float, shown: np.ndarray) -> np.ndarray:
    """What an instrument shows at all times at which it is told what there is."""
    instrument = Instrument(t, lag, len(x))
    seen, first = np.unique(t, return_index=True)
    instrument.see(seen, x[:, first])
    return shown - instrument.residuals(shown)


def test_every_fifth_of_samples_that_jitter() -> None:
    rng = np.random.default_rng(1)
    t = 3.6 + 0.004 * np.arange(2000) + 2e-4 * rng.uniform(-1, 1, 2000)
    given, between = thinned(recording(signal("a", t, t)), 0.02)
    assert np.array_equal(given.outputs["a"].taken, t[::5])
    assert between["a"].taken.size == 1600
    assert np.array_equal(between["a"].values, between["a"].taken)


def test_each_output_counts_its_own_gaps() -> None:
    t = np.array([0.0, 0.1, 0.2, 0.9, 0.95, 1.0, 3.0])
    given, between = thinned(recording(signal("a", t, t), signal("b", t[::3], t[::3])), 0.5)
    assert given.outputs["a"].taken.tolist() == [0.0, 0.9, 3.0]
    assert given.outputs["b"].taken.tolist() == [0.0, 0.9, 3.0]
    assert set(between) == {"a"}


@pytest.mark.parametrize("period", [None, 0.1])
def test_nothing_is_held_out_where_samples_are_far_apart(period: float | None) -> None:
    t = 0.1 * np.arange(10)
    given, between = thinned(recording(signal("a", t, t)), period)
    assert given.outputs["a"].taken.size == 10
    assert not between


def test_gains_are_sought_in_every_other_gap_and_judged_in_the_others() -> None:
    t = 0.1 * np.arange(31)
    given, between = thinned(recording(signal("a", t, t)), 0.5)
    found = split(given, Goal("holdout_rmse", "o", "*"), between)
    assert found.given.outputs["a"].taken.size == 7
    assert np.unique(np.floor(found.search["a"].taken / 0.5 + 1e-9)).tolist() == [1.0, 3.0, 5.0]
    assert np.unique(np.floor(found.report["a"].taken / 0.5 + 1e-9)).tolist() == [0.0, 2.0, 4.0]


def test_a_lag_of_a_ramp_and_of_a_constant() -> None:
    """lag v' = a + b t - v has v = a + b (t - lag) + c exp(-t/lag)."""
    t = np.array([0.0, 0.1, 0.1, 0.35, 0.5, 2.0])
    x = np.array([1.5 - 3.0 * t, np.full(t.size, 2.0)])
    found = lagged(t, x, 0.2, np.full(t.size, 4.0))
    decay = np.exp(-t / 0.2)
    assert found[0] == pytest.approx(1.5 - 3.0 * (t - 0.2) + (4.0 - 1.5 - 0.6) * decay, abs=1e-14)
    assert found[1] == pytest.approx(2.0 + 2.0 * decay, abs=1e-14)


def test_behind_a_moment_that_is_not_known_the_instrument_is_read_again() -> None:
    t = np.arange(5.0)
    x = np.array([[1.0, np.nan, 1.0, 1.0, 1.0]])
    found = lagged(t, x, 1.0, np.array([5.0, 6.0, 7.0, 8.0, 9.0]))[0]
    assert found[[0, 2, 3]] == pytest.approx([5.0, 7.0, 1 + 6 * np.exp(-1)])
    assert np.isnan(found[1])


@pytest.mark.parametrize("every", [1, 100, 250])
def test_a_lag_of_an_angle_that_goes_round(every: int) -> None:
    """Also where it goes round more than once from one reading to the next."""
    t = np.linspace(0, 10, 1001)
    angle = 5 * t - 5 * 0.3
    shown = np.remainder(angle + np.pi, 2 * np.pi)[::every] - np.pi
    instrument = Instrument(t[::every], 0.3, 1, 2 * np.pi)
    instrument.see(t, np.remainder(5 * t + 1.0, 2 * np.pi)[None] - 1.0)
    assert np.max(np.abs(instrument.residuals(shown))) < 1e-12


@pytest.mark.parametrize("period", [None, 1.5])
def test_what_an_instrument_sees_in_pieces_is_what_it_sees_at_once(period: float | None) -> None:
    rng = np.random.default_rng(2)
    t, x = np.sort(rng.uniform(0, 9, 300)), rng.standard_normal((2, 300)) * 2
    x[1, 130:135] = np.nan
    taken, shown = t[5:280:11], rng.standard_normal(25)
    found = []
    for ends in ([0, 300], [0, 40, 40, 41, 132, 299, 300]):
        one = Instrument(taken, 0.7, 2, period)
        for first, stop in pairwise(ends):
            one.see(t[first:stop], x[:, first:stop])
        found.append(one.residuals(shown))
    np.testing.assert_array_equal(found[0], found[1])
    assert np.isfinite(found[0][0]).all()


def test_estimates_are_wanted_where_something_is_left_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = np.array([0.0, 0.5, 0.5, 100.0])
    between = points_between(taken, 0.25, 0.125)
    assert sorted(between) == pytest.approx([0.125, 0.25, 0.375, *np.arange(90.0, 100.0, 0.125)])
    assert felt_of(np.array([-1.0, 0.0, 0.3, 89.0, 91.0, 101.0]), taken, 0.25).tolist() == [0.3, 91.0]
    monkeypatch.setattr(lags, "_MOST", 21)
    assert sorted(points_between(taken, 0.25, 0.125)) == pytest.approx(np.arange(90.0, 100.0, 0.5).tolist())


@pytest.mark.parametrize("period", [0.25, 2.0])
def test_a_reference_that_is_read_now_and_then_sees_what_happens_between(period: float) -> None:
    """x'' = -4 x from (1, 0): the readings of x' with a lag T are Re 2i/(1 + 2i T) (exp(2i t) - exp(-t/T))."""
    t, taken = 0.05 * np.arange(401), np.arange(0.0, 20.0, period)
    shown = np.real(2j / (1 + 2j) * (np.exp(2j * taken) - np.exp(-taken)))
    log = recording(signal("a", t, np.cos(2 * t)), reference={"b": signal("b", taken, shown, lag=1.0)})
    config = inline({"a": "b", "b": "-4*a"}, "a")
    del config["initial"]
    blocks = observers("shgo", initial={"a": 1.0, "b": 0.0})
    more = {"solver": {"step": 0.01}, "time": {"start": 0.0, "end": 20.0, "output_step": 5.0}}
    found = estimate(source({"plant": config, "observers": blocks, **more}), log, sensitivity=False)
    assert assessed_of(found, "shgo").scores["reference_rmse"]["b"] < 1e-4


@pytest.mark.parametrize("late", [0.0, 0.13])
def test_an_instrument_sees_estimates_jump(late: float) -> None:
    """Against the lag of estimates every millisecond, by the trapezoidal rule on either side of every jump."""
    rng = np.random.default_rng(4)
    t, taken = np.arange(0.3, 6.0, 0.3), np.array([0.1, 2.0, 2.7, 5.5])
    outputs = signal("x", t, rng.standard_normal(t.size), t + late)
    shown = rng.standard_normal(taken.size)
    plant = {key: value for key, value in inline({"x": "-x/3"}, "x").items() if key != "initial"}
    block = {"type": "ekf", "Q": {"x": 3.0}, "R": 0.1, "initial": {"x": 1.0}, "internal": {"P": 1.0}}
    config = {"plant": plant, "observers": {"K": block}, "solver": {"step": 0.05}}

    def found(step: float) -> Result:
        time = {"start": 0.0, "end": 6.2, "output_step": step}
        log = recording(outputs, reference={"x": signal("x", taken, shown, lag=0.4)})
        return estimate(source(config | {"time": time}), log, sensitivity=False)

    fine, coarse = found(0.001), found(1.0)
    x, v, expected = fine.observers["K"].xhat[:, 0], shown[0], [0.0]
    decay = np.exp(-0.001 / 0.4)
    for k in range(100, 5500):
        v = decay * v + (1 - decay) * (x[k] * np.exp(-0.001 / 6))  # up to where it may jump
        if k + 1 in (2000, 2700, 5500):
            expected.append(shown[len(expected)] - v)
    found_rmse = assessed_of(coarse, "K").scores["reference_rmse"]["x"]
    assert found_rmse == pytest.approx(np.sqrt(np.mean(np.square(expected))), rel=2e-4)


def test_a_reference_that_lags_is_compared_with_an_estimate_that_lags() -> None:
    run = pendulum(observers("shgo"), measurement={"sampling": {"period": 0.05}}, end=3.0, output_step=0.01)
    recorded = of_simulation(run)
    plain = estimate(run.experiment.source, recorded, sensitivity=False)
    t, b = plain.time, plain.observers["shgo"].xhat[:, 1]
    shown = lagged(t, b[None], 0.3, np.zeros(t.size))[0]  # by what the observer says itself
    for lag, least, most in ((0.3, 0.0, 1e-5), (None, 0.1, 1.0)):
        beside = replace(signal("b", t, shown), lag=lag)
        found = estimate(run.experiment.source, replace(recorded, reference={"b": beside}), sensitivity=False)
        assert least <= assessed_of(found, "shgo").scores["reference_rmse"]["b"] < most
