"""Samples that observers are not given because others are near, and references that lag behind: closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recordings import assessed_of, observers, of_simulation, pendulum, recording, signal

from hgorun.estimate.estimate import estimate
from hgorun.estimate.goal import Goal, split
from hgorun.estimate.holdout import thinned
from hgorun.estimate.lag import behind, lagged


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


def test_a_lag_of_an_angle_that_goes_round() -> None:
    t = np.linspace(0, 10, 1001)
    angle = 2 * t - 2 * 0.3
    shown = np.remainder(angle + np.pi, 2 * np.pi) - np.pi
    residual = np.remainder(shown - 2 * t + np.pi, 2 * np.pi) - np.pi
    assert np.max(np.abs(behind(t, shown, residual[None], 0.3, 2 * np.pi))) < 1e-12


def test_a_reference_that_lags_is_compared_with_an_estimate_that_lags() -> None:
    run = pendulum(observers("shgo"), measurement={"sampling": {"period": 0.05}}, end=3.0)
    recorded = of_simulation(run)
    plain = estimate(run.experiment.source, recorded, sensitivity=False)
    t, b = plain.time, plain.observers["shgo"].xhat[:, 1]
    shown = lagged(t, b[None], 0.3, np.zeros(t.size))[0]  # by what the observer says itself
    for lag, least, most in ((0.3, 0.0, 1e-9), (None, 0.1, 1.0)):
        beside = replace(signal("b", t, shown), lag=lag)
        found = estimate(run.experiment.source, replace(recorded, reference={"b": beside}), sensitivity=False)
        assert least <= assessed_of(found, "shgo").scores["reference_rmse"]["b"] < most
