"""Places that are walked to are those of ``numpy.searchsorted``, whatever is sought."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from hgorun.native.places import last_near, moved_up, places_in, since_last_in

TIMES = 1e-3 * np.arange(1000)
RANDOM = np.random.default_rng(0)
JITTER = np.sort(TIMES + 2e-3 * RANDOM.random(1000))
SOUGHT = {
    "the same": TIMES,
    "a part": TIMES[300:800],
    "last bits apart": np.linspace(0.0, 0.999, 1000),
    "a little before": TIMES - 1e-9,
    "a little behind": TIMES + 1e-9,
    "every tenth": TIMES[3::10],
    "every third, apart": TIMES[::3] + 1e-12,
    "twice as many": np.linspace(0.0, 0.999, 2000),
    "before all": TIMES - 5.0,
    "behind all": TIMES + 5.0,
    "beyond both ends": np.linspace(-1.0, 2.0, 1000),
    "jitter": JITTER,
    "in no order": RANDOM.permutation(TIMES),
    "backwards": TIMES[::-1],
    "no numbers": np.where(np.arange(1000) % 7, TIMES, np.nan),
    "infinite": np.concatenate([[-np.inf], TIMES, [np.inf]]),
    "repeated": np.repeat(TIMES, 2),
    "few": TIMES[:5],
    "nothing": TIMES[:0],
}
WITHIN = {"even": TIMES, "jitter": JITTER, "repeated": np.repeat(TIMES, 3), "one": TIMES[:1], "nothing": TIMES[:0]}


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("within", WITHIN)
def test_places_are_those_that_a_search_finds(within: str, side: Literal["left", "right"]) -> None:
    for name, sought in SOUGHT.items():
        expected = np.searchsorted(WITHIN[within], sought, side=side)
        np.testing.assert_array_equal(places_in(WITHIN[within], sought, side), expected, err_msg=name)


@pytest.mark.costly
@pytest.mark.parametrize("within", ["even", "jitter", "repeated", "one"])
@pytest.mark.parametrize("sought", SOUGHT)
@pytest.mark.parametrize("side", ["left", "right"])
def test_how_far_behind_the_last_one_each_is(within: str, sought: str, side: Literal["left", "right"]) -> None:
    ascending, found = WITHIN[within], since_last_in(WITHIN[within], SOUGHT[sought], side)
    for one, since in zip(SOUGHT[sought][::50], found[::50], strict=True):
        before = ascending[~(ascending > one if side == "right" else ascending >= one)]  # no number is behind all
        expected = one - before.max() if before.size else np.inf
        assert since == expected or (np.isnan(one) and np.isnan(since))
    assert found.size == SOUGHT[sought].size


@pytest.mark.parametrize("within", ["even", "jitter", "repeated", "one"])
def test_those_a_little_before_one_are_moved_to_it(within: str) -> None:
    ascending, tolerance = WITHIN[within], 2e-9
    for name, sought in SOUGHT.items():
        expected = []
        for one in sought.tolist():
            following = ascending[~(ascending < one)]
            near = following.size and one < following[0] <= one + tolerance
            expected.append(following[0] if near else one)
        np.testing.assert_array_equal(moved_up(ascending, sought, tolerance), expected, err_msg=name)
    assert np.count_nonzero(moved_up(TIMES, SOUGHT["a little before"], tolerance) == TIMES) == TIMES.size


@pytest.mark.parametrize("within", ["even", "jitter", "repeated", "one"])
def test_the_last_one_near_each_is_found(within: str) -> None:
    ascending, tolerance = WITHIN[within], 2e-9
    for name, sought in SOUGHT.items():
        near = [ascending[abs(ascending - one) <= tolerance] for one in sought.tolist() if np.isfinite(one)]
        expected = [some[-1] if some.size else -np.inf for some in near]
        found = last_near(ascending, sought, tolerance)
        np.testing.assert_array_equal(found[np.isfinite(sought)], expected, err_msg=name)
        assert np.all(np.isneginf(found[~np.isfinite(sought)]))
