"""Samples of one period, of which some may be missing: whether they come whole periods after each other."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hgorun.observers.together import not_beside

UNEVEN = 1e-6
"""Of a period: as well as it is known."""


def off_period(times: Mapping[str, np.ndarray], T: float, origin: float) -> str | None:
    """Where samples are not whole periods apart, or not those of all outputs together, as a clause; else None.

    A sample that is missing, of one output or of all, breaks no period.

    Parameters
    ----------
    times : mapping of str to ndarray
        When the samples of every output have been taken, ascending.
    T : float
        The period.
    origin : float
        From which times are counted, on the clock of the configuration.
    """
    first: tuple[str, np.ndarray] | None = None
    for name, taken in times.items():
        gaps = np.diff(taken)
        if _off(gaps, T).any():
            gaps = gaps[gaps > 0]
            return f"samples of {name} are {_apart(gaps)} apart, not whole periods of {T:.6g}{_cut_off(gaps, T)}"
        if not taken.size:
            continue
        if first is None:
            first = name, taken
            continue
        nearest = first[1][np.argmin(np.abs(first[1] - taken[0]))]
        if _off(taken[:1] - nearest, T).any():
            return not_beside((first[0], np.array([nearest])), (name, taken[:1]), origin)
    return None


def _off(gaps: np.ndarray, T: float) -> np.ndarray:
    """Which are no whole number of periods, as well as the period is known."""
    count = np.rint(gaps / T)
    return np.abs(gaps - count * T) > UNEVEN * T * np.maximum(np.abs(count), 1)


def _apart(gaps: np.ndarray) -> str:
    low, high = f"{np.min(gaps):.6g}", f"{np.max(gaps):.6g}"
    return low if low == high else f"{low} to {high}"


def _cut_off(gaps: np.ndarray, T: float) -> str:
    """Where the first gap alone is short, as of late samples whose first is taken at the start: what evens it."""
    if gaps.size < 2 or gaps[0] > T or _off(gaps[1:], T).any():
        return ""
    more = f"an offset that is {T - gaps[0]:.6g} longer"
    return f", for the first gap alone: where a delay reaches back beyond the start, {more} gives even ones"
