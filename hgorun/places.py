"""Places of numbers in a long ascending array."""

from __future__ import annotations

from typing import Literal

import numpy as np

_FEW = 64


def places_in(ascending: np.ndarray, sought: np.ndarray, side: Literal["left", "right"] = "left") -> np.ndarray:
    """``numpy.searchsorted``, which takes a tenth of the time where the sought ones are about every n-th of the others.

    As output points and samples of one clock are. Their places are guessed, and searched only where a guess is wrong.

    Parameters
    ----------
    ascending : ndarray, shape (N,)
    sought : ndarray, shape (n,)
    side : {"left", "right"}
        Before or behind those that are equal.

    Returns
    -------
    ndarray of int, shape (n,)
    """
    count = sought.size
    if count >= _FEW:
        first, last = np.searchsorted(ascending, sought[[0, -1]], side=side).tolist()
        stride = max(1, round((last - first) / (count - 1)))
        ends = stride * (count - 1) + 1
        around = _slice(ascending, first - 2, first + ends + 1)
        before = np.less if side == "left" else np.less_equal
        under, low, high, over = (before(around[k : k + ends : stride], sought) for k in range(4))
        if under.all() and not over.any():  # of the four around a guess, the outer ones bound the place
            return np.asarray(np.arange(first - 1, first - 1 + ends, stride) + low + high)
    return np.asarray(np.searchsorted(ascending, sought, side=side))


def _slice(ascending: np.ndarray, start: int, stop: int) -> np.ndarray:
    """From start to stop, with infinities where there is nothing."""
    inside = ascending[max(start, 0) : max(stop, 0)]
    left, right = max(0, -start), max(0, stop - ascending.size)
    if not left and not right:
        return inside
    return np.concatenate([np.full(left, -np.inf), inside, np.full(right, np.inf)])
