"""Means of random draws with their uncertainty, and tests of differences."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Floats

LEVEL = 0.95  # of the intervals


def interval(mean: Floats | float, sem: Floats | float, n: NDArray[np.int64] | int) -> tuple[Any, Any]:
    """The interval of a mean by Student's t; NaN where the standard error is."""
    from scipy.special import stdtrit  # scipy.stats takes a second to import

    half = stdtrit(np.maximum(np.asarray(n) - 1, 1), (1 + LEVEL) / 2) * sem
    return mean - half, mean + half


def holm(p: Sequence[float]) -> list[float]:
    """The p values of several tests, adjusted so that they can be read as those of one.

    References
    ----------
    S. Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Statist. 6 (1979) 65-70.
    """
    order = np.argsort(p, kind="stable")
    adjusted = np.full(len(p), np.nan)
    largest, left = 0.0, int(np.sum(~np.isnan(p)))
    for place in order[:left]:  # NaN is sorted last
        largest = max(largest, min(left * float(p[place]), 1.0))
        adjusted[place] = largest
        left -= 1
    return [float(value) for value in adjusted]


def mean_of(values: Floats, sound: NDArray[np.bool_]) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Mean, standard error and number of what is sound, along the first axis."""
    n = np.sum(np.broadcast_to(sound, values.shape), axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        used = np.where(sound, values, 0.0)
        mean = np.where(n > 0, np.sum(used, axis=0) / n, np.nan)
        least = np.min(np.where(sound, values, np.inf), axis=0, initial=np.inf)
        largest = np.max(np.where(sound, values, -np.inf), axis=0, initial=-np.inf)
        mean = np.where((n > 0) & (least == largest), least, mean)  # without chance there is no rounding, either
        squares = np.sum(np.where(sound, (values - mean) ** 2, 0.0), axis=0)
        sem = np.where(n > 1, np.sqrt(squares / (n - 1) / n), np.nan)
    return mean, sem, n


def paired(
    a: Floats, b: Floats, sound: NDArray[np.bool_], *, chance: bool
) -> tuple[int, float, tuple[float, float], float]:
    """Number, mean, interval and p of a - b; the latter two only where chance alone tells members apart."""
    from scipy.special import stdtr

    with np.errstate(invalid="ignore"):
        found = mean_of(a - b, sound)
    mean, sem, n = float(found[0]), float(found[1]) if chance else float("nan"), int(found[2])
    low, high = interval(mean, sem, n)
    if not np.isfinite(sem):
        return n, mean, (float(low), float(high)), float("nan")
    p = 2 * float(stdtr(n - 1, -abs(mean) / sem)) if sem > 0 else float(mean == 0)
    return n, mean, (float(low), float(high)), p
