"""How rough the estimate is: hf, tv."""

from __future__ import annotations

import numpy as np

from hgorun.result.metrics.base import Estimates, Metric, metric


def _high_frequency(estimates: Estimates) -> np.ndarray:
    """Standard deviation of e minus its centred mean, where the mean has all its points."""
    e, points = estimates.error, odd_points(estimates.settings.average, estimates.step)
    if len(e) < points:
        return np.full(e.shape[1:], np.nan)
    if nothing_moves(estimates.settings.average, estimates.step):  # the mean is the point itself
        return np.zeros(e.shape[1:])
    total = np.zeros((len(e) + 1, *e.shape[1:]))
    np.cumsum(e, axis=0, out=total[1:])
    mean = (total[points:] - total[:-points]) / points
    half = points // 2
    return np.asarray(np.std(e[half : len(e) - half] - mean, axis=0))


def odd_points(length: float, step: float) -> int:
    """The odd number of points that spans about a length."""
    return 2 * round(length / step / 2) + 1 if step > 0 else 1


def nothing_moves(average: float, step: float) -> bool:
    """Whether a moving mean is of one point, so that hf is 0 whatever the error is."""
    return odd_points(average, step) == 1


def _total_variation(estimates: Estimates) -> np.ndarray:
    """Of the estimate over that of the state."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(_variation(estimates.xhat) / _variation(estimates.x))


def _variation(x: np.ndarray) -> np.ndarray:
    return np.asarray(np.abs(np.diff(x, axis=0)).sum(axis=0))


HF = metric(
    Metric(
        name="hf",
        meaning="standard deviation of the error minus its moving mean, over the steady window",
        unit="state",
        measure=_high_frequency,
        phrase="high-frequency part of ${}$",
        place=50,
        setting="average",
        told=lambda length, unit: f"moving mean of {length:g} {unit}".rstrip(),
    )
)
TV = metric(
    Metric(
        name="tv",
        meaning="total variation of the estimate over that of the state, in the steady window",
        unit="1",
        measure=_total_variation,
        phrase="relative total variation of ${}$",
        ideal=1.0,
        place=60,
    )
)
