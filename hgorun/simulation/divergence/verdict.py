"""Whether an estimate has left the truth for good: a rule that does not depend on units.

The estimate of a state is lost when at the end of the run it is still a million times further from the truth than the
state is large, or than the estimate was at the start. Where that is no more than rounding (a state that rests at zero,
an output with noise) the error must also be a thousand times what it is in the quietest tenth of the run. Of a state
that rests at zero and is estimated so at the start, only the errors tell the size: a million times the quietest, and
larger than in the first tenth, since errors that fade end in rounding, which may be far above their smallest. An
estimate that peaks and comes back is not lost.

An observer goes astray where its estimate of an output swings about it, and in the last tenth of the run by more than
twice what all states, outputs, first errors and amplified noise are at most, see
:mod:`hgorun.simulation.divergence.following`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hgorun.pieces import quantiles
from hgorun.result.evaluation.estimated import Estimated
from hgorun.symbolic.evaluate import Floats

_FAR = 1e6  # times the size of the state
_GROWN = 1e3  # times the smallest errors of the run, or all states and the first error
_ROUNDING = 1e-9  # times the largest state: one that is smaller all along may be rounding
_SMALLEST = 0.1  # of the points: those with the smallest errors
_LATE = 0.1  # of the points: the last
_ASTRAY = 2.0  # times the size of a run: twice is as far as two numbers of one size can be from each other
_SWINGS = 4  # changes of an error's sign: a transient has fewer, and a constant error of the model has none
_ALIKE = 1e-2  # of an error: so far two steps may be apart where they show the same
_LOOKED_AT = 16  # of the last points


def left_for_good(x: Floats, xhat: Floats) -> int | None:
    """The first of the points from which on the estimate stays beyond the bound.

    Parameters
    ----------
    x, xhat : ndarray, shape (N, n)
        Truth and estimate at times that increase. What is not finite is beyond every bound.

    Returns
    -------
    int or None
        None where the last estimate is within the bound.
    """
    gap = _gap(x, xhat)
    near = np.flatnonzero(np.all(gap <= _bounds(x, gap), axis=1))
    if near.size and near[-1] == len(x) - 1:
        return None
    return int(near[-1]) + 1 if near.size else 0


def may_have_left(x: Floats, xhat: Floats) -> NDArray[np.bool_]:
    """Whether an estimate may have left for good, from the first and the last point alone.

    Parameters
    ----------
    x, xhat : ndarray, shape (2, n, ...)
        Of one run, or along the last axes of several.

    Returns
    -------
    ndarray of bool, shape (...)
    """
    first, last = _gap(x, xhat)
    size = np.maximum(np.max(np.abs(x), axis=0), np.where(np.isfinite(first), first, 0.0))
    return np.asarray(~np.all(last <= _FAR * size, axis=0))


@np.errstate(invalid="ignore", over="ignore")
def grow_alike(x: Floats, xhat: Floats, other: Floats) -> bool:
    """Whether two runs with different steps have the same error of an estimate, where it is a thousand times all else.

    Steps that are too long for an observer amplify its errors as much as their length says, each in its own way. What
    counts is its last growth: a peak that it has come back from is not what it is lost with.
    """
    gap = np.max(_gap(x, xhat), axis=1)
    size = max(float(np.max(np.abs(x))), float(gap[0]))
    near = np.flatnonzero(gap <= _GROWN * size)
    since = int(near[-1]) + 1 if near.size else 0
    grown = since + np.flatnonzero(np.isfinite(gap[since:]))
    return bool(grown.size and np.max(_gap(xhat[grown[0]], other[grown[0]])) <= _ALIKE * gap[grown[0]])


def swamped(x: Floats, xhat: Floats) -> int | None:
    """The first state whose error in the last tenth is a million times what the state ever is.

    It need not have left: an error that is as large from the first step on is of an observer that chatters so.
    """
    size, late = np.max(np.abs(x), axis=0), late_points(len(x))
    beyond = (np.max(_gap(x[late], xhat[late]), axis=0) > _FAR * size) & (size > _ROUNDING * np.max(size))
    return int(np.argmax(beyond)) if np.any(beyond) else None


def late_points(count: int) -> slice:
    """The last of so many points."""
    return slice(count - max(int(_LATE * count), 1), count)


def ends(count: int, every: int = 1) -> NDArray[np.int64]:
    """The first of so many points, and some of the last ones.

    These are whole multiples of every so many points from the end, where there are :func:`enough_late` of them.
    """
    late, every = late_points(count), every if enough_late(count, every) else 1
    apart = every * max((late.stop - late.start) // (_LOOKED_AT * every), 1)
    return np.array([0, *reversed(range(count - 1, late.start - 1, -apart))])


def enough_late(count: int, every: int) -> bool:
    """Whether every so many of the last points are not too few to tell of an error that swings, or are all of them."""
    late = late_points(count)
    return every == 1 or (late.stop - late.start) // every >= _LOOKED_AT


@np.errstate(invalid="ignore", over="ignore")
def astray(y: Floats, yhat: Floats, size: float, late: NDArray[np.int64]) -> tuple[int, int] | None:
    """The output that an observer does not follow, and the first of the points from which on it does not.

    Parameters
    ----------
    y, yhat : ndarray, shape (N, q)
        The outputs without noise, and as they are estimated.
    size : float
        What all states, outputs, first errors and amplified noise are at most.
    late : ndarray of int
        The last points, of which one at least must be off.

    Returns
    -------
    (int, int) or None
        None where it follows all of them. A run in which everything is zero says nothing.
    """
    error = yhat - y
    beyond = (np.abs(error) > _ASTRAY * size) & (size > 0)
    for output in np.flatnonzero(np.any(beyond[late], axis=0)).tolist():
        points = np.flatnonzero(beyond[:, output])
        quiet = np.flatnonzero(np.diff(points) > max(int(_LATE * len(y)), 1))  # it may have followed in between
        start = int(points[quiet[-1] + 1] if quiet.size else points[0])
        if np.count_nonzero(np.diff(np.sign(error[start:, output]))) >= _SWINGS:
            return output, start
    return None


@np.errstate(invalid="ignore", over="ignore")
def size_of(x: Floats, xhat: Floats) -> Floats:
    """What the states and the first errors are at most, whatever their units.

    Parameters
    ----------
    x, xhat : ndarray, shape (points, n, ...)
        The first point is that of the run.

    Returns
    -------
    ndarray, shape (...)
    """
    first = _gap(x[0], xhat[0])
    first = np.max(np.where(np.isfinite(first), first, 0.0), axis=0)
    return np.asarray(np.maximum(np.max(np.abs(x), axis=(0, 1)), first))


def may_be_astray(largest: Floats, size: Floats) -> NDArray[np.bool_]:
    """Whether an observer may have gone astray, whatever the noise is, and whether or not its errors swing.

    Parameters
    ----------
    largest : ndarray, shape (q, ...)
        The largest late error of each output.
    size : ndarray, shape (...)
        No more than that of the run.

    Returns
    -------
    ndarray of bool, shape (...)
    """
    return np.asarray(np.any(largest > _ASTRAY * size, axis=0))


def estimates_near(truths: Estimated, estimated: Estimated) -> bool:
    """Whether no estimate may have left for good, as nearly all runs end: what needs no more than the last point.

    Where this is false, :func:`may_have_left` decides.

    Parameters
    ----------
    truths, estimated : Estimated
        At the first and the last point.
    """
    first, end, last = truths.values[0].tolist(), truths.values[-1].tolist(), estimated.values[-1].tolist()
    return all(
        abs(last[place] - end[own]) <= _FAR * max(abs(first[own]), abs(end[own]))
        for truth, places in zip(truths.places, estimated.places, strict=True)
        for own, place in zip(truth, places, strict=True)
    )


def _gap(x: Floats, xhat: Floats) -> Floats:
    with np.errstate(invalid="ignore", over="ignore"):
        return np.abs(xhat - x)


def _bounds(x: Floats, gap: Floats) -> Floats:
    """How far from the truth the estimate of each state may be, shape (n,)."""
    first = np.where(np.isfinite(gap[0]), gap[0], 0.0)
    size = np.maximum(np.max(np.abs(x), axis=0), first)
    quiet = np.array([_quiet(column) for column in gap.T])
    begun = np.max(np.where(np.isfinite(gap), gap, 0.0)[: max(len(gap) // 10, 1)], axis=0)
    resting = np.maximum(_FAR * quiet, begun)  # of a state that rests at zero
    bounds = np.maximum(np.where(size > 0, _FAR * size, resting), _GROWN * quiet)
    return np.where(bounds > 0, bounds, np.inf)  # of a state and an error that are zero nothing can be said


def _quiet(errors: Floats) -> float:
    """The error that a tenth of the points does not exceed; zero where none is finite."""
    finite = errors[np.isfinite(errors)]
    return float(quantiles(finite, np.array([_SMALLEST]))[0]) if finite.size else 0.0
