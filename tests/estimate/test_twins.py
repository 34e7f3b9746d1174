"""Samples of two signals that are the same."""

from __future__ import annotations

import numpy as np
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
