"""How far two passes through one run are apart, relative to what they measure.

The measure is that of ``solver.accuracy``: the difference of a metric m counts relative to max(|m|, 1e-6 max |x_i|),
a settling time is right within a step of its grid, and the truth of state i counts relative to max |x_i|. What says
nothing but rounding is left out: a settling time below a bound that is smaller than the errors allowed, the variation
of an estimate over that of a state that rests. Of a state that rests at zero, metrics count relative to no less than
1e-9 of the largest estimate: gains amplify the rounding of the outputs, the more steps there are the more.

A settling time jumps where the error of an estimate crosses its bound. Two passes whose errors differ by more than that
bound say nothing of when, so that not the jump counts but how far the errors are apart, relative to their peak.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.result.metrics.base import all_metrics, largest
from hgorun.result.metrics.sizes import PEAK
from hgorun.result.records.data import PLANT, IntegrationError
from hgorun.simulation.outcome.measured import Measured
from hgorun.simulation.prepared import PreparedRun

_FLOOR = 1e-6  # of the largest value of a state: what is smaller counts as that
_RESTS = 1e-9  # of the largest state: one that is smaller all along rests at zero
_AMPLIFIED = 1e-3  # of the largest estimate of such a state: its metrics count relative to 1e-6 of that
_PIECE = 1 << 14  # points at a time
_SAME_TIME = 0.01  # of the time since the start: two passes that lose an observer so close agree


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Estimate:
    """What a pass says of one observer; several runs lie along the last axes.

    Attributes
    ----------
    x, xhat : ndarray, shape (Nt, n, ...)
        The truth that it estimates, and the estimates.
    metrics : mapping of str to ndarray, shape (n, ...)
    """

    x: np.ndarray
    xhat: np.ndarray
    metrics: Mapping[str, np.ndarray]


@dataclass(frozen=True, eq=False, repr=False)
class Differences:
    """How far two passes are apart.

    Attributes
    ----------
    relative : mapping of str to float
        For the plant and every observer.
    uncertain : mapping
        ``{label: {metric: ndarray of shape (n,)}}``: where the passes have two settling times, how far their errors are
        apart, over the bound that they settle below; else 0.
    """

    relative: Mapping[str, float]
    uncertain: Mapping[str, Mapping[str, np.ndarray]]

    def error(self, part: float, labels: Collection[str], states: Sequence[str]) -> IntegrationError:
        """The error of the first pass, which is that part of the difference, for some labels."""
        unresolved: dict[str, dict[str, tuple[str, ...]]] = {}
        for label, of in self.uncertain.items():
            for metric, over in of.items():
                which = tuple(state for state, value in zip(states, part * over, strict=True) if value > 1)
                if which and label in labels:
                    unresolved.setdefault(label, {})[metric] = which
        return IntegrationError({label: part * self.relative[label] for label in labels}, unresolved)


def differences(run: PreparedRun, fine: Measured, coarse: Measured) -> Differences:
    """The relative difference of two passes, for the plant and for every observer; infinite where one alone is lost."""
    found, uncertain = {PLANT: float(plant_difference(fine.x, coarse.x))}, {}
    for j, block in enumerate(run.observers):
        if not _same_end(run, fine.lost(j), coarse.lost(j)):
            found[block.label] = np.inf
            continue
        ours, theirs = (
            Estimate(
                x=one.truths.of(j),
                xhat=one.estimates.of(j),
                metrics={name: values[j] for name, values in one.metrics.items()},
            )
            for one in (fine, coarse)
        )
        found[block.label] = float(_of_observer(run, fine, coarse, j, ours, theirs))
        uncertain[block.label] = _uncertain_times(run, ours, theirs)
    return Differences(found, uncertain)


def _of_observer(
    run: PreparedRun, fine: Measured, coarse: Measured, j: int, ours: Estimate, theirs: Estimate
) -> np.ndarray:
    """Of an estimate; where it drives a plant of its own also of that, and nothing of one that is lost."""
    x = fine.truths.of(j)
    if not run.closed:
        return difference(run, ours, theirs, size_of(x), fine.moved(j))
    if fine.verdicts[j].lost:
        return np.zeros(())
    found = difference(run, ours, theirs, size_of(x), fine.moved(j))
    return np.asarray(np.maximum(found, plant_difference(x, coarse.truths.of(j))))


def size_of(x: np.ndarray) -> np.ndarray:
    """max |x_i| over a run, shape (n, ...) from (Nt, n, ...)."""
    return _reach(x)


def plant_difference(x: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The relative difference of two truths, shape (...) from (Nt, n, ...)."""
    return _largest(_gap(x, other), size_of(x))


