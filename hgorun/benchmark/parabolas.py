"""Where an error that is known at some values of a knob is least in between."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def vertices(values: Floats, errors: Floats, of: Floats | None = None) -> tuple[Floats, Floats]:
    """Where errors are least: at the vertex of the parabola through the least of them and its two neighbours.

    Parameters
    ----------
    values : ndarray, shape (N,)
        In ascending order. Where all are above 0 the parabola is one of their logarithm.
    errors : ndarray, shape (N, K)
        K times the error of each value.
    of : ndarray, shape (N,), optional
        Other errors of the values; those of the first column by default.

    Returns
    -------
    ndarray, shape (K,)
        The vertices; where the least error is that of the first or the last value, or next to an infinite one, that
        value.
    ndarray, shape (K,)
        What the other errors are there, by the parabola through the same three values.
    """
    axis = np.log(values) if values[0] > 0 else values
    other = errors[:, 0] if of is None else of
    least, columns = np.argmin(errors, axis=0), np.arange(errors.shape[1])
    found, then = axis[least], other[least]
    inside = (least > 0) & (least < values.size - 1)
    middle, column = least[inside], columns[inside]
    left, right = axis[middle - 1] - axis[middle], axis[middle + 1] - axis[middle]
    three = [errors[middle + side, column] for side in (-1, 0, 1)]
    smooth = np.isfinite(three).all(axis=0)
    middle, left, right = middle[smooth], left[smooth], right[smooth]
    slope, curvature = _parabolas(left, right, *(y[smooth] for y in three))
    vertex = np.divide(-slope, 2 * curvature, out=np.zeros_like(slope), where=curvature > 0)
    slope, curvature = _parabolas(left, right, *(other[middle + side] for side in (-1, 0, 1)))
    where = np.flatnonzero(inside)[smooth]
    found[where] += vertex
    then[where] = other[middle] + vertex * (slope + curvature * vertex)
    return np.exp(found) if values[0] > 0 else found, then


def _parabolas(x_0: Floats, x_2: Floats, y_0: Floats, y_1: Floats, y_2: Floats) -> tuple[Floats, Floats]:
    """b and c of those through (x_0, y_0), (0, y_1) and (x_2, y_2), y = y_1 + b x + c x^2."""
    left, right = (y_0 - y_1) / x_0, (y_2 - y_1) / x_2
    curvature = (right - left) / (x_2 - x_0)
    return left - curvature * x_0, curvature
