"""Straight lines that a machine draws: from rest to rest, or again and again at the same few speeds.

So do a totaliser while a pump runs, a scale while it is filled, and a crane. What fills in between samples draws a line
from any value to any other.
"""

from __future__ import annotations

import numpy as np

_REST = 3  # equal values in a row
_NEAR = 3  # samples from the end of a line within which they begin: the first step may be a part of one
_SPEEDS, _LINES = 3, 3  # so many at the most, and lines of each on average at the least
_SAME = 0.02  # of a speed


def of_a_machine(values: np.ndarray, ends: np.ndarray, quantum: float) -> np.ndarray:
    """Which lines a machine may have drawn.

    Parameters
    ----------
    values : ndarray, shape (n,)
    ends : ndarray of integers, shape (lines, 2)
        The first point of each, and the one behind its last.
    quantum : float
        The step of the digits.
    """
    if not ends.size:
        return np.zeros(0, dtype=bool)
    first, last = ends[:, 0], ends[:, 1] - 1
    speeds = (values[last] - values[first]) / (last - first)
    if _are_few(speeds, 2 * quantum / float((last - first).min())):
        return np.ones(first.size, dtype=bool)
    return np.array([_rests(values, a, -1) and _rests(values, b, 1) for a, b in zip(first, last, strict=True)])


def _are_few(speeds: np.ndarray, rounding: float) -> bool:
    """Whether lines have a few speeds again and again."""
    found, left = 0, np.sort(speeds)
    while left.size and found <= _SPEEDS:
        left = left[left > left[0] + max(_SAME * abs(left[0]), rounding)]
        found += 1
    return not left.size and found <= min(_SPEEDS, speeds.size / _LINES)


def _rests(values: np.ndarray, end: int, side: int) -> bool:
    """Whether a signal rests beside the end of a line, or is not known there."""
    beyond = values[end + 1 : end + 1 + _NEAR + _REST] if side > 0 else values[max(end - _NEAR - _REST, 0) : end][::-1]
    if beyond.size < _REST - 1:
        return True
    same = np.diff(np.concatenate([[values[end]], beyond])) == 0
    return bool(np.any(same[:-1] & same[1:]))
