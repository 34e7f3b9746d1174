"""Where samples of two outputs are not taken together: the first time at which one of them is missing."""

from __future__ import annotations

import numpy as np


def not_beside(
    first: tuple[str, np.ndarray], second: tuple[str, np.ndarray], origin: float, tolerance: float = 0.0
) -> str:
    """The first sample of one output that has none of the other beside it, as a sentence without a full stop.

    Parameters
    ----------
    first, second : (str, ndarray)
        Names, and times in ascending order, which differ.
    origin : float
        From which these are counted, on the clock of the configuration.
    tolerance : float
        By how much times may differ that count as the same.
    """
    (_, a), (_, b) = first, second
    count = min(a.size, b.size)
    apart = np.flatnonzero(np.abs(a[:count] - b[:count]) > tolerance)
    k = int(apart[0]) if apart.size else count
    here, there = (second, first) if k == a.size or (k < b.size and b[k] < a[k]) else (first, second)
    t, others = float(here[1][k]), there[1]
    beside = f"{there[0]} has no sample beside that of {here[0]} at t = {origin + t:.9g}"
    if not others.size:
        return beside
    off = float(others[np.argmin(np.abs(others - t))]) - t
    return f"{beside}, the nearest is {abs(off):.3g} {'later' if off > 0 else 'earlier'}" if off else beside
