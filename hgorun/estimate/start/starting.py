"""Where observers start: the state from which the model passes nearest to the first samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hgorun.data.recording import AUTO, FirstSamples
from hgorun.engine.plan import Integers
from hgorun.errors import Problem
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import stated
from hgorun.estimate.start.fit import Fit, fit
from hgorun.estimate.start.outliers import agree, judged, of_many, without_outliers
from hgorun.estimate.start.start_task import StartTask
from hgorun.memo import Memo
from hgorun.symbolic.evaluate import Floats

_FEWEST, _MOST, _GROWTH = 3, 200, 1.25  # samples of an output that are tried for "auto"
_FAR = 5.0  # standard deviations: a start so far from its samples may be the nearest one only beside it
_AGREEMENT = 4.0  # standard deviations: each of some 20 fits has to agree, and with 2 half of all exact models did not
_DIGITS = 10  # of the start: those behind are the C library's, since here CasADi's own functions are called, for speed
_SPARE = 2  # samples beyond twice the states, among which outliers are looked for where a start is fitted to fewer
_FITS: Memo[Fit | None] = Memo(64)


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
        states, x = prepared.run.plant.model.states, _guess(prepared)
        guess = ", ".join(f"{state} = {value:.4g}" for state, value in zip(states, x.tolist(), strict=True))
        message = (
            f"from the first of {first} samples the model leaves all bounds before the last of them, or the model or "
            f"its inputs change too fast; it is followed from near {guess}: plant.initial says another guess"
        )
        raise Problem(("data", "first_samples"), message)
    return rounded(prepared, found)


def rounded(prepared: PreparedEstimate, found: Fit) -> dict[str, float]:
    """By state the start that was found."""
    states, x = prepared.run.plant.model.states, found.task.turned(found.x, found.left)
    return {state: float(f"{value:.{_DIGITS}g}") for state, value in zip(states, x.tolist(), strict=True)}


def fit_of(prepared: PreparedEstimate, count: FirstSamples) -> Fit | None:
    """The fit that a start follows from; gains of observers, which are tried, change nothing of it."""
    x = _guess(prepared)
    whole = StartTask.of(prepared, _MOST if count == AUTO else 2 * max(count, _few(x)))
    return _FITS.get((count, x.tobytes(), whole.key), lambda: _fitted(prepared, count, x))


def judged_start(prepared: PreparedEstimate) -> tuple[list[Integers], dict[str, float]]:
    """Of each output the outliers among its first samples, as gates say, and by state the start that the others give.

    As many are looked at as of a start that is fitted to few.
    """
    x = _guess(prepared)
    tasks = _looked_at(prepared, x)
    found = _FITS.get((1, x.tobytes(), *(task.key for task in tasks)), lambda: judged(*tasks, x))
    return (_none(prepared), {}) if found is None else (found.left, rounded(prepared, found))


def _none(prepared: PreparedEstimate) -> list[Integers]:
    return [np.zeros(0, dtype=np.int64)] * len(prepared.samples)


def _few(x: Floats) -> int:
    """Of how many samples of each output outliers are looked for, at first."""
    return 2 * x.size + _SPARE


def _looked_at(prepared: PreparedEstimate, x: Floats) -> tuple[StartTask, StartTask, StartTask]:
    """The samples that are judged: in the time of the fastest output, of twice as many, and as many of every output."""
    few, many = (StartTask.of(prepared, count, together=True) for count in (_few(x), 2 * _few(x)))
    return few, many, StartTask.of(prepared, _few(x))


def _guess(prepared: PreparedEstimate) -> Floats:
    """The initial state of the plant."""
    given = dict(prepared.experiment.plant_block.initial)
    return np.array([float(given.get(state, 0.0)) for state in prepared.run.plant.model.states])


def _fitted(prepared: PreparedEstimate, count: FirstSamples, x: Floats) -> Fit | None:
    """That fit.

    Where more samples are outliers than these can tell, those that come next are looked at, too, and the fit is to as
    many others.
    """
    if count != AUTO and count >= _few(x):
        first = StartTask.of(prepared, count)
        found = _near(prepared, count, x)
        others = None if agree(first, found) else of_many(first, StartTask.of(prepared, 2 * count), x)
        return found if others is None else _besides(prepared, count, others)
    tasks = _looked_at(prepared, x)
    others = judged(*tasks, x) if np.isfinite(tasks[-1].gates).any() else None
    if others is not None and any(one.size for one in others.left):
        return _besides(prepared, count, others)
    return _agreeing(prepared, x) if count == AUTO else _near(prepared, count, x)


def _near(prepared: PreparedEstimate, count: int, x: Floats) -> Fit | None:
    """The fit to so many samples; where it is far from them, one that begins where the model passes near fewer."""
    task = StartTask.of(prepared, count)
    found = without_outliers(task, x)
    if _distance(prepared, found) <= _FAR:
        return found
    few = _FEWEST
    while few < count:
        before = fit(StartTask.of(prepared, few), x)
        if before is None:
            return found
        x, few = before.x, max(few + 1, int(_GROWTH * few))
    other = without_outliers(task, x)
    return other if _distance(prepared, other) < _distance(prepared, found) else found


def _distance(prepared: PreparedEstimate, found: Fit | None) -> float:
    """The rms of the errors of the samples that a fit is to, over the std of the noise; 0 where that is not known."""
    if found is None:
        return np.inf
    known = stated(prepared.experiment)
    outputs = zip(prepared.samples, found.task.numbers, found.left, strict=True)
    kept = np.concatenate([~np.isin(own, left) & (one.output in known) for one, own, left in outputs])
    error, _ = found.task.residuals(found.x)
    return float(np.sqrt(np.mean(error[kept] ** 2))) if kept.any() else 0.0


def _besides(prepared: PreparedEstimate, count: FirstSamples, others: Fit) -> Fit | None:
    """The fit to so many samples beside those that another one has left out, near which it begins: no guess is one."""
    left, x = others.left, others.x
    found = _agreeing(prepared, x, left) if count == AUTO else fit(StartTask.of(prepared, count, left), x)
    return None if found is None else replace(found, left=left)


def _require_noise(prepared: PreparedEstimate) -> None:
    """Refuse samples whose noise is not known, also where a fit of the same numbers is kept."""
    known = stated(prepared.experiment)
    for one in prepared.samples:
        if one.values.size and one.output not in known:
            raise Problem(("data", "first_samples"), f"auto needs the noise of the samples: {one.output} has no std")


def _agreeing(prepared: PreparedEstimate, x: Floats, left: Sequence[Integers] | None = None) -> Fit | None:
    """The fit to as many first samples as agree on the start, without those that are left out.

    Of more samples the start has less noise and more of what the model does not describe. Their number grows until a
    state of the start leaves the bounds that the noise permits about one of the starts found before (the rule of
    Lepski): then the error of the model has become larger than that of the noise was.
    """
    most = min(_MOST, max(one.values.size for one in prepared.samples))
    low, high = np.full(x.size, -np.inf), np.full(x.size, np.inf)
    count, best = _FEWEST, None
    while True:
        found = fit(StartTask.of(prepared, count, left, together=True), x)
        if found is None or np.any((found.x < low) | (found.x > high)):
            return best
        best, x, reach = found, found.x, _AGREEMENT * found.spread
        low, high = np.maximum(low, x - reach), np.minimum(high, x + reach)
        if count >= most:
            return best
        count = min(max(count + 1, int(_GROWTH * count)), most)
