"""Where observers start: the state from which the model passes nearest to the first samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hgorun.data.recording import AUTO, FirstSamples
from hgorun.engine.plan import Integers
from hgorun.errors import Problem
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import stated
from hgorun.estimate.start.start_task import StartTask
from hgorun.memo import Memo
from hgorun.symbolic.evaluate import Floats

_PASSES = 50
_ENOUGH = 1e-9  # of the residuals: what a pass has to make them smaller by for another one
_TOLD = 1e-6  # singular values below that part of the largest: directions that the samples do not tell
_HALVINGS = 20
_FEWEST, _MOST, _GROWTH = 3, 200, 1.25  # samples of an output that are tried for "auto"
_AGREEMENT = 4.0  # standard deviations: each of some 20 fits has to agree, and with 2 half of all exact models did not
_DIGITS = 10  # of the start: those behind are the C library's, since here CasADi's own functions are called, for speed
_ALONE = 1e-6  # of the variance of a sample that alone tells something of the start: no error shows whether it is one
_REWEIGHTED = 30  # passes in which errors of a start count by their size
_NORMAL = 1.4826  # standard deviations of normal numbers in their median size
_SPARE = 2  # samples beyond twice the states, among which outliers are looked for where a start is fitted to fewer
_FITS: Memo[_Fit | None] = Memo(64)


def fitted_start(prepared: PreparedEstimate, count: FirstSamples) -> dict[str, float]:
    """The state at the start from which the model passes nearest to the first samples.

    x(0) minimises the sum of ((y_k - h(x(t_k)))/std)^2 over the first samples of every output, x being the solution of
    the model from x(0), by the method of Gauss and Newton with the derivatives of the solution. Where no ``std`` is
    stated it is 1. What the samples do not tell stays at the initial state of the plant. Samples are left out where the
    output has a gate and a ``std``, and they are outliers to the others.

    Parameters
    ----------
    prepared : PreparedEstimate
        With the initial state of the plant as a first guess.
    count : int or "auto"
        How many samples of each output; "auto" as :func:`_agreeing` chooses them.

    Raises
    ------
    Problem
        Where the model leaves the numbers from every state near the guess, or "auto" lacks a ``std``.
    """
    if count == AUTO:
        _require_noise(prepared)
    found = fit_of(prepared, count)
    if found is None:
        first = _FEWEST if count == AUTO else count
        message = f"from the first of {first} samples the model leaves all bounds before the last of them"
        raise Problem(("data", "first_samples"), message)
    return rounded(prepared, found)


def rounded(prepared: PreparedEstimate, found: _Fit) -> dict[str, float]:
    """By state the start that was found."""
    states = prepared.run.plant.model.states
    return {state: float(f"{value:.{_DIGITS}g}") for state, value in zip(states, found.x.tolist(), strict=True)}


def fit_of(prepared: PreparedEstimate, count: FirstSamples) -> _Fit | None:
    """The fit that a start follows from; gains of observers, which are tried, change nothing of it."""
    x = _guess(prepared)
    whole = StartTask.of(prepared, _MOST if count == AUTO else max(count, 2 * x.size + _SPARE))
    return _FITS.get((count, x.tobytes(), whole.key), lambda: _fitted(prepared, count, x))


def judged_start(prepared: PreparedEstimate) -> tuple[list[Integers], dict[str, float]]:
    """Of each output the outliers among its first samples, as gates say, and by state the start that the others give.

    As many are looked at as of a start that is fitted to few.
    """
    x = _guess(prepared)
    task = StartTask.of(prepared, 2 * x.size + _SPARE, together=True)
    found = _FITS.get((1, x.tobytes(), task.key), lambda: _without_outliers(task, x))
    return ([one[:0] for one in task.numbers], {}) if found is None else (found.left, rounded(prepared, found))


def _guess(prepared: PreparedEstimate) -> Floats:
    """The initial state of the plant."""
    given = dict(prepared.experiment.plant_block.initial)
    return np.array([float(given.get(state, 0.0)) for state in prepared.run.plant.model.states])


def _fitted(prepared: PreparedEstimate, count: FirstSamples, x: Floats) -> _Fit | None:
    """That fit.

    Of few samples none tells which is an outlier: those that come next are looked at, too, and the fit is to as many
    others.
    """
    looked_at = 2 * x.size + _SPARE
    left: list[Integers] | None = None
    if count == AUTO or count < looked_at:
        more = StartTask.of(prepared, looked_at, together=True)
        judged = _without_outliers(more, x) if np.isfinite(more.gates).any() else None
        left = judged.left if judged is not None and any(one.size for one in judged.left) else None
    if left is None:
        return _agreeing(prepared, x) if count == AUTO else _without_outliers(StartTask.of(prepared, count), x)
    found = _agreeing(prepared, x, left) if count == AUTO else _fit(StartTask.of(prepared, count, left), x)
    return None if found is None else replace(found, left=left)


def _require_noise(prepared: PreparedEstimate) -> None:
    """Refuse samples whose noise is not known, also where a fit of the same numbers is kept."""
    known = stated(prepared.experiment)
    for one in prepared.samples:
        if one.values.size and one.output not in known:
            raise Problem(("data", "first_samples"), f"auto needs the noise of the samples: {one.output} has no std")


@dataclass(frozen=True, eq=False, repr=False)
class _Fit:
    """A start, and the derivatives by it of what is estimated over the standard deviation.

    Attributes
    ----------
    x, slope : ndarray
    left : list of ndarray
        Of each output the numbers of the samples that are left out.
    """

    x: Floats
    slope: Floats
    left: list[Integers]

    @property
    def spread(self) -> Floats:
        """Standard deviations of the start that follow from those of the samples; infinite where these tell nothing."""
        sizes = np.linalg.norm(self.slope, axis=0)
        sizes = np.where(sizes > 0, sizes, 1.0)
        _, singular, rows = np.linalg.svd(self.slope / sizes, full_matrices=True)
        singular = np.concatenate([singular, np.zeros(len(rows) - singular.size)])
        told = singular > _TOLD * singular[0]
        inverse = np.divide(1.0, singular, out=np.zeros_like(singular), where=told)
        untold = np.linalg.norm(rows[~told], axis=0) > np.sqrt(_TOLD)
        return np.asarray(np.where(untold, np.inf, np.linalg.norm(inverse[:, None] * rows, axis=0) / sizes))

    def own_deviations(self, error: Floats) -> Floats:
        """The sizes of some errors in their own standard deviations, which are less than those of the samples.

        The more a fit follows a sample, the smaller its error is.
        """
        sizes = np.linalg.norm(self.slope, axis=0)
        columns, singular, _ = np.linalg.svd(self.slope / np.where(sizes > 0, sizes, 1.0), full_matrices=False)
        followed = np.sum(columns[:, singular > _TOLD * singular[0]] ** 2, axis=1)
        return np.asarray(np.abs(error) / np.sqrt(np.maximum(1 - followed, _ALONE)))


def _fit(task: StartTask, x: Floats) -> _Fit | None:
    """The start near x from which the model passes nearest; None where it or its derivative leaves the numbers."""
    error, slope = task.weighted(x)
    for _ in range(_PASSES):
        if not (np.all(np.isfinite(error)) and np.all(np.isfinite(slope))):
            return None
        step = _least_squares(slope, error)
        for halving in range(_HALVINGS):
            tried = x - step / 2**halving
            found, its_slope = task.weighted(tried)
            if np.all(np.isfinite(found)) and found @ found < error @ error:
                break
        else:
            break
        less = 1 - (found @ found) / (error @ error)
        x, error, slope = tried, found, its_slope
        if less < _ENOUGH:
            break
    none = [first[:0] for first in task.numbers]
    return _Fit(x, slope, none) if np.all(np.isfinite(error)) and np.all(np.isfinite(slope)) else None


def _without_outliers(task: StartTask, x: Floats) -> _Fit | None:
    """The fit to all samples, or where gates leave some out, that to the others.

    If all are within the gates of the fit to all, that is the one; errors count in their own standard deviations, which
    are smaller at the ends of the samples, where a fit follows each of them more. Otherwise the farthest is left out.
    If the others are not within their gates even then, what is far off counts by its size and no
    longer by its square, which few outliers turn little; those that are beyond the gates of that fit are left out. Two
    more samples than states are needed to tell which of them it is, and more than half have to agree.
    """
    found = _fit(task, x)
    if found is None or len(task.gates) < x.size + 2:
        return found
    error, _ = task.residuals(found.x)
    beyond = found.own_deviations(error) / task.gates
    if not np.any(beyond > 1):
        return found
    kept = np.arange(error.size) != np.argmax(beyond)
    others = _fit(replace(task, weights=kept.astype(float)), found.x)
    if others is not None:
        rest, _ = task.residuals(others.x)
        within = not np.any(others.own_deviations(rest)[kept] > task.gates[kept])
        known = rest[kept & np.isfinite(task.gates)]
        if within and np.max(beyond) > np.sqrt(known @ known / max(known.size - x.size, 1)):
            return replace(others, left=task.chosen(~kept))
    bent = found
    for _ in range(_REWEIGHTED):
        weights = 1 / np.sqrt(np.maximum(np.abs(error), 1.0))
        bent = _fit(replace(task, weights=weights), bent.x) or bent
        error, _ = task.residuals(bent.x)
    free = np.sort(np.abs(error))[x.size :]  # those that it need not pass through
    kept = np.abs(error) <= task.gates * max(1.0, _NORMAL * float(np.median(free)))
    if kept.all() or 2 * np.count_nonzero(kept) <= kept.size:
        return found
    others = _fit(replace(task, weights=kept.astype(float)), bent.x)
    return found if others is None else replace(others, left=task.chosen(~kept))


def _agreeing(prepared: PreparedEstimate, x: Floats, left: Sequence[Integers] | None = None) -> _Fit | None:
    """The fit to as many first samples as agree on the start, without those that are left out.

    Of more samples the start has less noise and more of what the model does not describe. Their number grows until a
    state of the start leaves the bounds that the noise permits about one of the starts found before (the rule of
    Lepski): then the error of the model has become larger than that of the noise was.
    """
    most = min(_MOST, max(one.values.size for one in prepared.samples))
    low, high = np.full(x.size, -np.inf), np.full(x.size, np.inf)
    count, best = _FEWEST, None
    while True:
        found = _fit(StartTask.of(prepared, count, left), x)
        if found is None or np.any((found.x < low) | (found.x > high)):
            return best
        best, x, reach = found, found.x, _AGREEMENT * found.spread
        low, high = np.maximum(low, x - reach), np.minimum(high, x + reach)
        if count >= most:
            return best
        count = min(max(count + 1, int(_GROWTH * count)), most)


def _least_squares(slope: Floats, error: Floats) -> Floats:
    """The shortest step d with slope d = error, as nearly as can be; the units of the states do not matter."""
    sizes = np.linalg.norm(slope, axis=0)
    sizes = np.where(sizes > 0, sizes, 1.0)
    return np.asarray(np.linalg.lstsq(slope / sizes, error, rcond=_TOLD)[0] / sizes)
