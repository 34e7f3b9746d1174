"""What is drawn of one observer and state, and what limits of axes follow from: found once for each estimate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.explore.bench import Shown
from hgorun.figures.data import Curve, Size, Spread, finite, moving_maximum, thinned
from hgorun.figures.panels import moving_window
from hgorun.memo import Memo
from hgorun.result.result import Result

POINTS = 800  # of a curve: two for every pixel of its figure, about


@dataclass(frozen=True, eq=False)
class Truth:
    """A state of a simulated plant."""

    curve: Curve
    spread: Spread | None


@dataclass(frozen=True, eq=False)
class Trace:
    """An estimate of a state and its error, which is the largest in a moving window."""

    estimate: Curve
    spread: Spread | None
    error: Curve
    size: Size | None


_TRUTHS: Memo[Truth] = Memo(64)
_TRACES: Memo[Trace] = Memo(256)


def truth_of(shown: Shown, i: int, label: str | None = None) -> Truth:
    """State ``i`` of the plant, or of the one that an observer drives."""
    result = shown.result

    def made() -> Truth:
        curve = _numbers(result, result.truth_of(label)[:, i])
        return Truth(thinned(curve, POINTS), Spread.of(curve.v))

    return _TRUTHS.get((shown.truths[label], i), made)


def trace_of(shown: Shown, label: str, i: int) -> Trace:
    """An observer's estimate of state ``i``."""
    result, points = shown.result, window(shown.result)
    xhat = result.observers[label].xhat

    def made() -> Trace:
        estimate = _numbers(result, xhat[:, i])
        with np.errstate(over="ignore"):
            error = _numbers(result, np.abs(xhat[:, i] - result.truth_of(label)[:, i]))
        largest = error._replace(v=moving_maximum(error.v, points))
        drawn = positive(thinned(largest, POINTS))
        return Trace(thinned(estimate, POINTS), Spread.of(estimate.v), drawn, Size.of(largest.v))

    return _TRACES.get((shown.contents[label], i, points), made)


def _numbers(result: Result, values: np.ndarray) -> Curve:
    return finite(result.time, np.ascontiguousarray(values))


def window(result: Result) -> int:
    """Points of the moving window of errors."""
    if len(result.time) < 2:
        return 1
    return round(moving_window(result) / float(result.time[1] - result.time[0]))


def positive(curve: Curve) -> Curve:
    """What a logarithmic axis can show; the rest is a gap."""
    return Curve(curve.t, np.where(curve.v > 0, curve.v, np.nan))
