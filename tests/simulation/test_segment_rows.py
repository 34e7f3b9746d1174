"""Segments that machine code tabulates are those of numpy's formulas, bit by bit."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.simulation.timeline.segment_rows import segment_rows
from hgorun.simulation.timeline.steps import count_steps, unevenly
from hgorun.simulation.timeline.tabulated import rows_in_last_steps

RANDOM = np.random.default_rng(0)
REGULAR = 0.1 * np.arange(300)
EVENTS = {
    "one gap": REGULAR[:2],
    "regular": REGULAR,
    "late": REGULAR + 3e6,
    "before zero": REGULAR - 20.0,
    "of any length": np.cumsum(RANDOM.exponential(0.3, 300)),
    "closer than rounding": np.cumsum(RANDOM.choice([0.2, 1e-12, 3e-16], 300)),
}
LONGEST = (0.1, 0.03, 0.7, np.inf)


def points(events: np.ndarray) -> dict[str, np.ndarray]:
    """Output points on events, just beside them, and anywhere."""
    anywhere = np.sort(RANDOM.uniform(events[0] - 1, events[-1] + 1, 500))
    return {
        "none": np.empty(0),
        "events": events,
        "beside": np.sort(np.concatenate([events - 1e-12, events + 1e-9, events[::3] - 1e-3])),
        "anywhere": anywhere,
        "few": anywhere[::100],
        "before all": events - 1e7,
    }


@pytest.mark.parametrize("events", EVENTS.values(), ids=EVENTS)
@pytest.mark.parametrize("longest", LONGEST)
def test_segments_are_those_of_the_formulas(events: np.ndarray, longest: float) -> None:
    count = events.size - 1
    inward, places = 1e-9 * RANDOM.random(count + 1), np.cumsum(RANDOM.integers(0, 4, count + 1))
    variant, steps = RANDOM.integers(0, 3, count), count_steps(np.diff(events), longest)
    left, right = events[:-1], events[1:]
    for grid in points(events).values():
        slope = rows_in_last_steps(left, right, steps, grid) if grid.size else np.zeros(count, dtype=bool)
        spans, counts = segment_rows(events, inward, variant, places, grid, longest, always_slope=False)
        np.testing.assert_array_equal(spans, np.column_stack([left, right, left + inward[:-1], right - inward[1:]]))
        ones = np.column_stack([steps, 0 * steps, steps, variant, places[:-1], places[1:], slope])
        np.testing.assert_array_equal(counts, ones)
        always = segment_rows(events, inward, variant, places, grid, longest, always_slope=True)[1]
        assert np.all(always[:, 6] == 1)


@pytest.mark.parametrize("ratio", [1.62, 0.5])
def test_cut_segments_are_those_of_the_formulas(ratio: float) -> None:
    part = (3 - 5**0.5) / 2  # of a segment and of its steps, before the cut
    left, right = REGULAR[:-1], REGULAR[1:]
    inside = np.column_stack([left + 1e-9, right - 1e-9])
    inside[3], inside[4] = (left[3] + 0.09, right[3]), (left[4], left[4] + 0.01)  # the cut is kept within
    steps, count = RANDOM.integers(1, 9, left.size), left.size
    first = np.cumsum(RANDOM.integers(0, 4, count))
    counts = np.column_stack([steps, 0 * steps, steps, first % 3, first, first + first % 2, 0 * steps])
    spans, found = unevenly(np.column_stack([left, right, inside]), counts, ratio)
    for k in range(count):
        cut = min(max(left[k] + part * (right[k] - left[k]), inside[k, 0]), inside[k, 1])
        expected = [[left[k], cut, inside[k, 0], cut], [cut, right[k], cut, inside[k, 1]]]
        np.testing.assert_array_equal(spans[2 * k : 2 * k + 2], expected)
        total = max(round(ratio * steps[k]), 2)
        if ratio < 1 and total >= steps[k]:
            total = steps[k] + 1
        before = min(max(round(part * total), 1), total - 1)
        _, _, _, regime, begins, ends, _ = counts[k]
        here = [before, 0, before, regime, begins, ends, 1]
        there = [total - before, 0, total - before, regime, ends, ends, 1]  # nothing happens at the cut
        np.testing.assert_array_equal(found[2 * k : 2 * k + 2], [here, there])