def difference(run: PreparedRun, fine: Estimate, coarse: Estimate, size: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """The relative difference of two estimates that are not lost, shape (...).

    Parameters
    ----------
    size, moved : ndarray, shape (n, ...)
        max |x_i|, and the variation of x_i in the steady window.
    """
    reach = _reach(fine.xhat)
    own = np.maximum(size, _FLOOR * reach)
    apart = _largest(_gap(fine.xhat, coarse.xhat), np.maximum(own, reach))
    rests = size <= _RESTS * np.max(size, axis=0)
    least = np.where(rests, np.maximum(own, _AMPLIFIED * reach), own)
    return np.asarray(np.maximum(apart, _metrics(run, fine, coarse, least, moved)))


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
    return _reached(len(a), a.shape[1:], lambda piece: a[piece] - b[piece])


def _gap_of_errors(fine: Estimate, coarse: Estimate) -> np.ndarray:
    """The same of the errors of two estimates, in which differences of the truth cancel."""
    return _reached(
        len(fine.x),
        fine.x.shape[1:],
        lambda piece: (fine.xhat[piece] - fine.x[piece]) - (coarse.xhat[piece] - coarse.x[piece]),
    )


def _reached(count: int, shape: tuple[int, ...], part: Callable[[slice], np.ndarray]) -> np.ndarray:
    """The :func:`_reach` of an array that is made in pieces."""
    largest = np.zeros(shape)
    with np.errstate(invalid="ignore", over="ignore"):
        for start in range(0, count, _PIECE):
            np.maximum(largest, _reach(part(slice(start, start + _PIECE))), out=largest)
    return largest


def _largest(gap: np.ndarray, size: np.ndarray) -> np.ndarray:
    """The largest along the first axis of some differences over what they are relative to; none is none of nothing."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.max(np.where(gap == 0, 0.0, gap / size), axis=0, initial=0.0))


def _same_end(run: PreparedRun, a: float, b: float) -> bool:
    """Whether two passes lose an observer at the same time, or neither does."""
    if not (np.isfinite(a) and np.isfinite(b)):
        return bool(a == b)
    return bool(abs(a - b) <= max(_SAME_TIME * (min(a, b) - run.time.start), run.grid[1] - run.grid[0]))


def _metrics(run: PreparedRun, fine: Estimate, coarse: Estimate, size: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """The largest relative difference of the metrics of an observer, shape (...) from (n, ...)."""
    known, worst = all_metrics(closed=True), np.zeros(size.shape[1:])
    for name, a in fine.metrics.items():
        b = coarse.metrics[name]
        unit, counts = known[name].unit, np.ones(a.shape, dtype=bool)
        with np.errstate(invalid="ignore", divide="ignore"):
            gap, value, floor = np.abs(a - b), np.abs(a), _FLOOR * size
            if unit == "time":
                gap, value, counts = _times(run, fine, coarse, name, size)
                floor = np.zeros(a.shape)
            elif unit == "1":  # a ratio to how much the state moves
                counts, floor = moved > floor, floor / moved
        lost = np.any(counts & (np.isfinite(a) != np.isfinite(b)), axis=0)
        counts = counts & np.isfinite(a)
        apart = _largest(np.where(counts, gap, 0.0), np.maximum(value, floor))
        worst = np.where(lost, np.inf, np.maximum(worst, apart))
    return worst


def _times(
    run: PreparedRun, fine: Estimate, coarse: Estimate, name: str, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How far settling times are apart, relative to what, and of which states it counts; shapes (n, ...)."""
    a, peak = fine.metrics[name], fine.metrics[PEAK.name]
    bound, gap = _bound(run, fine), _gap_of_times(run, fine, coarse, name)
    value = np.maximum(np.abs(a - run.time.start), _FLOOR * run.span)
    counts = bound > run.solver.accuracy * _FLOOR * size
    if np.any(counts & (gap > 0)):
        errors = _gap_of_errors(fine, coarse)
        apart = errors > bound
        gap = np.where(apart, errors, gap)
        value = np.where(apart, np.maximum(peak, _FLOOR * size), value)
    return gap, value, counts


def _bound(run: PreparedRun, fine: Estimate) -> np.ndarray:
    """What errors settle below, shape (n, ...)."""
    return np.asarray(run.experiment.blocks.metrics.settling * fine.metrics[PEAK.name])


def _gap_of_times(run: PreparedRun, fine: Estimate, coarse: Estimate, name: str) -> np.ndarray:
    """How far settling times are apart, but for a step of their grid, shape (n, ...)."""
    with np.errstate(invalid="ignore"):  # two that are infinite are not apart
        apart = np.abs(fine.metrics[name] - coarse.metrics[name])
    return np.asarray(np.maximum(apart - run.experiment.metric_step * (1 + 1e-6), 0.0))


def _uncertain_times(run: PreparedRun, fine: Estimate, coarse: Estimate) -> dict[str, np.ndarray]:
    """See :class:`Differences`; infinite where the bound is smaller than the errors allowed."""
    known, found = all_metrics(closed=True), {}
    for name in fine.metrics:
        if known[name].unit != "time":
            continue
        gap = _gap_of_times(run, fine, coarse, name)
        if np.any(gap > 0):
            bound, size = _bound(run, fine), size_of(fine.x)
            with np.errstate(divide="ignore", invalid="ignore"):
                over = np.where(
                    bound > run.solver.accuracy * _FLOOR * size, _gap_of_errors(fine, coarse) / bound, np.inf
                )
            found[name] = np.where(gap > 0, over, 0.0)
    return found
