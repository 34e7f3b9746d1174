"""How much there is to do in the segments of a plan."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hgorun.native.ir import Function
from hgorun.native.passes import Passes

_MANY = 1 << 12  # segments of which numpy's passes through rows that stand apart take long


def work_up_to(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Steps of all segments up to each one, and one more for what happens before each.

    Parameters
    ----------
    counts : ndarray of int64, shape (segments, 7)
        See :class:`~hgorun.engine.plan.Plan`.

    Returns
    -------
    ndarray of int64, shape (segments,)
    """
    if len(counts) < _MANY or not counts.flags.c_contiguous:
        found: NDArray[np.int64] = (counts[:, 2] - counts[:, 1] + 1).cumsum()
        return found
    work = np.empty(len(counts), dtype=np.int64)
    _passes("work", (counts, work), (len(counts), counts.shape[1]))
    return work


def _work(f: Function) -> None:
    counts, work = (f.word("%taken", i, "ptr") for i in range(2))
    width, total = f.word("%taken", 3), f.slot("i64")
    f.store("0", total, "i64")
    with f.count(0, f.word("%taken", 2)) as k:
        row = f.at(counts, f.scalar("mul", k, width))
        steps = f.scalar("sub", f.word(row, 2), f.word(row, 1))
        so_far = f.scalar("add", f.load(total, "i64"), f.scalar("add", steps, "1"))
        f.store(so_far, total, "i64")
        f.store(so_far, f.at(work, k), "i64")
    f.do("ret i64 0")


_passes = Passes({"work": _work})
