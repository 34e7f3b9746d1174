"""Samples of two signals that are the same."""

from __future__ import annotations

import numpy as np
import pytest
from recordings import signal

from hgorun.estimate.twins import Twins


def test_times_and_values_are_equal_but_for_their_rounding() -> None:
    """Against every pair, of samples at random times, some of them repeated."""
    random = np.random.default_rng(5)
    taken = np.sort(random.integers(0, 40, 60) / 3.0)
    given = signal("a", taken, random.integers(0, 3, 60) / 7.0)
    compared = signal("a", np.sort(random.integers(0, 60, 30) / 3.0), random.integers(0, 4, 30) / 7.0)
    rounded = signal("a", compared.taken.round(5), compared.values.astype(np.float32))
    found = Twins.of(given, rounded)
    timed = np.abs(given.taken[:, None] - compared.taken) < 0.01
    same = timed & (np.abs(given.values[:, None] - compared.values) < 0.01)
    np.testing.assert_array_equal(found.given, same.any(axis=1))
    np.testing.assert_array_equal(found.compared, same.any(axis=0))
    np.testing.assert_array_equal(found.otherwise, timed.any(axis=0) & ~same.any(axis=0))
    assert found.given.any()
    assert found.otherwise.any()
    assert not found.compared.all()


def angle(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Times and an angle that swings, as a sensor with noise of 0.02 sees it."""
    taken = 0.1 * np.arange(200)
    return taken, np.exp(-0.05 * taken) * np.cos(taken) + 0.02 * random.standard_normal(200)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("resolution", [0.001, 0.02, 0.05, 0.1, 0.2, 0.4])
def test_two_coarse_sensors_are_equal_by_chance(resolution: float, seed: int) -> None:
    """In up to 95 % of their samples; with 0.001 in one of fifty."""
    random = np.random.default_rng(seed)
    (taken, one), (_, other) = (angle(random) for _ in range(2))
    one, other = (np.round(values / resolution) * resolution for values in (one, other))
    assert Twins.of(signal("a", taken, one), signal("a", taken, other)).by_chance


@pytest.mark.parametrize("form", [".6g", ".4g", ".3f", ".5f", ".12g"])
@pytest.mark.parametrize("resolution", [None, 0.001, 0.1])
@pytest.mark.parametrize("corrected", [0, 3])
def test_what_was_taken_from_a_log_is_the_same_however_it_was_written(
    form: str, resolution: float | None, corrected: int
) -> None:
    """Also where every third value was corrected."""
    taken, y = angle(np.random.default_rng(6))
    y = y if resolution is None else np.round(y / resolution) * resolution
    other = y[::4].copy()
    if corrected:
        other[::corrected] += 0.5
    other = np.array([float(f"{value:{form}}") for value in other])
    found = Twins.of(signal("a", taken, y), signal("a", taken[::4], other))
    assert not found.by_chance
    expected = np.zeros(200, dtype=bool)
    expected[::4] = True
    if corrected:
        expected[:: 4 * corrected] = False
    np.testing.assert_array_equal(found.given, expected)
