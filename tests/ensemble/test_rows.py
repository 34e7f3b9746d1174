"""Members one after the other, whatever the blocks were."""

from __future__ import annotations

from itertools import pairwise
from math import prod

import numpy as np
from ensembles import small
from hypothesis import given
from hypothesis import strategies as st

from hgorun.ensemble.blocks.block import compute
from hgorun.ensemble.collected.rows import batches, part, rectangles


@given(st.lists(st.integers(1, 4), min_size=1, max_size=4), st.data())
def test_a_range_of_places_is_made_of_rectangles(shape: list[int], data: st.DataObject) -> None:
    size = prod(shape)
    start = data.draw(st.integers(0, size))
    stop = data.draw(st.integers(start, size))
    found = np.full(shape, -1)
    for place, first, last in rectangles(shape, start, stop):
        assert np.all(found[place] == -1)
        found[place] = np.arange(first, last).reshape(found[place].shape)
    expected = np.full(size, -1)
    expected[start:stop] = np.arange(start, stop)
    assert found.ravel().tolist() == expected.tolist()


def test_batches_do_not_tell_how_members_came() -> None:
    ensemble = small()
    block = compute(ensemble.base, ensemble.members(0, 12), metrics=("rmse",))
    for cuts in ([0, 12], [0, 1, 2, 7, 12], [0, 5, 10, 12]):
        parts = [part(block, slice(a, b)) for a, b in pairwise(cuts)]
        sizes = []
        values = []
        for batch in batches(parts, 5):
            sizes.append(len(batch))
            values.append(batch.metrics["rmse"])
        assert sizes == [5, 5, 2]
        assert np.array_equal(np.concatenate(values), block.metrics["rmse"])
