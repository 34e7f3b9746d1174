"""Combinations of what the outputs are, numbered without sorting them."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.measurement.schedule import _distinct


@pytest.mark.parametrize(("rows", "columns", "largest"), [(50, 2, 4), (5000, 4, 3), (3, 6, 9), (1, 2, 1)])
def test_distinct_rows_as_numpy_finds_them(rows: int, columns: int, largest: int) -> None:
    values = np.random.default_rng(rows).integers(0, largest, (rows, columns))
    distinct, which = _distinct(values)
    expected, inverse = np.unique(values, axis=0, return_inverse=True)
    assert np.array_equal(distinct, expected)
    assert np.array_equal(which, inverse.ravel())
