"""Faults of a column are found where they are planted, and nowhere in what is merely smooth, coarse, or at rest."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from hgorun.data.faults import faults
from hgorun.data.faults import filled as fills
from hgorun.data.faults.faults import Stretch
from hgorun.data.faults.filled import filled

TIME = np.arange(2000) * 0.02
RANDOM = np.random.default_rng(1)
SMOOTH = 5 + 3 * np.sin(TIME)
NOISY = SMOOTH + 0.05 * RANDOM.normal(size=TIME.size)
NOISE = np.random.default_rng(3).normal(size=400)
HARMLESS = {
    "smooth": SMOOTH,
    "noisy": NOISY,
    "ramp": 3 * TIME,
    "decay": 20 * np.exp(-TIME / 5),
    "counter": np.floor(3 * TIME),
    "square": np.sign(np.sin(TIME)),
    "two levels": 2 * np.sign(np.sin(TIME)) + 0.01 * RANDOM.normal(size=TIME.size),
    "around zero": 1e-3 * RANDOM.normal(size=TIME.size),
    "steps, filtered": lfilter([0.1], [1, -0.9], np.sign(np.sin(0.5 * TIME))),
    "saturation": 3 / (1 + np.exp(20 - TIME)),
    "walk": np.cumsum(RANDOM.normal(size=TIME.size)),
    "converter": np.rint((50 + 20 * np.sin(TIME)) / 0.0244) * 0.0244,
    "slow converter": np.rint((50 + 20 * np.sin(TIME / 8)) / 0.00611) * 0.00611,
    "angle": np.rint((np.cumsum(0.3 * np.sin(3 * TIME)) % 6.28) * 326) / 326,
}


@pytest.mark.parametrize("digits", [None, 1, 2, 3, 4, 6])
@pytest.mark.parametrize("name", HARMLESS)
def test_nothing_is_found_in_what_is_no_fault(name: str, digits: int | None) -> None:
    values = HARMLESS[name] if digits is None else HARMLESS[name].round(digits)
    assert filled(TIME, values) == []
    assert faults.slips(values) == []


PLACE = np.arange(600.0)
RATE = np.where(PLACE % 100 < 60, 43 * (1 + 0.003 * np.resize(NOISE, 600)), 0.0)
MACHINES = {
    "totaliser": np.cumsum(RATE).round(),
    "totaliser of two rates": np.cumsum(np.where(PLACE % 100 < 50, 7.3, np.where(PLACE % 100 < 80, 1.1, 0.0))).round(1),
    "angle": PLACE * 0.93 % 8,
    "scale": np.interp(PLACE % 150, [0.3, 40, 60.4, 70, 150], [0, 413, 413, 0, 0]).round(),
    "tank": np.interp(PLACE % 200, [0, 150.3, 190, 200], [0.1, 1.9, 1.9, 0.1]).round(2),
    "conveyor": np.interp(PLACE % 80, [0, 30.2, 40, 70.7, 80], [0, 1200, 1200, 0, 0]).round(),
    "crane": np.interp(PLACE, [0, 50, 80.5, 200, 260.3, 400, 420, 600], [0, 0, 33.3, 33.3, 12.1, 12.1, 40, 40]).round(
        2
    ),
    "crane that begins as it moves": np.interp(
        PLACE, [0, 50.5, 200, 580.2, 596.5, 600], [0, 33.3, 33.3, 12.1, 9, 9]
    ).round(2),
}


@pytest.mark.parametrize("name", MACHINES)
def test_lines_of_a_machine_are_not_filled_in(name: str) -> None:
    assert filled(PLACE, MACHINES[name]) == []


def test_lines_from_any_value_to_any_other_are() -> None:
    """Also beside some that begin and end where the signal rests."""
    values = NOISY[:400].copy()
    values[100:130] = np.linspace(values[100], values[129], 30)
    for start in (200, 260):
        values[start : start + 40] = 5.0
        values[start + 10 : start + 30] = np.linspace(5.0, 5.0 + start / 20, 20)
        values[start + 30 : start + 40] = 5.0 + start / 20
    assert [stretch.start for stretch in filled(TIME[:400], values)] == [100]


@pytest.mark.parametrize("digits", [None, 4, 6])
def test_a_column_filled_between_few_samples_is_found(digits: int | None) -> None:
    few = np.arange(0, 2000, 25)
    values = np.interp(TIME, TIME[few], NOISY[few])
    found = filled(TIME, values if digits is None else values.round(digits))
    assert sum(stretch.size for stretch in found) > 1900


def test_a_column_filled_at_uneven_times_is_found() -> None:
    uneven = np.sort(TIME + 0.015 * np.random.default_rng(2).random(TIME.size))
    few = np.arange(0, 2000, 25)
    found = filled(uneven, np.interp(uneven, uneven[few], NOISY[few]))
    assert [(s.start, s.stop) for s in found[:2]] == [(0, 26), (25, 51)]


@pytest.mark.parametrize("digits", [None, 3, 6])
def test_a_filled_gap_is_found(digits: int | None) -> None:
    values = NOISY.copy()
    values[500:560] = np.linspace(values[500], values[559], 60)
    found = filled(TIME, values if digits is None else values.round(digits))
    assert found == [Stretch(500, 560)]


def long_log(seed: int, rows: int = 200_000) -> np.ndarray:
    """A swing in 5 digits whose noise is five steps of these: three of its samples are often on a line."""
    place = np.arange(rows)
    noise = 5 * np.random.default_rng(seed).standard_normal(rows)
    return np.rint(3000 * np.sin(2 * np.pi * place / 3000) + noise) * 0.001


def with_line(values: np.ndarray, start: int, points: int) -> np.ndarray:
    """The same with points on a line between two sharp bends."""
    values = values.copy()
    values[start : start + points] = values[start] + 0.006 * np.arange(points)
    values[[start - 1, start + points]] = values[start] + 0.02, values[start + points - 1] - 0.02
    return values.round(3)


def test_a_line_that_noise_may_draw_in_a_long_log_is_not_filled_in() -> None:
    """Some ten samples in 200,000 are on a line by accident, once in thousands of logs; in 2,000 they are not."""
    values, short = long_log(0), slice(100_000, 102_000)
    time = 0.01 * np.arange(values.size)
    for points in (10, 11, 12):
        lined = with_line(values, 101_000, points)
        assert filled(time, lined) == []
        assert filled(time[short], lined[short]) == [Stretch(1000, 1000 + points)]
    for points in (16, 60):
        assert filled(time, with_line(values, 101_000, points)) == [Stretch(101_000, 101_000 + points)]
    assert filled(time, with_line(values, 101_000, 11) + 1e-5 * long_log(1)) == []  # in all digits it is no line


@pytest.mark.parametrize("seed", range(2))
def test_lines_are_by_accident_no_longer_than_the_law_says(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """Of the length of which one is to be expected at the most there is hardly any; shorter ones are many."""
    values = long_log(seed, 100_000)
    time = 0.01 * np.arange(values.size)
    monkeypatch.setattr(fills, "LINE", 4)
    lines = []
    for expected in (1.0, 1e9):
        monkeypatch.setattr(fills, "_BY_ACCIDENT", expected)
        lines.append(len(filled(time, values)))
    few, all_of_them = lines
    assert few <= 2
    assert 40 < all_of_them < 200


def test_a_smooth_signal_between_spikes_is_not_filled_in() -> None:
    """Any three of its samples are on a line, to its digits, but not all from one spike to the next."""
    values = SMOOTH.round(3)
    values[[300, 320, 640, 655, 1200]] += 0.5
    assert filled(TIME, values) == []
    slow = (20 + 0.5 * np.sin(TIME)).round(3)
    slow[1500:] += 3
    slow[500:560] = np.linspace(slow[500], slow[500] + 3, 60).round(3)
    assert filled(TIME, slow) == [Stretch(500, 560)]


@pytest.mark.parametrize("digits", [None, 1, 3])
def test_a_stuck_sensor_is_found(digits: int | None) -> None:
    values = NOISY.copy() if digits is None else NOISY.round(digits)
    values[900:1000] = values[900]
    (found,) = faults.stuck(values)
    assert found.start <= 900 < 1000 <= found.stop < 1003


@pytest.mark.parametrize(("count", "stuck"), [(30, 1), (30, 2), (300, 2), (1500, 5)])
def test_a_sensor_that_is_stuck_again_is_found_each_time(count: int, stuck: int) -> None:
    """Neither is the usual length of the other."""
    starts = count // stuck * np.arange(stuck) + count // 2 // stuck
    values = np.insert(NOISY[:count], np.repeat(starts + 1, 24 + np.arange(stuck)), 0.0)
    first = starts + np.cumsum(np.append(0, 24 + np.arange(stuck - 1)))
    expected = [Stretch(int(k), int(k) + 25 + i) for i, k in enumerate(first)]
    for one in expected:
        values[one.start : one.stop] = values[one.start]
    assert faults.stuck(values) == expected


@pytest.mark.parametrize("move", [10, 20])
def test_a_machine_that_rests_between_short_moves_is_not_stuck(move: int) -> None:
    ways = np.cumsum(np.tile([*np.linspace(3.0, 4.0, move), *np.zeros(40)], 12))
    assert not faults.stuck(np.floor(ways))


def test_a_slow_signal_in_coarse_digits_is_not_stuck_and_one_that_moves_meanwhile_is() -> None:
    slow = np.round(7 + 0.003 * np.cumsum(np.resize(NOISE, 900)), 2)
    hours = np.floor(np.cumsum(np.arange(790) % 90 < 40) / 6) / 10
    converter = np.rint((50 + 20 * np.sin(np.arange(4000) / 500)) / 0.0244) * 0.0244
    for values in (slow, hours, converter.round(3)):
        assert faults.stuck(values) == []
    held = np.append(hours, np.full(60, hours[-1]))
    assert [stretch.stop for stretch in faults.stuck(held)] == [held.size]
    jumps = slow.copy()
    jumps[600:] += 0.3
    jumps[500:600] = jumps[500]
    assert [stretch.stop for stretch in faults.stuck(jumps)] == [600]


@pytest.mark.parametrize("factor", [1000, 1e-3, 100, 60, 1 / 3600, 1e6])
@pytest.mark.parametrize("count", [20, 2000])
def test_a_slip_of_the_unit_is_found(factor: float, count: int) -> None:
    values = NOISY[:count].copy()
    values[count // 3 :] *= factor
    ((place, said),) = faults.slips(values)
    assert place == count // 3
    assert said == (f"a factor {factor:g}" if factor > 1 else f"a factor 1/{1 / factor:g}")


ON = (np.arange(400) // 30) % 2 == 1
CYCLE = np.tile([*np.full(30, 0.02), *np.linspace(0.03, 2, 60), *np.full(30, 2.0)], 3)
SWITCHED = {
    "flow": np.where(ON, 2.0, 0.02),
    "noisy flow": np.where(ON, 2 + 0.02 * NOISE, 0.02 + 0.004 * NOISE),
    "noise of its size": np.where(ON, 2.0, 0.02) * (1 + 0.02 * NOISE),
    "rounded": np.where(ON, 2 + 0.01 * NOISE, 0.02 + 0.003 * NOISE).round(2),
    "three levels": np.where(ON, np.where(np.arange(400) % 60 < 45, 1.0, 2.0), 0.02),
    "heater": np.where(ON, 600.0, 10.0),
    "speed": np.where(ON, 273 + NOISE, 0.1 * NOISE),
    "pulses": np.where((np.arange(400) % 50 < 2) | (np.arange(400) > 350), 2.0, 0.02),
    "emptied at once": CYCLE * (1 + 0.003 * NOISE[: CYCLE.size]),
}


@pytest.mark.parametrize("name", SWITCHED)
def test_what_is_switched_has_no_other_unit(name: str) -> None:
    assert faults.slips(SWITCHED[name]) == []


VARYING = {
    "wave": SMOOTH + 0.05 * RANDOM.normal(size=TIME.size),
    "level": 1.35 + 0.05 * np.sin(TIME / 3) + 1e-3 * RANDOM.normal(size=TIME.size),
}


@pytest.mark.parametrize("name", VARYING)
def test_a_unit_that_slips_again_is_found_in_what_varies(name: str) -> None:
    values = VARYING[name].copy()
    places = [300, 500, 900, 1100]
    for start, stop in (places[:2], places[2:]):
        values[start:stop] *= 1000
    assert [place for place, _ in faults.slips(values)] == places


@pytest.mark.parametrize("digits", [None, 3, 4])
def test_noise_of_one_size_has_no_other_unit(digits: int | None) -> None:
    """As of a flow that is turned on once: that of another unit would be a hundred times as large."""
    values = np.where(np.arange(400) < 200, 0.02, 2.0) + 0.004 * NOISE
    assert faults.slips(values if digits is None else values.round(digits)) == []
    assert [place for place, _ in faults.slips(values.round(2))] == [200]  # nothing but digits


def test_what_is_switched_there_and_back_may_be_a_slip() -> None:
    places = [[place for place, _ in faults.slips(SWITCHED["flow"][:count])] for count in (50, 80)]
    assert places == [[30], [30, 60]]


def test_degrees_and_kelvins_are_told_apart() -> None:
    values = NOISY + 30
    values[700:] += 273.15
    assert faults.slips(values) == [(700, "273.15")]
    again = 20 + 0.5 * np.sin(TIME) + 0.01 * RANDOM.normal(size=TIME.size)
    for start, stop in ((300, 500), (900, 1100)):
        again[start:stop] += 273.15
    assert [place for place, _ in faults.slips(again)] == [300, 500, 900, 1100]


def test_stamps() -> None:
    np.testing.assert_array_equal(faults.backwards(np.array([0, 1, 5, 2, 3, 6, 5.5])), [3, 4, 6])
    np.testing.assert_array_equal(faults.repeated(np.array([0, 1, 1, 1, 2.0])), [2, 3])
    np.testing.assert_array_equal(faults.gaps(np.array([0, 1, 2, 3, 4, 5, 50, 51.0])), [6])
    assert not faults.gaps(np.array([0.0, 1, 100])).size
    assert not faults.gaps(np.zeros(20)).size
