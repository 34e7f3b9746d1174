"""How far apart times usually are: the step of evenly spaced ones, or the median of all, also of very many."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hgorun.memo import Memo, same
from hgorun.pieces import median, quantiles

_PIECE = 2**15  # times whose steps are compared at once: as many as a cache of the processor holds

_MANY = 2**20  # times whose steps are not all held at once
_SHOWN = 10_000  # steps that show where the median lies
_BESIDE = 0.02  # of all steps on either side of it

# the outputs of a file share their times
_STEPS: Memo[float] = Memo(2)
_EVEN_STEPS: Memo[float] = Memo(2)


def even_step(times: np.ndarray) -> float:
    """The step of times that are evenly spaced, but perhaps for some that are missing; of others the median.

    Hardly any of the rounding of the times is in the step, so that its multiples are the times, to their rounding.
    """
    return _EVEN_STEPS.get(same(times), lambda: _even_step(times))


def _even_step(times: np.ndarray) -> float:
    if times.size > 2 and times[-1] > times[0]:
        slack = 4 * np.spacing(max(abs(float(times[0])), abs(float(times[-1]))))
        shortest, longest = np.inf, -np.inf
        for steps in _steps(times):
            shortest, longest = min(shortest, float(steps.min())), max(longest, float(steps.max()))
            if not longest - shortest <= slack:
                break
        else:
            return float(times[-1] - times[0]) / (times.size - 1)
        found = _step_with_gaps(times, median_step(times), slack)
        if found is not None:
            return found
    return median_step(times)


def unevenness(times: np.ndarray) -> float:
    """How far steps of times are from their median, on average, as a fraction of it; infinite where that is 0."""
    steps = np.diff(times).astype(float)
    usual = median(steps) if steps.size else 0.0
    return float(np.mean(np.abs(steps - usual))) / usual if usual > 0 else np.inf


def _step_with_gaps(times: np.ndarray, usual: float, slack: float) -> float | None:
    """The step of which all times are multiples, from the first on; None where there is none.

    Parameters
    ----------
    times : ndarray
    usual : float
        The step, with the rounding of two times.
    slack : float
        How far times may be off by rounding.
    """
    if not usual > 2 * slack:  # NaN, too
        return None
    total = 0.0
    for steps in _steps(times):
        counts = np.rint(steps / usual)
        if not np.all(np.abs(steps - counts * usual) <= slack * (1 + np.abs(counts))):
            return None
        total += float(counts.sum())
    step, at, first = float(times[-1] - times[0]) / total, 0.0, 1
    for steps in _steps(times):
        places = at + np.cumsum(np.rint(steps / usual))
        own = times[first : first + steps.size]
        if not np.all(np.abs(own - times[0] - places * step) <= slack):
            return None
        at, first = float(places[-1]), first + steps.size
    return step


def _steps(times: np.ndarray) -> Iterator[np.ndarray]:
    """The steps from time to time, piece by piece."""
    return (np.diff(times[first : first + _PIECE + 1]) for first in range(0, times.size - 1, _PIECE))


def median_step(times: np.ndarray) -> float:
    """The median of the steps of some times, without those that are repeated; NaN where there is none."""
    return _STEPS.get(same(times), lambda: _median_step(times))


def _median_step(times: np.ndarray) -> float:
    found = _median_within(times) if times.size > _MANY else None
    if found is not None:
        return found
    steps = np.diff(times)
    later = steps > 0
    if not later.all():
        steps = steps[later]
    return median(steps, spare=True) if steps.size else float("nan")


def _median_within(times: np.ndarray) -> float | None:
    """The same of times that increase, where some of the steps show what the median lies between; else None.

    Most steps are only counted: where they differ by rounding alone, both bounds are the median.
    """
    some = np.arange(0, times.size - 1, max(times.size // _SHOWN, 1))
    low, high = quantiles(times[some + 1] - times[some], np.array([0.5 - _BESIDE, 0.5 + _BESIDE])).tolist()
    below, equal, between = 0, 0, []
    for steps in _steps(times):
        if not steps.min() > 0:
            return None
        below += int(np.count_nonzero(steps < low))
        equal += int(np.count_nonzero(steps == low))
        if high > low:
            between.append(steps[(steps > low) & (steps <= high)])
    count = times.size - 1
    middle = np.array([(count - 1) // 2, count // 2]) - below
    inside = np.concatenate([np.empty(0), *between])
    if middle[0] < 0 or middle[1] >= equal + inside.size:
        return None
    inside.sort()
    return float(np.mean([low if place < equal else inside[place - equal] for place in middle.tolist()]))
