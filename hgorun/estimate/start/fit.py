"""The start from which the model passes nearest to some samples: least squares, by the method of Gauss and Newton."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.engine.plan import Integers
from hgorun.estimate.start.start_task import StartTask
from hgorun.symbolic.evaluate import Floats

_PASSES = 50
_ENOUGH = 1e-9  # of the residuals: what a pass has to make them smaller by for another one
_ROUNDING = 1e-14  # of the sum of their squares
TOLD = 1e-6  # singular values below that part of the largest: directions that the samples do not tell
_HALVINGS = 20
_SUFFICIENT = 0.25  # of what the derivatives promise: a step that keeps less leads to where they say nothing
_ALONE = 1e-6  # of the variance of a sample that alone tells something of the start: no error shows whether it is one


@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """A start, and the derivatives by it of what is estimated over the standard deviation.

    Attributes
    ----------
    x, slope : ndarray
    left : list of ndarray
        Of each output the numbers of the samples that are left out.
    task : StartTask
        What it is of, with steps that are short enough.
    """

    x: Floats
    slope: Floats
    left: list[Integers]
    task: StartTask

    @property
    def spread(self) -> Floats:
        """Standard deviations of the start that follow from those of the samples; infinite where these tell nothing."""
        scaled, sizes = _scaled(self.slope)
        _, singular, rows = np.linalg.svd(scaled, full_matrices=True)
        singular = np.concatenate([singular, np.zeros(len(rows) - singular.size)])
        told = singular > TOLD * singular[0]
        inverse = np.divide(1.0, singular, out=np.zeros_like(singular), where=told)
        untold = np.linalg.norm(rows[~told], axis=0) > np.sqrt(TOLD)
        return np.asarray(np.where(untold, np.inf, np.linalg.norm(inverse[:, None] * rows, axis=0) / sizes))

    def within_gates(self, error: Floats, which: np.ndarray) -> bool:
        """Whether some samples, bools, are within their gates, in the own deviations of their errors."""
        return not np.any(self.own_deviations(error)[which] > self.task.gates[which])

    def own_deviations(self, error: Floats) -> Floats:
        """The sizes of some errors in their own standard deviations, which are less than those of the samples.

        The more a fit follows a sample, the smaller its error is.
        """
        columns, singular, _ = np.linalg.svd(_scaled(self.slope)[0], full_matrices=False)
        followed = np.sum(columns[:, singular > TOLD * singular[0]] ** 2, axis=1)
        return np.asarray(np.abs(error) / np.sqrt(np.maximum(1 - followed, _ALONE)))


def fit(task: StartTask, x: Floats) -> Fit | None:
    """The start near x from which the model passes nearest, with steps that are short enough.

    None where the model or its derivative leaves the numbers, or no steps are short enough.
    """
    while (finer := task.finer()) is not None:
        if _alike(task, finer, x):
            found = _nearest(task, x)
            if found is None or _alike(task, finer, found.x):
                return found
        task = finer  # from x again: what is nearest with steps that are too long may be anywhere
    return None


def _alike(task: StartTask, finer: StartTask, x: Floats) -> bool:
    """Whether shorter steps give the same outputs, but for errors that do not matter."""
    (one, _), (other, _) = task.residuals(x), finer.residuals(x)
    with np.errstate(invalid="ignore"):  # where the model has left the numbers
        return bool(np.all(np.abs(one - other) <= task.tolerances))


def _nearest(task: StartTask, x: Floats) -> Fit | None:
    """The same with given steps."""
    error, slope = task.weighted(x)
    for _ in range(_PASSES):
        if not (np.all(np.isfinite(error)) and np.all(np.isfinite(slope))):
            return None
        step = _least_squares(slope, error)
        if error @ (slope @ step) <= _ROUNDING * (error @ error):  # no step tells whether it is one to less
            break
        for halving in range(_HALVINGS):
            tried = x - step / 2**halving
            found, its_slope = task.weighted(tried)
            expected = error - slope @ step / 2**halving
            less = _SUFFICIENT * (error @ error - expected @ expected)
            if np.all(np.isfinite(found)) and error @ error - found @ found > max(less, 0.0):
                break
        else:
            break
        less = 1 - (found @ found) / (error @ error)
        x, error, slope = tried, found, its_slope
        if less < _ENOUGH:
            break
    none = [first[:0] for first in task.numbers]
    return Fit(x, slope, none, task) if np.all(np.isfinite(error)) and np.all(np.isfinite(slope)) else None


def _least_squares(slope: Floats, error: Floats) -> Floats:
    """The shortest step d with slope d = error, as nearly as can be; the units of the states do not matter."""
    scaled, sizes = _scaled(slope)
    return np.asarray(np.linalg.lstsq(scaled, error, rcond=TOLD)[0] / sizes)


def _scaled(slope: Floats) -> tuple[Floats, Floats]:
    """Slopes whose columns have length 1, but for those of zeros, and by what they were divided."""
    sizes = np.linalg.norm(slope, axis=0)
    sizes = np.where(sizes > 0, sizes, 1.0)
    return slope / sizes, sizes
