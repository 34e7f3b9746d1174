"""What is asked of very many numbers, piece by piece: a piece stays in a cache, and for all memory has to be made."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_PIECE = 1 << 16


def everywhere(test: Callable[..., np.ndarray], *arrays: np.ndarray) -> bool:
    """Whether something holds for all numbers.

    Parameters
    ----------
    test : callable
        Of some numbers of every array it tells for each whether it holds.
    arrays : ndarray, shape (n,) each
    """
    pieces = (slice(first, first + _PIECE) for first in range(0, arrays[0].size, _PIECE))
    return all(bool(np.all(test(*(array[piece] for array in arrays)))) for piece in pieces)


def ascending(values: np.ndarray, *, strictly: bool) -> bool:
    """Whether no number is below the one before, or equal to it; NaN is not above anything."""
    return everywhere(np.greater if strictly else np.greater_equal, values[1:], values[:-1])


def extremes(values: np.ndarray) -> tuple[float, float]:
    """The least and the largest number, but for missing ones (NaN); both are NaN where there is none."""
    least = largest = np.nan
    for first in range(0, values.size, _PIECE):
        piece = values[first : first + _PIECE]
        least = np.fmin.reduce(piece, initial=least)
        largest = np.fmax.reduce(piece, initial=largest)
    return float(least), float(largest)


def present(values: np.ndarray) -> np.ndarray:
    """The numbers without those that are missing (NaN): the array itself, and no copy of it, where none is."""
    return values if everywhere(np.equal, values, values) else values[~np.isnan(values)]


def all_true(flags: np.ndarray) -> bool:
    """``flags.all()``, also where millions of flags are one and the same in memory."""
    alike = flags.size > 0 and not any(flags.strides)
    return bool(flags.flat[0]) if alike else bool(flags.all())
