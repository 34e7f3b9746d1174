"""Which points nothing beats: the Pareto front of a set, and its knee."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def non_dominated(values: Floats) -> NDArray[np.bool_]:
    """Which points no other point beats: is nowhere larger, and somewhere smaller.

    Parameters
    ----------
    values : ndarray, shape (N, k)
        The smaller the better. Points with a value that is not finite are never chosen.

    Returns
    -------
    ndarray of bool, shape (N,)
        Of equal points all are chosen or none.
    """
    chosen: NDArray[np.bool_] = np.all(np.isfinite(values), axis=1)
    for i in np.lexsort(values.T[::-1]):  # what beats a point comes before it
        if chosen[i]:
            worse = np.all(values >= values[i], axis=1) & np.any(values > values[i], axis=1)
            chosen &= ~worse
    return chosen


def knee(values: Floats) -> int:
    """The point of a front of two quantities that is farthest below the line between its ends.

    Parameters
    ----------
    values : ndarray, shape (N, 2)
        A front, N >= 1. On logarithmic axes where all values are positive, so that units do not matter; scaled to
        the ends of the front.

    Returns
    -------
    int
        Its place; of two points the one with the smaller product, of a single one that.
    """
    scaled = np.log(values) if np.all(values > 0) else values
    low, high = scaled.min(axis=0), scaled.max(axis=0)
    unit = (scaled - low) / np.where(high > low, high - low, 1.0)
    return int(np.argmin(np.round(unit.sum(axis=1), 12)))
