"""What is asked of many numbers piece by piece is what is told of them at once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgorun import pieces
from hgorun.pieces import all_true, ascending, distinct, everywhere, extremes, median, medians, present, quantiles


@pytest.mark.parametrize("count", [0, 1, 2, 8, 9, 17])
def test_pieces_are_told_of_as_a_whole(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pieces, "_PIECE", 4)
    times = np.arange(float(count))
    for k in range(count):
        for value in (times[k - 1], -1.0, np.nan):
            changed = times.copy()
            changed[k] = value
            assert extremes(changed) == pytest.approx(
                (np.fmin.reduce(changed), np.fmax.reduce(changed)), abs=0, nan_ok=True
            )
            assert everywhere(np.isfinite, changed) == np.isfinite(changed).all()
            assert ascending(changed, strictly=True) == np.all(changed[1:] > changed[:-1])
            assert ascending(changed, strictly=False) == np.all(changed[1:] >= changed[:-1])
    assert ascending(times, strictly=True)


def test_flags() -> None:
    assert all_true(np.zeros(0, dtype=bool))
    for value in (True, False):
        assert all_true(np.broadcast_to(np.bool_(value), (7, 2))) is value
        assert all_true(np.full((7, 2), value)) is value
    assert not all_true(np.array([True, False]))


def test_numbers_that_are_there() -> None:
    whole, holes = np.arange(5.0), np.array([np.nan, 1.0, np.inf, np.nan])
    assert present(whole) is whole
    assert present(holes).tolist() == [1.0, np.inf]
    assert present(holes[:0]).size == 0
    assert np.isnan(extremes(holes[:0])).all()


@pytest.mark.parametrize("count", [1, 2, 3, 8, 9, 1001])
def test_medians_are_numpys_bit_by_bit(count: int) -> None:
    random = np.random.default_rng(count)
    tables = [random.standard_normal((4, count)), random.integers(-5, 5, (4, count)), np.full((4, count), np.inf)]
    with_nan = tables[0].copy()
    with_nan[1, count // 2] = np.nan
    for table in (*tables, with_nan):
        for axis in (0, 1):
            assert medians(table, axis).tobytes() == np.median(table, axis=axis).tobytes()
        for row in table:
            assert np.float64(median(row)).tobytes() == np.float64(np.median(row)).tobytes()
            assert np.float64(median(row.copy(), spare=True)).tobytes() == np.float64(np.median(row)).tobytes()


def test_nothing_has_no_median() -> None:
    assert np.isnan(median(np.zeros(0)))


@pytest.mark.parametrize("count", [1, 2, 3, 10, 11, 1000])
def test_quantiles_are_numpys_bit_by_bit(count: int) -> None:
    random = np.random.default_rng(count)
    parts = np.concatenate([np.arange(11) / 10, np.arange(1, 5) / 5, random.random(100)])
    for values in (random.standard_normal(count), 1e-3 * np.arange(count), np.full(count, 0.1)):
        assert quantiles(values, parts).tobytes() == np.quantile(values, parts).tobytes()


@pytest.mark.costly
@given(st.lists(st.sampled_from([-np.inf, -1.5, 0.0, 1e-300, 2.0, np.inf]) | st.floats(-10, 10), max_size=20))
def test_distinct_values_are_those_of_numpy(values: list[float]) -> None:
    np.testing.assert_array_equal(distinct(np.array(values)), np.unique(values))
