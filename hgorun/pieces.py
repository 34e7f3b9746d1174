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


def distinct(values: np.ndarray) -> np.ndarray:
    """Values in ascending order, each once.

    It is numpy's ``unique``, which imports its masked arrays when it is first called: 3 % of a short run.
    """
    if values.size and np.all(values[1:] > values[:-1]):
        return values.copy()
    ordered = np.sort(values, kind="stable")  # quick where the values are a few ascending runs, as most are
    return np.asarray(ordered[np.concatenate([[True], ordered[1:] != ordered[:-1]])[: ordered.size]])


def median(values: np.ndarray, *, spare: bool = False) -> float:
    """``np.median``, which imports numpy's masked arrays when it is first called: 4 % of a short run.

    Parameters
    ----------
    values : ndarray
    spare : bool
        Whether nobody needs them any more: then no copy is made.
    """
    flat = values.ravel()
    if not flat.size:
        return float("nan")
    if spare:
        flat.partition(_ends_of_middle(flat.size))
    return float(_middle(flat if spare else np.partition(flat, _ends_of_middle(flat.size))))


def medians(values: np.ndarray, axis: int) -> np.ndarray:
    """The same along an axis that is not empty."""
    lines = np.moveaxis(values, axis, -1)
    return _middle(np.partition(lines, _ends_of_middle(lines.shape[-1]), axis=-1))


def quantiles(values: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """``np.quantile`` of finite numbers, which imports masked arrays as ``np.median`` does.

    Parameters
    ----------
    values : ndarray, shape (n,), n > 0
    parts : ndarray, shape (m,)
        From 0 to 1.
    """
    places = (values.size - 1) * parts
    before = np.floor(places).astype(np.int64)
    after = np.minimum(before + 1, values.size - 1)
    ordered = np.partition(values, np.concatenate([before, after]))
    low, high, share = ordered[before], ordered[after], places - before
    rise = high - low
    return np.asarray(np.where(share < 0.5, low + rise * share, high - rise * (1 - share)))


def _ends_of_middle(count: int) -> list[int]:
    """The places of the median, and the last one, where NaN is put."""
    return [(count - 1) // 2, count // 2, count - 1]


def _middle(parted: np.ndarray) -> np.ndarray:
    """The median along the last axis, NaN where there is one."""
    first, second, last = _ends_of_middle(parted.shape[-1])
    return np.where(np.isnan(parted[..., last]), np.nan, np.mean(parted[..., first : second + 1], axis=-1))
