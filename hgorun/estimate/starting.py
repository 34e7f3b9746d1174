"""Where observers start: the state from which the model passes nearest to the first samples."""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from hgorun.data.recording import AUTO, FirstSamples
from hgorun.errors import Problem
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import stated
from hgorun.memo import Memo, same
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.levels import distinct
from hgorun.symbolic.plant import PlantModel

_STEPS = 8  # of the classical method of Runge and Kutta, between two samples
_PASSES = 50
_ENOUGH = 1e-9  # of the residuals: what a pass has to make them smaller by for another one
_TOLD = 1e-6  # singular values below that part of the largest: directions that the samples do not tell
_HALVINGS = 20
_FEWEST, _MOST, _GROWTH = 3, 200, 1.25  # samples of an output that are tried for "auto"
_AGREEMENT = 4.0  # standard deviations: each of some 20 fits has to agree, and with 2 half of all exact models did not
_DIGITS = 10  # of the start: those behind are the C library's, since here CasADi's own functions are called, for speed
_REWEIGHTED = 30  # passes in which errors of a start count by their size
_NORMAL = 1.4826  # standard deviations of normal numbers in their median size
_FUNCTIONS: Memo[tuple[ca.Function, ca.Function]] = Memo(16)
_MAPPED: Memo[tuple[ca.Function, ca.Function]] = Memo(64)
_FITS: Memo[_Fit | None] = Memo(64)


