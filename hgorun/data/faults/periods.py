"""Values that are known up to whole periods, as the angle that an encoder measures: differences and means of them."""

from __future__ import annotations

import numpy as np


def unwrapped(values: np.ndarray, period: float | None) -> np.ndarray:
    """Values without the jumps by whole periods; themselves without a period."""
    return values if period is None else np.unwrap(values, period=period)


def means(values: np.ndarray, starts: np.ndarray, period: float | None) -> np.ndarray:
    """The mean of each group of values that follow each other.

    With a period it is that of the values nearest to the group's first one: of 3.1 and -3.1 it is near 3.14, not 0.

    Parameters
    ----------
    values : ndarray, shape (n,)
    starts : ndarray of integers, shape (groups,)
        The first one of each; that of the first group is 0.
    period : float or None
        Up to which values are known.
    """
    counts = np.diff(starts, append=values.size)
    if period is not None:
        off = values - np.repeat(values[starts], counts)
        values = values - period * np.floor(off / period + 0.5)
    return np.asarray(np.add.reduceat(values, starts) / counts)
