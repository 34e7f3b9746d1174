"""Samples that are taken and arrive at one event are heard in one action, where no other lies in between."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.engine.layout import ARRIVE, HEAR, REBASE, SET, TAKE
from hgorun.simulation.timeline.actions import heard_at_once

SLOTS = 7, 40
ROWS = np.array(
    [
        [SET, 8, 3, 0, 0],
        *([op, i, slot, 0, 0] for op in (TAKE, ARRIVE) for i, slot in enumerate(SLOTS)),
        *([REBASE, i, slot, slot + 1, slot + 1] for i, slot in enumerate(SLOTS)),
    ]
)
ADVANCE = np.array([[0, 0, 1, 0, 0]] * 5 + [[0, 0, 1, 1, 1]] * 2)


def test_one_action_for_each_sample() -> None:
    rows, advance = heard_at_once(ROWS, ADVANCE)
    np.testing.assert_array_equal(rows[:, :3], [[SET, 8, 3], [HEAR, 0, 7], [HEAR, 1, 40]])
    np.testing.assert_array_equal(advance[:, :3], [[0, 0, 1]] * 3)


@pytest.mark.parametrize(("row", "word", "value"), [(0, 0, TAKE), (3, 2, 6), (5, 1, 1), (6, 4, 42), (2, 0, ARRIVE)])
def test_what_is_otherwise_is_left_as_it_is(row: int, word: int, value: int) -> None:
    rows = ROWS.copy()
    rows[row, word] = value
    assert heard_at_once(rows, ADVANCE)[0] is rows


def test_samples_that_go_on_otherwise_are_left_as_they_are() -> None:
    advance = ADVANCE.copy()
    advance[6, 4] = 2
    assert heard_at_once(ROWS, advance)[0] is ROWS
    assert heard_at_once(ROWS[:1], ADVANCE[:1])[0].size == 5
