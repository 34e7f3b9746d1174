"""Some columns of a table as rows of their own."""

from __future__ import annotations

from functools import partial

import numpy as np

from hgorun.native.ir import Function
from hgorun.native.passes import Passes

_WIDTHS = (2, 3, 4)  # numbers of a row
_FEWEST = 1 << 10  # rows


def copied(rows: np.ndarray) -> np.ndarray:
    """``rows.copy()``, which goes number by number and takes four times as long where rows of few stand apart."""
    count, width = rows.shape if rows.ndim == 2 else (0, 0)
    apart = count >= _FEWEST and width in _WIDTHS and rows.dtype == np.float64 and not rows.flags.c_contiguous
    if not apart or rows.strides[0] % 8 or rows.strides[1] != 8:
        return rows.copy()
    found = np.empty(rows.shape)
    _passes(f"copy{width}", (rows, found), (count, rows.strides[0] // 8))
    return found


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


_passes = Passes({f"copy{width}": partial(_copy, width) for width in _WIDTHS})
