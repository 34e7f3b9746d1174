"""What of the trajectories is drawn: which stretch, how many points, in which limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hgorun.figures.style import LARGEST_NUMBER
from hgorun.pieces import quantiles

MAX_POINTS = 8_000  # two for every half a pixel of the widest panel
# A line is a block of colour if it goes up and down so often in the middle one of so many parts, and if in the mean a
# part fills so much of its range.
_PARTS, _TURNS, _FILLED = 400, 2.0, 0.03
# How far, in units of the truth's range, an estimate widens a panel: alone, beside others, diverged.
_ALONE, _BESIDE, _DIVERGED = 3.0, 1.5, 0.25
_BAND = 0.25  # of a panel: so much higher it is made for a band
_RARE = 0.005  # of recorded values at either end: so few may be outliers
_ERROR_BESIDE = 10.0  # the same for errors, in units of the median observer's largest error
_WILD = 100.0  # in the same units: larger ones would hide the rest
_ROUGHER = 1.5  # a line that goes up and down so many times more than another one would hide it
_STEADY = 0.01  # of the points of a line's second half: so many beyond a bound are no transient


class Curve(NamedTuple):
    """Points of one line."""

    t: np.ndarray
    v: np.ndarray


class Spread(NamedTuple):
    """What the limits of an axis of states follow from: where a curve begins, and between what values it lies.

    Attributes
    ----------
    central : (low, high)
        Between which it lies but for a hundredth at either end.
    """

    start: float
    low: float
    high: float
    central: tuple[float, float]

    @classmethod
    def of(cls, v: np.ndarray) -> Spread | None:
        """None of a curve without points."""
        if not v.size:
            return None
        low, high = quantiles(v, np.array([0.01, 0.99])).tolist()
        return cls(float(v[0]), float(v.min()), float(v.max()), (low, high))


class Size(NamedTuple):
    """What the limits of a logarithmic axis follow from: the largest value, and what a hundredth lies below."""

    usual: float
    high: float

    @classmethod
    def of(cls, v: np.ndarray) -> Size | None:
        """None of a curve without positive values."""
        v = v[v > 0]
        return cls(float(quantiles(v, np.array([0.01]))[0]), float(v.max())) if v.size else None


def finite(t: np.ndarray, v: np.ndarray) -> Curve:
    """The first stretch of numbers that axes can show."""
    known = np.abs(v) <= LARGEST_NUMBER
    start = int(np.argmax(known)) if known.any() else len(v)
    bad = np.flatnonzero(~known[start:])
    end = start + int(bad[0]) if bad.size else len(v)
    return Curve(t[start:end], v[start:end])


def inside(curve: Curve, window: tuple[float, float] | None) -> Curve:
    """The part in a window of time, with one point more at either end so that the line reaches the edge."""
    if window is None:
        return curve
    first = max(int(np.searchsorted(curve.t, window[0], "left")) - 1, 0)
    last = int(np.searchsorted(curve.t, window[1], "right")) + 1
    return Curve(curve.t[first:last], curve.v[first:last])


def thinned(curve: Curve, limit: int = MAX_POINTS) -> Curve:
    """At most about ``limit`` points that draw the same line: the smallest and the largest of every bin.

    First and last point stay.
    """
    t, v = curve
    if len(t) <= limit:
        return curve
    bins = max(limit // 2 - 1, 1)
    size = -(-len(t) // bins)
    starts = np.arange(0, len(t), size)
    whole = len(t) // size
    body = v[: whole * size].reshape(whole, size)
    picks = [starts[:whole] + body.argmin(axis=1), starts[:whole] + body.argmax(axis=1), [0, len(t) - 1]]
    if whole < len(starts):
        rest = v[whole * size :]
        picks.append([whole * size + int(rest.argmin()), whole * size + int(rest.argmax())])
    keep = np.zeros(len(t), dtype=bool)
    keep[np.concatenate(picks)] = True
    return Curve(t[keep], v[keep])


def mean_of_block(curve: Curve, parts: int = _PARTS) -> Curve | None:
    """The mean of a curve whose oscillations are too fast to be told from each other in print; None of another.

    Parameters
    ----------
    parts : int
        In which the curve is looked at, or a few more, so that they reach its end; the mean has a point for each.
    """
    size = len(curve.t) // parts
    if size < 4 * _TURNS:
        return None
    count = len(curve.t) // size
    t, v = (column[: count * size].reshape(count, size) for column in curve)
    heights = np.ptp(v, axis=1)
    turns = np.abs(np.diff(v, axis=1)).sum(axis=1) / np.maximum(2 * heights, np.finfo(float).tiny)
    middle = quantiles(curve.v, np.array([0.005, 0.995]))  # a transient is no reason to see noise as thin
    filled = heights.mean() > _FILLED * (middle[1] - middle[0])
    return Curve(t.mean(axis=1), v.mean(axis=1)) if filled and np.median(turns) > _TURNS else None


def behind(curves: Sequence[Curve]) -> list[int]:
    """The places of curves from the back to the front: as they are, but none in front of a much smoother one."""
    rough = [float(np.abs(np.diff(curve.v)).sum()) for curve in curves]
    left, found = list(range(len(curves))), []
    while left:
        roughest = max(rough[k] for k in left)
        found.append(next(k for k in left if rough[k] * _ROUGHER >= roughest))
        left.remove(found[-1])
    return found


def moving_maximum(values: np.ndarray, points: int) -> np.ndarray:
    """The largest value among about ``points`` neighbours, centred; fewer at the ends.

    That of scipy.ndimage is slower, and its import takes longer than a figure.

    Parameters
    ----------
    values : ndarray, shape (..., Nt)
        What is no finite number stays so, and is left out of the others.
    """
    half = points // 2
    if half == 0 or not values.size:
        return values
    known = np.isfinite(values)
    ends = np.full((*values.shape[:-1], half), -np.inf)
    found = np.concatenate([ends, np.where(known, values, -np.inf), ends], axis=-1)
    width = 1
    while 2 * width <= 2 * half + 1:  # found[..., i] is the largest of width values from i on
        found = np.maximum(found[..., :-width], found[..., width:])
        width *= 2
    rest, count = 2 * half + 1 - width, values.shape[-1]
    return np.where(known, np.maximum(found[..., :count], found[..., rest : rest + count]), values)


def without_outliers(v: np.ndarray) -> np.ndarray:
    """Recorded values that an axis is made for: none far from where all but half a hundredth at either end lie.

    Of few values all stay, since each is then a part of what was measured.
    """
    if v.size * _RARE < 1:
        return v
    low, high = quantiles(v, np.array([_RARE, 1 - _RARE])).tolist()
    room = _BAND * (high - low)
    return np.asarray(v[(v >= low - room) & (v <= high + room)])


def state_limits(
    truths: Sequence[np.ndarray], healthy: Sequence[np.ndarray], lost: Sequence[np.ndarray]
) -> tuple[float, float] | None:
    """Range of a panel with the truth and its estimates, which no wild estimate stretches at will.

    Returns
    -------
    tuple of float, or None
        None where nothing is drawn.
    """
    return limits_about([*map(Spread.of, truths)], [*map(Spread.of, healthy)], [*map(Spread.of, lost)])


def limits_about(
    truths: Sequence[Spread | None], healthy: Sequence[Spread | None], lost: Sequence[Spread | None]
) -> tuple[float, float] | None:
    """As :func:`state_limits`, from what is known of the curves; None of one without points."""
    spans = [(v.low, v.high) for v in truths if v]
    central = [v.central for v in healthy if v]
    if not spans:  # without a truth
        spans = central or [(v.start, v.start) for v in lost if v]
    if not spans:
        return None
    floor, ceiling = min(a for a, _ in spans), max(b for _, b in spans)
    scale = max(ceiling - floor, _lower_median([b - a for a, b in central])) or abs(ceiling) or 1.0
    reach = _ALONE if len(healthy) + len(lost) <= 1 else _BESIDE
    low, high = floor, ceiling
    for values, times in ((healthy, reach), (lost, _DIVERGED)):
        for v in values:
            if v:
                low = min(low, max(v.low, floor - times * scale))
                high = max(high, min(v.high, ceiling + times * scale))
    return _with_margin(low, high)


def with_bands(limits: tuple[float, float] | None, edges: Sequence[np.ndarray]) -> tuple[float, float] | None:
    """Limits of a panel that hold its bands, too, on a side where that takes little: wider ones are cut with a mark."""
    points = [values for values in edges if values.size]
    if limits is None or not points:
        return limits
    low, high = limits
    room = _BAND * (high - low)
    lowest, highest = min(float(v.min()) for v in points), max(float(v.max()) for v in points)
    margin = 0.02 * (high - low)
    return (
        lowest - margin if low - room <= lowest < low + margin else low,
        highest + margin if high - margin < highest <= high + room else high,
    )


def error_limits(healthy: Sequence[np.ndarray], lost: Sequence[np.ndarray]) -> tuple[float, float] | None:
    """Range of a panel of errors; zero is in it.

    Beside smaller errors a transient is cut, but not what comes back all the time: it would be cut all along.
    """
    used = [v for v in healthy if v.size] or [v for v in lost if v.size]
    if not used:
        return None
    largest = [float(np.abs(v).max()) for v in used]
    usual = _lower_median(largest)
    bound = _ERROR_BESIDE * usual or max(largest)
    staying = [size for v, size in zip(used, largest, strict=True) if size <= _WILD * usual and _comes_back(v, bound)]
    bound = max([bound, *staying])
    low = max(min(0.0, *(float(v.min()) for v in used)), -bound)
    high = min(max(0.0, *(float(v.max()) for v in used)), bound)
    return _with_margin(low, high)


def magnitude_limits(healthy: Sequence[np.ndarray], lost: Sequence[np.ndarray]) -> tuple[float, float] | None:
    """Range of a logarithmic panel: two to eight decades; small errors may leave it for a moment."""
    known = [size for size in map(Size.of, healthy) if size] or [size for size in map(Size.of, lost) if size]
    return limits_of_sizes(known)


def limits_of_sizes(sizes: Sequence[Size]) -> tuple[float, float] | None:
    """As :func:`magnitude_limits`, from what is known of the curves."""
    if not sizes:
        return None
    high = max(size.high for size in sizes)
    low = max(min(size.usual for size in sizes), high * 1e-8, 1e-300)
    if high < 100 * low:  # whole decades, so that two of them are labelled
        return 10.0 ** math.floor(math.log10(low / 1.1)), 10.0 ** math.ceil(math.log10(high * 1.1))
    return low / 1.5, high * 1.5


def _comes_back(values: np.ndarray, bound: float) -> bool:
    """Whether values are beyond a bound not only at their beginning."""
    later = np.abs(values[values.size // 2 :])
    return bool(np.mean(later > bound) > _STEADY)


def _lower_median(values: Sequence[float]) -> float:
    return sorted(values)[(len(values) - 1) // 2] if values else 0.0


def _with_margin(low: float, high: float) -> tuple[float, float]:
    margin = 0.05 * (high - low) or 0.05 * abs(high) or 0.05
    return low - margin, high + margin
