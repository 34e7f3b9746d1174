"""How far two passes through one run are apart, relative to what they measure.

The measure is that of ``solver.accuracy``: the difference of a metric m counts relative to max(|m|, 1e-6 max |x_i|),
a settling time is right within a step of its grid, and the truth of state i counts relative to max |x_i|. What says
nothing but rounding is left out: a settling time below a bound that is smaller than the errors allowed, the variation
of an estimate over that of a state that rests.
"""

from __future__ import annotations

import numpy as np

from hgorun.result.data import PLANT
from hgorun.result.metrics.base import all_metrics, largest
from hgorun.result.metrics.sizes import PEAK
from hgorun.simulation.measured import Measured
from hgorun.simulation.prepared import PreparedRun

_FLOOR = 1e-6  # of the largest value of a state: what is smaller counts as that
_PIECE = 1 << 14  # points at a time
_SAME_TIME = 0.01  # of the time since the start: two passes that lose an observer so close agree


def differences(run: PreparedRun, fine: Measured, coarse: Measured) -> dict[str, float]:
    """The relative difference of two passes, for the plant and for every observer; infinite where one alone is lost."""
    size = _reach(fine.x)
    found = {PLANT: _largest(_gap(fine.x, coarse.x), size)}
    for j, block in enumerate(run.observers):
        xhat, other = fine.estimates.of(j), coarse.estimates.of(j)
        if not _same_end(run, fine.lost(j), coarse.lost(j)):
            found[block.label] = np.inf
            continue
        own = np.maximum(size, _FLOOR * _reach(xhat))
        apart = _largest(_gap(xhat, other), np.maximum(own, _reach(xhat)))
        found[block.label] = max(apart, _metrics(run, fine, coarse, j, own))
    return found


def _reach(values: np.ndarray) -> np.ndarray:
    """Largest finite absolute value along the first axis."""
    reach = np.zeros(values.shape[1:])
    for start in range(0, len(values), _PIECE):
        piece = values[start : start + _PIECE]
        found = largest(np.abs(piece))
        if not np.all(np.isfinite(found)):
            found = largest(np.abs(np.where(np.isfinite(piece), piece, 0.0)))
        np.maximum(reach, found, out=reach)
    return reach


def _gap(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Largest difference along the first axis, where both are numbers; in pieces, since arrays may be large."""
    largest = np.zeros(a.shape[1:])
    with np.errstate(invalid="ignore", over="ignore"):
        for start in range(0, len(a), _PIECE):
            piece = slice(start, start + _PIECE)
            np.maximum(largest, _reach(a[piece] - b[piece]), out=largest)
    return largest


def _largest(gap: np.ndarray, size: np.ndarray) -> float:
    """The largest of some differences over what they are relative to; none is none of nothing."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.max(np.where(gap == 0, 0.0, gap / size), initial=0.0))


def _same_end(run: PreparedRun, a: float, b: float) -> bool:
    """Whether two passes lose an observer at the same time, or neither does."""
    if not (np.isfinite(a) and np.isfinite(b)):
        return bool(a == b)
    return bool(abs(a - b) <= max(_SAME_TIME * (min(a, b) - run.time.start), run.grid[1] - run.grid[0]))


def _metrics(run: PreparedRun, fine: Measured, coarse: Measured, observer: int, size: np.ndarray) -> float:
    """The largest relative difference of the metrics of an observer."""
    known, time, worst = all_metrics(), run.time, 0.0
    settled = fine.settings.settling * fine.metrics[PEAK.name][observer] > run.solver.accuracy * _FLOOR * size
    for name, values in fine.metrics.items():
        a, b = values[observer], coarse.metrics[name][observer]
        unit, counts = known[name].unit, np.ones(a.shape, dtype=bool)
        with np.errstate(invalid="ignore", divide="ignore"):
            gap, value, floor = np.abs(a - b), np.abs(a), _FLOOR * size
            if unit == "time":
                gap = np.maximum(gap - run.experiment.metric_step * (1 + 1e-6), 0.0)
                value, floor = np.abs(a - time.start), np.full(a.shape, _FLOOR * run.span)
                counts = settled
            elif unit == "1":  # a ratio to how much the state moves
                counts, floor = fine.moved > floor, floor / fine.moved
        if np.any(np.isfinite(a[counts]) != np.isfinite(b[counts])):
            return float("inf")
        counts = counts & np.isfinite(a)
        worst = max(worst, _largest(gap[counts], np.maximum(value, floor)[counts]))
    return worst
