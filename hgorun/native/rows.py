"""Rows of a table: some columns as rows of their own, whether they have one number, and what lies around them."""

from __future__ import annotations

from functools import partial

import numpy as np

from hgorun.native.ir import Function
from hgorun.native.passes import Passes

_WIDTHS = (2, 3, 4)  # numbers of a row
_FEWEST = 1 << 10  # rows


def copied(rows: np.ndarray) -> np.ndarray:
    """``rows.copy()``, which goes number by number and takes four times as long where rows of few stand apart."""
    if rows.flags.c_contiguous or not _in_words(rows) or rows.shape[1] not in _WIDTHS:
        return rows.copy()
    found = np.empty(rows.shape)
    _passes(f"copy{rows.shape[1]}", (rows, found), (len(rows), rows.strides[0] // 8))
    return found


def all_are(rows: np.ndarray, value: np.generic) -> bool:
    """Whether all numbers have the bits of one of their kind; rows of few take numpy six times as long."""
    kind = np.dtype(f"u{rows.dtype.itemsize}")
    bits = np.asarray(value).view(kind)
    if not _in_words(rows):
        return bool(np.all(rows.view(kind) == bits))
    width = rows.shape[1]
    name = f"others{width}" if width in _WIDTHS else "others"
    return _passes(name, (rows,), (len(rows), width, rows.strides[0] // 8, int(bits.view(np.int64)))) == 0


def around(rows: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``rows - width`` and ``rows + width`` in one pass; a width for all rows takes numpy four times as long.

    Parameters
    ----------
    rows : ndarray, shape (N, n)
    width : ndarray, shape (N, n) or (n,)
    """
    doubles = rows.dtype == width.dtype == np.float64 and rows.flags.c_contiguous and width.flags.c_contiguous
    if not doubles or rows.ndim != 2 or len(rows) < _FEWEST:
        return rows - width, rows + width
    found = np.empty(rows.shape), np.empty(rows.shape)
    _passes("around", (rows, width, *found), (*rows.shape, rows.shape[1] * (width.ndim - 1)))
    return found


def _in_words(rows: np.ndarray) -> bool:
    """Whether these are many rows of doubles, the numbers of each one behind the other."""
    words = rows.ndim == 2 and len(rows) >= _FEWEST and rows.dtype == np.float64
    return words and rows.strides[1] == 8 and not rows.strides[0] % 8


def in_one_piece(rows: np.ndarray) -> np.ndarray:
    """The rows, one behind the other in memory: copied only where they are not."""
    return rows if rows.flags.c_contiguous else copied(rows)


def _copy(width: int, f: Function) -> None:
    rows, found = (f.word("%taken", i, "ptr") for i in range(2))
    step = f.word("%taken", 3)
    with f.count(0, f.word("%taken", 2)) as k:
        row, own = f.at(rows, f.scalar("mul", k, step)), f.at(found, f.scalar("mul", k, str(width)))
        for column in range(width):
            f.store(f.word(row, column), f.at(own, column), "i64")
    f.do("ret i64 0")


def _others(f: Function, columns: int | None = None) -> None:
    """Which bits of some number are not those of one; of so many columns, where that is known."""
    rows = f.word("%taken", 0, "ptr")
    count, width, step, value = (f.word("%taken", i) for i in range(1, 5))
    found = f.slot("i64")
    f.store("0", found, "i64")

    def see(row: str, column: str | int) -> None:
        others = f.scalar("xor", f.word(row, column), value)
        f.store(f.scalar("or", f.load(found, "i64"), others), found, "i64")

    with f.count(0, count) as k:
        row = f.at(rows, f.scalar("mul", k, step))
        if columns is None:
            with f.count(0, width) as column:
                see(row, column)
        for known in range(columns or 0):
            see(row, known)
    f.do(f"ret i64 {f.load(found, 'i64')}")


def _around(f: Function) -> None:
    rows, width, lower, upper = (f.word("%taken", i, "ptr") for i in range(4))
    count, columns, step = (f.word("%taken", i) for i in range(4, 7))
    with f.count(0, count) as k:
        place, own = f.scalar("mul", k, columns), f.at(width, f.scalar("mul", k, step))
        with f.count(0, columns) as column:
            at = f.scalar("add", place, column)
            one, half = f.word(rows, at, "double"), f.word(own, column, "double")
            f.store(f.scalar("fsub", one, half), f.at(lower, at))
            f.store(f.scalar("fadd", one, half), f.at(upper, at))
    f.do("ret i64 0")


_passes = Passes(
    {
        **{f"copy{width}": partial(_copy, width) for width in _WIDTHS},
        **{f"others{width}": partial(_others, columns=width) for width in _WIDTHS},
        "others": _others,
        "around": _around,
    }
)
