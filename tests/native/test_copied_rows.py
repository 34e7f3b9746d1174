"""Copies of columns that stand apart, and what lies around rows, are as numpy makes them; one number is told."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.native.rows import all_are, around, copied

TABLE = np.random.default_rng(0).standard_normal((3000, 6))
TABLE[7, 2], TABLE[8, 3], TABLE[9, 3] = np.nan, -0.0, np.inf
BACKWARDS = TABLE[::-1]
ROWS: dict[str, np.ndarray] = {
    "one number": TABLE[:, 2:3],
    "two": TABLE[:, 2:4],
    "three": TABLE[:, 1:4],
    "four, every other row": TABLE[::2, 2:],
    "five": TABLE[:, 1:],
    "backwards": BACKWARDS[:, 1:4],
    "columns apart": TABLE[:, ::3],
    "columns the other way": TABLE[:, 3:1:-1],
    "in one piece": TABLE,
    "few rows": TABLE[:9, 2:4],
    "no rows": TABLE[:0, 2:4],
    "one row for all": np.broadcast_to(TABLE[7, 1:4], (3000, 3)),
    "tables": TABLE.reshape(3000, 3, 2)[:, 1:],
    "a column": TABLE[:, 2],
    "single precision": TABLE.astype(np.float32)[:, 2:4],
    "whole numbers": np.arange(18_000).reshape(3000, 6)[:, 2:4],
    "the other order of bytes": TABLE.astype(">f8")[:, 2:4],
}


@pytest.mark.parametrize("rows", ROWS)
def test_copies_of_rows(rows: str) -> None:
    given = ROWS[rows]
    found = copied(given)
    expected = np.array(given, order="C")
    assert found.dtype == given.dtype
    assert found.shape == given.shape
    assert found.flags.c_contiguous
    assert found.tobytes() == expected.tobytes()
    assert not np.shares_memory(found, given)


@pytest.mark.parametrize("value", [1.5, -0.0, np.nan])
@pytest.mark.parametrize("columns", [slice(2, 3), slice(1, 4), slice(None)])
@pytest.mark.parametrize("count", [9, 3000])
def test_rows_of_one_number_are_told_by_its_bits(count: int, columns: slice, value: float) -> None:
    table = TABLE[:count].copy()
    table[:, columns] = value
    rows, number = table[:, columns], np.float64(value)
    assert all_are(rows, number)
    assert not all_are(rows, np.float64(0.0))
    for row in (0, count // 2, count - 1):
        table[row, columns.stop and columns.stop - 1] = -value if value else 0.0
        assert not all_are(rows, number)
        table[row, columns] = value
    assert all_are(np.full(count, 3, dtype=np.int8), np.int8(3))
    assert not all_are(np.arange(count), np.int64(0))


@pytest.mark.parametrize("rows", [TABLE, TABLE[:9], TABLE[:0], TABLE[:, :1], TABLE[::2].copy()], ids=len)
def test_what_lies_around_rows(rows: np.ndarray) -> None:
    rows, each = np.ascontiguousarray(rows), np.ascontiguousarray(np.abs(TABLE[: len(rows), : rows.shape[1]])[::-1])
    for width in (each, np.abs(TABLE[2, : rows.shape[1]])):
        for found, expected in zip(around(rows, width), (rows - width, rows + width), strict=True):
            assert found.shape == expected.shape
            assert found.tobytes() == expected.tobytes()
