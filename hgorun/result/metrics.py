"""Numbers that say how good an estimate is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.config.models import Metrics, Time

# rmse, sup: over the steady window; peak: over the transient one; settling: last time above a part of the peak;
# hf: standard deviation of the error minus its moving mean; tv: total variation over that of the state
NAMES = ("rmse", "sup", "peak", "settling", "hf", "tv")


@dataclass(frozen=True)
class Windows:
    """Where the metrics look, with nothing omitted."""

    steady: tuple[float, float]
    transient: tuple[float, float]
    average: float
    settling: float

    @classmethod
    def of(cls, metrics: Metrics, time: Time) -> Windows:
        """Defaults: the last two thirds, the first third, 1 % of the run."""
        span = time.end - time.start
        third = time.start + span / 3
        return cls(
            metrics.window or (third, time.end),
            metrics.transient or (time.start, third),
            metrics.average or span / 100,
            metrics.settling,
        )


def measure(t: np.ndarray, x: np.ndarray, xhat: np.ndarray, windows: Windows) -> dict[str, np.ndarray]:
    """All metrics of one estimate.

    Parameters
    ----------
    t : ndarray, shape (Nt,)
        Evenly spaced.
    x, xhat : ndarray, shape (Nt, n)
    windows : Windows

    Returns
    -------
    dict of str to ndarray, shape (n,)
        Infinite where the estimate is not finite.
    """
    n = x.shape[1]
    if not np.all(np.isfinite(xhat)):
        return {name: np.full(n, np.inf) for name in NAMES}
    e = xhat - x
    steady, transient = _inside(t, windows.steady), _inside(t, windows.transient)
    e_s = e[steady]
    peak = _largest(e[transient], n)
    above = np.abs(e) > windows.settling * peak
    settled = [t[np.flatnonzero(column)[-1]] if column.any() else t[0] for column in above.T]
    variation = np.abs(np.diff(x[steady], axis=0)).sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        tv = np.abs(np.diff(xhat[steady], axis=0)).sum(axis=0) / variation
    return {
        "rmse": np.sqrt(np.mean(e_s**2, axis=0)) if len(e_s) else np.full(n, np.nan),
        "sup": _largest(e_s, n),
        "peak": peak,
        "settling": np.array(settled),
        "hf": _high_frequency(e_s, _odd(windows.average, t)),
        "tv": tv,
    }


def _inside(t: np.ndarray, window: tuple[float, float]) -> np.ndarray:
    """Grid points of a window, ends included in spite of rounding."""
    slack = 1e-9 * (t[1] - t[0]) if t.size > 1 else 0.0
    return (t >= window[0] - slack) & (t <= window[1] + slack)


def _largest(e: np.ndarray, n: int) -> np.ndarray:
    return np.max(np.abs(e), axis=0) if len(e) else np.full(n, np.nan)


def _odd(length: float, t: np.ndarray) -> int:
    """The odd number of points that spans about a length."""
    return 2 * round(length / (t[1] - t[0]) / 2) + 1 if t.size > 1 else 1


def _high_frequency(e: np.ndarray, points: int) -> np.ndarray:
    """Standard deviation of e minus its centred mean, where the mean has all its points."""
    if len(e) < points:
        return np.full(e.shape[1], np.nan)
    if points == 1:  # the mean is the point itself
        return np.zeros(e.shape[1])
    total = np.cumsum(np.vstack([np.zeros(e.shape[1]), e]), axis=0)
    mean = (total[points:] - total[:-points]) / points
    half = points // 2
    return np.asarray(np.std(e[half : len(e) - half] - mean, axis=0))
