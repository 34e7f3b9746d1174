"""Scores and bands against laws of chance, and hold-outs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recordings import PENDULUM, assessed_of, observers, recording, signal, source
from scipy.special import chdtrc

from hgorun.errors import ConfigError
from hgorun.estimate.completed import completed
from hgorun.estimate.estimate import estimate
from hgorun.estimate.gate.gate import RunningDeviation, kept_of
from hgorun.estimate.holdout import HoldOut, held_out, number_of, parse_holdout
from hgorun.estimate.prepared import prepare_estimate
from hgorun.estimate.scores.bands import Band, band_of, coverage, coverage_of_normal, since_last
from hgorun.estimate.scores.evaluated import evaluate_run
from hgorun.estimate.scores.scores import chi_squared_beyond, ljung_box, rms, scores_of, settled


@pytest.mark.parametrize("degrees", [2, 10, 24])
def test_chi_squared_is_that_of_scipy(degrees: int) -> None:
    values = np.concatenate([np.linspace(0, 60, 121), [200.0, 1400.0, 1e9]])
    found = [chi_squared_beyond(float(value), degrees) for value in values]
    np.testing.assert_allclose(found, chdtrc(degrees, values), rtol=1e-12, atol=1e-300)


def test_white_numbers_pass_the_test_of_whiteness_as_often_as_it_says() -> None:
    rng = np.random.default_rng(1)
    p = np.array([ljung_box(rng.standard_normal(400)) or 0.0 for _ in range(400)])
    assert 0.02 < np.mean(p < 0.05) < 0.09
    slow = np.convolve(rng.standard_normal(400), np.ones(3))
    assert (ljung_box(slow) or 0.0) < 1e-6
    assert ljung_box(np.zeros(5)) is None
    assert ljung_box(np.ones(100)) is None
    assert ljung_box(np.append(np.arange(99.0), 1e200)) is None


def test_a_band_covers_what_it_should() -> None:
    rng = np.random.default_rng(2)
    since = rng.uniform(0, 5, 4000)
    residuals = (0.1 + since) * rng.standard_normal(4000)
    band = band_of(residuals, since)
    assert band is not None
    assert np.all(np.diff(band.widths) > 0)  # the longer ago, the wider
    fresh = rng.uniform(0, 5, 4000)
    new = (0.1 + fresh) * rng.standard_normal(4000)
    assert 0.93 < np.mean(np.abs(new) <= band.at(fresh)) < 0.97
    assert 0.93 < (coverage(residuals, since) or 0.0) < 0.97


def test_times_that_differ_by_rounding_make_no_classes() -> None:
    """Of a clock with equal steps there is one band, and with a few gaps one more, whatever the roundings."""
    rng = np.random.default_rng(7)
    steady = np.diff(1.7e9 + 0.05 * np.arange(401))
    assert np.unique(steady).size > 1
    residuals = rng.standard_normal(400)
    one = band_of(residuals, steady)
    assert one is not None
    assert one.level == np.sort(np.abs(residuals))[381 - 1]  # rank ceil(0.95 * 401)
    gaps = np.append(steady, 2 * steady[:120])
    two = band_of(np.append(residuals, 10 * residuals[:120]), gaps)
    assert two is not None
    assert two.at(gaps).tolist() == [two.widths[0]] * 400 + [two.widths[1]] * 120


def test_what_a_kalman_filter_covers_is_told_of_its_own_band_and_the_noise() -> None:
    """Of a constant P remains what it was until the first sample, so that both bands are known by hand."""
    taken, std = np.arange(40.0), 0.5
    text = {
        "plant": {"states": ["x", "w"], "dynamics": {"x": "0", "w": "0"}, "output": "x"},
        "observers": {
            "K": {
                "type": "ekf",
                "Q": {"x": 1e-12, "w": 1e-12},
                "initial": {"x": 0.0, "w": 0.0},
                "internal": {"P": 0.25},
            }
        },
        "solver": {"step": 0.5},
        "time": {"start": 0, "end": 40, "output_step": 1},
    }
    values = np.linspace(0.0, 2.6, 40)  # 1.96 sqrt(0.25 + 0.25) = 1.386, 1.96 sqrt(0.25) = 0.980
    aside = {"x": signal("x", taken, values), "w": signal("w", taken, values)}
    found = estimate(
        source(text), recording(signal("x", [39.5, 40.0], [0.0, 0.0], std=std)), held_out=aside, sensitivity=False
    )
    one = assessed_of(found, "K")
    assert one.upper[:-1] == pytest.approx(np.full((40, 2), 0.97998), abs=1e-5)
    covered = one.scores["holdout_coverage"]
    assert covered == {"x": np.mean(values <= 1.3859), "w": np.mean(values <= 0.97998)}


def test_of_an_unknown_noise_nothing_is_covered() -> None:
    assert coverage_of_normal(np.ones(30), np.full(30, np.nan)) is None
    assert coverage_of_normal(np.ones(19), np.ones(19)) is None
    assert coverage_of_normal(np.append(np.nan, np.arange(19.0)), np.ones(20)) == 2 / 19


def test_few_residuals_make_no_band() -> None:
    assert band_of(np.ones(18), np.ones(18)) is None
    assert coverage(np.ones(19), np.ones(19)) is None
    assert coverage(np.where(np.arange(30) < 15, np.nan, 1.0), np.ones(30)) is None


@pytest.mark.parametrize("count", [20, 21, 37])
def test_of_few_residuals_each_is_judged_by_all_others(count: int) -> None:
    """One that is larger than all others is the only one outside; the largest of two equal ones is inside."""
    residuals = np.linspace(0.1, 1.0, count)
    assert coverage(residuals, np.ones(count)) == pytest.approx((count - 1) / count)
    residuals[-2] = residuals[-1]
    assert coverage(residuals, np.ones(count)) == 1.0
    one = band_of(np.arange(19.0), np.ones(19))
    assert one is not None
    assert one.widths.tolist() == [18.0]  # rank ceil(0.95 * 20) = 19, the largest
    assert Band(np.array([1.0]), np.array([2.0, 3.0])).at(np.array([0.5, 1.0, 1.5, np.inf])).tolist() == [2, 2, 3, 3]
    three = Band(np.array([1.0, 2.0]), np.array([4.0, 5.0, 6.0]))
    assert three.at(np.array([-np.inf, 1.5, 2.0, 2.5, np.nan])).tolist() == [4, 5, 5, 6, 6]


def test_the_time_since_the_last_sample_counts_what_was_known() -> None:
    taken, available = np.array([0.0, 1.0, 2.0]), np.array([0.5, 3.0, 3.0])
    times = np.array([0.0, 0.5, 2.0, 3.0])
    assert since_last(times, taken, available).tolist() == [np.inf, 0.5, 2.0, 1.0]
    assert since_last(times, taken, available, before=True).tolist() == [np.inf, np.inf, 2.0, 3.0]
    assert since_last(times[:1], np.zeros(0), np.zeros(0)).tolist() == [np.inf]


def test_the_running_deviation_is_that_of_normal_numbers_and_ignores_outliers() -> None:
    rng, deviation = np.random.default_rng(4), RunningDeviation()
    assert deviation.value == np.inf
    values = 0.3 * rng.standard_normal(61)
    values[::10] = 100.0
    for value in values:
        deviation.add(value)
    assert 0.2 < deviation.value < 0.45
    last = np.abs(values)[-61:]
    assert deviation.value == pytest.approx(1.4826 * np.median(last))
    deviation.add(float("nan"))
    for value in rng.standard_normal(2000):
        deviation.add(value)
    other = RunningDeviation()
    other.restore(deviation.state())
    kept = kept_of(deviation.state())
    assert len(kept) == 61
    assert other.value == deviation.value == pytest.approx(1.4826 * np.median(kept))
    before = deviation.state()
    deviation.add(50.0)
    assert kept_of(before) == kept
    assert kept_of(deviation.state()) == [*kept[1:], 50.0]
    small = RunningDeviation(0.5)
    found = []
    for value in (3.0, -1.0, 2.0, 0.0, 0.0):
        small.add(value)
        found.append(small.value)
    assert found == pytest.approx([np.inf, 1.4826 * 2 * 4, 1.4826 * 2 * 8 / 3, 1.4826 * 1.5 * 2, 1.4826 * 1.6])
    rest = RunningDeviation()
    rest.add(0.0)
    rest.add(0.0)
    assert rest.value == np.inf


def test_sizes() -> None:
    assert rms(np.zeros(0)) is None
    assert rms(np.array([3.0, 4.0])) == pytest.approx(12.5**0.5)
    assert rms(np.array([np.nan])) == np.inf
    assert settled(np.arange(20.0)).tolist() == list(range(2, 20))


@pytest.mark.parametrize("count", [1, 7, 129, 1000, 65536, 65537, 300_001, 1_234_567])
def test_squares_of_many_numbers_are_added_as_numpy_adds_them(count: int) -> None:
    values = np.random.default_rng(count).standard_normal(count)
    assert rms(values) == np.sqrt(np.mean(np.square(values)))
    assert rms(values[::3]) == np.sqrt(np.mean(np.square(values[::3])))


def test_whiteness_is_told_in_the_place_of_the_values() -> None:
    values = np.random.default_rng(3).standard_normal(500)
    expected = ljung_box(values)
    assert ljung_box(values, room=np.empty(600)) == expected
    assert ljung_box(values, room=values) == expected


def test_hold_outs() -> None:
    assert parse_holdout("S=5") == ("S", "5")
    assert number_of("S", "5") == HoldOut("S", 5)
    assert number_of("S", "file.csv") is None
    for text in ("S", "=5", "S="):
        with pytest.raises(ConfigError, match="--holdout"):
            parse_holdout(text)
    with pytest.raises(ConfigError, match="at least 2"):
        number_of("S", "1")
    log = recording(signal("S", np.arange(12.0), np.arange(12.0), np.arange(12.0) + 1))
    rest, aside = held_out(log, [HoldOut("S", 5)])
    assert aside["S"].values.tolist() == [2, 7]
    assert aside["S"].available.tolist() == [3, 8]
    assert rest.outputs["S"].values.tolist() == [0, 1, 3, 4, 5, 6, 8, 9, 10, 11]
    with pytest.raises(ConfigError, match="no such output"):
        held_out(log, [HoldOut("E", 5)])
    with pytest.raises(ConfigError, match="12 samples only"):
        held_out(log, [HoldOut("S", 50)])
    with pytest.raises(ConfigError, match="there is 1 sample only"):
        held_out(recording(signal("S", np.zeros(1), np.zeros(1))), [HoldOut("S", 5)])


def test_an_estimate_that_is_undefined_for_moments_leaves_the_scores_what_they_are() -> None:
    taken = np.arange(0, 4, 0.1)
    log = recording(signal("a", taken, np.sin(taken)), reference={"a": signal("a", taken, np.sin(taken))})
    config = source({"plant": PENDULUM, "observers": observers("shgo")})
    prepared = prepare_estimate(completed(config, log, "x", ""), log)
    found = evaluate_run(prepared, {}, log.reference)
    one = found.reference["a"]
    whole = scores_of(prepared, found, 0)["reference_rmse"]["a"]

    def undefined(*places: int, values: float = np.nan) -> float:
        residuals = one.residuals.copy()
        residuals[0, list(places)] = values
        changed = replace(found, reference={"a": replace(one, residuals=residuals)})
        return scores_of(prepared, changed, 0)["reference_rmse"]["a"]

    assert undefined(3, 17) == pytest.approx(whole, rel=0.1)
    assert undefined(*range(25)) == np.inf  # that is no moment
    found.carried.raw.diverged[0, 0] = 3.0
    assert undefined(39) == np.inf