def fitted_start(prepared: PreparedEstimate, count: FirstSamples) -> dict[str, float]:
    """The state at the start from which the model passes nearest to the first samples.

    x(0) minimises the sum of ((y_k - h(x(t_k)))/std)^2 over the first samples of every output, x being the solution of
    the model from x(0), by the method of Gauss and Newton with the derivatives of the solution. Where no ``std`` is
    stated it is 1. What the samples do not tell stays at the initial state of the plant. Samples of a number that is
    given are left out where the output has a gate and a ``std``, and they are outliers to the others.

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
    model = prepared.run.plant.model
    guess = dict(prepared.experiment.plant_block.initial)
    x = np.array([float(guess.get(state, 0.0)) for state in model.states])
    whole = _Task.of(prepared, _MOST if count == AUTO else count)  # gains of observers, which are tried, change nothing
    found = _FITS.get(
        (count == AUTO, x.tobytes(), whole.key),
        lambda: _agreeing(prepared, x) if count == AUTO else _without_outliers(whole, x),
    )
    if found is None:
        first = _FEWEST if count == AUTO else count
        message = f"from the first of {first} samples the model leaves all bounds before the last of them"
        raise Problem(("data", "first_samples"), message)
    return {state: float(f"{value:.{_DIGITS}g}") for state, value in zip(model.states, found.x.tolist(), strict=True)}


def _require_noise(prepared: PreparedEstimate) -> None:
    """Refuse samples whose noise is not known, also where a fit of the same numbers is kept."""
    known = stated(prepared.experiment)
    for one in prepared.samples:
        if one.values.size and one.output not in known:
            raise Problem(("data", "first_samples"), f"auto needs the noise of the samples: {one.output} has no std")


@dataclass(frozen=True, eq=False, repr=False)
class _Fit:
    """A start, and the derivatives by it of what is estimated over the standard deviation."""

    x: Floats
    slope: Floats

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


def _fit(task: _Task, x: Floats) -> _Fit | None:
    """The start near x from which the model passes nearest; None where it leaves the numbers."""
    error, slope = task.weighted(x)
    for _ in range(_PASSES):
        if not np.all(np.isfinite(error)):
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
    return _Fit(x, slope) if np.all(np.isfinite(error)) else None


def _without_outliers(task: _Task, x: Floats) -> _Fit | None:
    """The fit to all samples, or where gates leave some out, that to the others.

    If all are within the gates of the fit to all, that is the one. Otherwise what is far off counts by its size and no
    longer by its square, which few outliers turn little; those that are beyond the gates of that fit are left out. Two
    more samples than states are needed to tell which of them it is, and more than half have to agree.
    """
    found = _fit(task, x)
    if found is None or len(task.gates) < x.size + 2:
        return found
    error, _ = task.residuals(found.x)
    if not np.any(np.abs(error) > task.gates):
        return found
    bent = found
    for _ in range(_REWEIGHTED):
        weights = 1 / np.sqrt(np.maximum(np.abs(error), 1.0))
        bent = _fit(replace(task, weights=weights), bent.x) or bent
        error, _ = task.residuals(bent.x)
    free = np.sort(np.abs(error))[x.size :]  # those that it need not pass through
    kept = np.abs(error) <= task.gates * max(1.0, _NORMAL * float(np.median(free)))
    if kept.all() or 2 * np.count_nonzero(kept) <= kept.size:
        return found
    return _fit(replace(task, weights=kept.astype(float)), bent.x) or found


def _agreeing(prepared: PreparedEstimate, x: Floats) -> _Fit | None:
    """The fit to as many first samples as agree on the start.

    Of more samples the start has less noise and more of what the model does not describe. Their number grows until a
    state of the start leaves the bounds that the noise permits about one of the starts found before (the rule of
    Lepski): then the error of the model has become larger than that of the noise was.
    """
    most = min(_MOST, max(one.values.size for one in prepared.samples))
    low, high = np.full(x.size, -np.inf), np.full(x.size, np.inf)
    count, best = _FEWEST, None
    while True:
        found = _fit(_Task.of(prepared, count), x)
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


@dataclass(frozen=True, eq=False, repr=False)
class _Task:
    """The first samples, and the model's way along them.

    Attributes
    ----------
    times : ndarray, shape (k,)
        From the start on, those of the samples among them.
    u : ndarray, shape (k - 1, steps, 3, m)
        Inputs at the beginning, middle and end of every step.
    seen : list of tuple
        Of each output the places of its samples in ``times``, their values, and the standard deviation.
    gates : ndarray
        Of every sample, in the order of ``seen``; infinite without one, or where the noise is not known.
    weights : ndarray or float
        By which the errors of the samples are multiplied.
    """

    model: PlantModel
    parameters: np.ndarray
    times: Floats
    u: Floats
    seen: list[tuple[np.ndarray, Floats, float]]
    gates: Floats
    steps: ca.Function
    output: ca.Function
    weights: Floats | float = 1.0

    @classmethod
    def of(cls, prepared: PreparedEstimate, count: int) -> _Task:
        model, known = prepared.run.plant.model, stated(prepared.experiment)
        firsts = [np.argsort(one.taken, kind="stable")[:count] for one in prepared.samples]
        taken = [one.taken[first] for one, first in zip(prepared.samples, firsts, strict=True)]
        times = distinct(np.concatenate([[0.0], *taken]))
        seen = [
            (np.searchsorted(times, t), one.values[first], known.get(one.output, 1.0))
            for one, first, t in zip(prepared.samples, firsts, taken, strict=True)
        ]
        part = np.arange(_STEPS)[:, None] + np.array([0.0, 0.5, 1.0])
        moments = times[:-1, None, None] + np.diff(times)[:, None, None] * part / _STEPS
        u = prepared.u(moments.ravel()).reshape(*moments.shape, len(model.inputs))
        limits = [math.inf if one.gate is None or one.output not in known else one.gate for one in prepared.samples]
        gates = np.repeat(limits, [first.size for first in firsts])
        along = _MAPPED.get((same(model), times.size), lambda: _along(model, times.size))
        return cls(model, prepared.run.plant.parameters, times, u, seen, gates, *along)

    @property
    def key(self) -> Hashable:
        """All that a fit depends on, beside its first guess."""
        numbers = self.parameters, self.times, self.u, self.gates
        seen = ((places.tobytes(), values.tobytes(), std) for places, values, std in self.seen)
        return same(self.model), *(one.tobytes() for one in numbers), *seen

    def residuals(self, x: Floats) -> tuple[Floats, Floats]:
        """Estimated minus measured over the standard deviation, and its derivative by the state at the start."""
        errors, slopes = [], []
        with np.errstate(all="ignore"):  # from a bad guess the model may leave the numbers
            y, by_start = self._along(x)
            for i, (places, values, std) in enumerate(self.seen):
                errors.append(self.model.wrapped(i, y[places, i] - values) / std)
                slopes.append(by_start[places, i] / std)
        return np.concatenate(errors), np.concatenate(slopes)

    def weighted(self, x: Floats) -> tuple[Floats, Floats]:
        """The same, multiplied by the weights."""
        error, slope = self.residuals(x)
        return error * self.weights, slope * np.reshape(self.weights, (-1, 1))

    def _along(self, x: Floats) -> tuple[Floats, Floats]:
        """The outputs at every time, shape (k, q), and their derivatives by the state at the start, (k, q, n)."""
        n, k, q = x.size, self.times.size, len(self.seen)
        states, by_start = x[:, None], np.eye(n)
        if k > 1:
            gaps = np.diff(self.times)[:, None] / _STEPS
            t = (self.times[:-1, None] + gaps * np.arange(_STEPS)).reshape(1, -1)
            lines = self.u.reshape(t.size, 3, self.u.shape[-1]).transpose(1, 2, 0)
            h = np.broadcast_to(gaps, (k - 1, _STEPS)).reshape(1, -1)
            along, by_first = _numbers(self.steps, x, by_start, t, h, *lines, self._everywhere(t.size))
            states = np.column_stack([states, along[:, _STEPS - 1 :: _STEPS]])
            by_first = by_first.reshape(n, -1, n)[:, _STEPS - 1 :: _STEPS].reshape(n, -1)
            by_start = np.column_stack([by_start, by_first])
        u = np.concatenate([self.u[:, 0, 0], self.u[-1:, -1, -1]]).T if k > 1 else np.zeros((self.u.shape[-1], 1))
        y, by_state = _numbers(self.output, self.times[None], states, u, self._everywhere(k))
        by_state = by_state.reshape(q, k, n).transpose(1, 0, 2)
        return y.T, by_state @ by_start.reshape(n, k, n).transpose(1, 0, 2)

    def _everywhere(self, count: int) -> Floats:
        """The parameters, for so many times."""
        return np.tile(self.parameters[:, None], count)


def _numbers(function: ca.Function, *arguments: float | Floats) -> list[Floats]:
    """The matrices that a function gives."""
    return [np.array(one) for one in function(*arguments)]


def _along(model: PlantModel, count: int) -> tuple[ca.Function, ca.Function]:
    """All steps between so many times, one after the other, and the outputs at all of them."""
    step, output = _FUNCTIONS.get(same(model), lambda: (_step(model), _output(model)))
    return step.mapaccum("steps", _STEPS * (count - 1), 2) if count > 1 else step, output.map(count)


def _step(model: PlantModel) -> ca.Function:
    """A step of the classical method of Runge and Kutta: the state, and its derivative by the start."""
    t, h, x, p = ca.SX.sym("t"), ca.SX.sym("h"), ca.SX.sym("x", model.n), ca.SX.sym("p", len(model.parameters))
    a, b, c = (ca.SX.sym(name, len(model.inputs)) for name in "abc")
    k1 = model.f(t, x, a, p)
    k2 = model.f(t + h / 2, x + h / 2 * k1, b, p)
    k3 = model.f(t + h / 2, x + h / 2 * k2, b, p)
    k4 = model.f(t + h, x + h * k3, c, p)
    then = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    by_start = ca.SX.sym("by_start", model.n, model.n)
    by_both = ca.densify(ca.mtimes(ca.jacobian(then, x), by_start))
    return ca.Function("step", [x, by_start, t, h, a, b, c, p], [then, by_both])


def _output(model: PlantModel) -> ca.Function:
    """The output, and its derivative by the state."""
    y = ca.densify(model.output)
    arguments = [model.t, model.x, model.u, model.p]
    return ca.Function("output", arguments, [y, ca.densify(ca.jacobian(y, model.x))])
