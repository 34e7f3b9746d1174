"""The first samples of a recording, and the model's way along them from any start."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from hgorun.engine.plan import Integers
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import stated
from hgorun.memo import Memo, same
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.levels import distinct
from hgorun.symbolic.plant import PlantModel

_ONCE = 64  # steps, and times, that a function is for: to make one for each number of them takes longer
_STEPS = 8  # of the classical method of Runge and Kutta, between two times
_TIMES = 1 << 11  # at most
_PART = 0.05  # of the noise of an output that an error of the steps may be,
_OF_SPREAD, _OF_SIZE = 1e-3, 1e-6  # of its spread where the noise is not known, and of its size for rounding
_FUNCTIONS: Memo[tuple[ca.Function, ca.Function]] = Memo(16)


@dataclass(frozen=True, eq=False, repr=False)
class StartTask:
    """The first samples, and the model's way along them.

    Attributes
    ----------
    times : ndarray, shape (k,)
        From the start on, those of the samples among them.
    inputs : callable
        u at some times.
    u : ndarray, shape (k - 1, steps, 3, m)
        The same at the beginning, middle and end of every step.
    seen : list of tuple
        Of each output the places of its samples in ``times``, their values, and the standard deviation.
    gates : ndarray
        Of every sample, in the order of ``seen``; infinite without one, or where the noise is not known.
    numbers : list of ndarray
        Of each output which of its samples these are.
    tolerances : ndarray
        Errors of the steps that do not matter, of the residual of every sample.
    weights : ndarray or float
        By which the errors of the samples are multiplied.
    """

    model: PlantModel
    parameters: np.ndarray
    times: Floats
    inputs: Callable[[Floats], Floats]
    u: Floats
    seen: list[tuple[np.ndarray, Floats, float]]
    gates: Floats
    steps: ca.Function
    output: ca.Function
    numbers: list[Integers]
    tolerances: Floats
    weights: Floats | float = 1.0

    @classmethod
    def of(
        cls,
        prepared: PreparedEstimate,
        count: int,
        without: Sequence[Integers] | None = None,
        *,
        together: bool = False,
    ) -> StartTask:
        """That of the first samples of each output.

        Parameters
        ----------
        prepared : PreparedEstimate
        count : int
            How many of each.
        without : sequence of ndarray of int, optional
            The numbers of samples that are left out, for each output.
        together : bool
            Whether those of slow outputs end where the fastest one has more than so many: over a longer time what the
            model lacks counts more than the noise.
        """
        model, known = prepared.run.plant.model, stated(prepared.experiment)
        firsts = [np.argsort(one.taken, kind="stable") for one in prepared.samples]
        if without is not None:
            firsts = [first[~np.isin(first, left)] for first, left in zip(firsts, without, strict=True)]
        if together:
            end = min(_next(one.taken[first], count) for one, first in zip(prepared.samples, firsts, strict=True))
            firsts = [first[one.taken[first] < end] for one, first in zip(prepared.samples, firsts, strict=True)]
        firsts = [first[:count] for first in firsts]
        taken = [one.taken[first] for one, first in zip(prepared.samples, firsts, strict=True)]
        times = distinct(np.concatenate([[0.0], *taken]))
        seen = [
            (np.searchsorted(times, t), one.values[first], known.get(one.output, 1.0))
            for one, first, t in zip(prepared.samples, firsts, taken, strict=True)
        ]
        limits = [math.inf if one.gate is None or one.output not in known else one.gate for one in prepared.samples]
        counts = [first.size for first in firsts]
        small = [
            _tolerance(values, known.get(one.output))
            for one, (_, values, _) in zip(prepared.samples, seen, strict=True)
        ]
        u = _between(prepared.u, times, len(model.inputs))
        along = _FUNCTIONS.get(same(model), lambda: _functions(model))
        gates, tolerances = np.repeat(limits, counts), np.repeat(small, counts)
        parameters = prepared.run.plant.parameters
        return cls(model, parameters, times, prepared.u, u, seen, gates, *along, firsts, tolerances)

    def finer(self) -> StartTask | None:
        """The same with the longest times between two halved; None where these are too many."""
        gaps = np.diff(self.times)
        if not gaps.size:
            return self
        pieces = np.ceil(gaps / (gaps.max() / 2) * (1 - 1e-9)).astype(np.int64)
        if pieces.sum() >= _TIMES:
            return None
        numbers = np.concatenate([[0], np.cumsum(pieces)])
        times = np.interp(np.arange(numbers[-1] + 1), numbers, self.times)
        times[numbers] = self.times
        seen = [(numbers[places], values, std) for places, values, std in self.seen]
        return replace(self, times=times, u=_between(self.inputs, times, self.u.shape[-1]), seen=seen)

    @property
    def key(self) -> Hashable:
        """All that a fit depends on, beside its first guess, and the numbers of the samples: late ones have others."""
        numbers = self.parameters, self.times, self.u, self.gates, *self.numbers
        seen = ((places.tobytes(), values.tobytes(), std) for places, values, std in self.seen)
        return same(self.model), *(one.tobytes() for one in numbers), *seen

    def chosen(self, which: np.ndarray) -> list[Integers]:
        """The numbers of some of the samples, bools in the order of ``seen``, of each output."""
        ends = np.cumsum([one.size for one in self.numbers])[:-1]
        return [one[own] for one, own in zip(self.numbers, np.split(which, ends), strict=True)]

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
            along, by_first = self._stepped(x, t, h, lines)
            states = np.column_stack([states, along[:, _STEPS - 1 :: _STEPS]])
            by_first = by_first.reshape(n, -1, n)[:, _STEPS - 1 :: _STEPS].reshape(n, -1)
            by_start = np.column_stack([by_start, by_first])
        u = np.concatenate([self.u[:, 0, 0], self.u[-1:, -1, -1]]).T if k > 1 else np.zeros((self.u.shape[-1], 1))
        y, by_state = self._seen(states, u)
        by_state = by_state.reshape(q, k, n).transpose(1, 0, 2)
        return y.T, by_state @ by_start.reshape(n, k, n).transpose(1, 0, 2)

    def _seen(self, x: Floats, u: Floats) -> tuple[Floats, Floats]:
        """The outputs at every time, and their derivatives by the state."""
        k, n = self.times.size, len(x)
        parts = []
        for first in range(0, k, _ONCE):
            columns = (_filled(one[:, first : first + _ONCE]) for one in (self.times[None], x, u))
            parts.append(_numbers(self.output, *columns, self._everywhere(_ONCE)))
        y, by_state = (np.hstack(ones) for ones in zip(*parts, strict=True))
        return y[:, :k], by_state[:, : k * n]

    def _stepped(self, x: Floats, t: Floats, h: Floats, u: Floats) -> tuple[Floats, Floats]:
        """States and their derivatives by the start behind every step; u at its beginning, middle and end."""
        state, slope = x[:, None], np.eye(x.size)
        parts: list[list[Floats]] = []
        for first in range(0, t.size, _ONCE):
            times, lengths, *inputs = (_filled(one[:, first : first + _ONCE]) for one in (t, h, *u))
            lengths = np.where(np.arange(_ONCE) < t.size - first, lengths, 0.0)
            parts.append(_numbers(self.steps, state, slope, times, lengths, *inputs, self._everywhere(_ONCE)))
            state, slope = parts[-1][0][:, -1:], parts[-1][1][:, -x.size :]
        states, slopes = (np.hstack(ones) for ones in zip(*parts, strict=True))
        return states[:, : t.size], slopes[:, : t.size * x.size]

    def _everywhere(self, count: int) -> Floats:
        """The parameters, for so many times."""
        return np.tile(self.parameters[:, None], count)


def _filled(rows: Floats) -> Floats:
    """Columns for all steps that are made at once: those that are missing are the last one."""
    return rows if rows.shape[1] == _ONCE else np.hstack([rows, np.repeat(rows[:, -1:], _ONCE - rows.shape[1], axis=1)])


def _tolerance(values: Floats, std: float | None) -> float:
    """The error of the steps that does not matter, of a residual of an output with these samples."""
    if not values.size:
        return 0.0
    noise = _OF_SPREAD * float(np.ptp(values)) if std is None else _PART * std
    return max(noise, _OF_SIZE * float(np.max(np.abs(values)))) / (1.0 if std is None else std)


def _between(inputs: Callable[[Floats], Floats], times: Floats, count: int) -> Floats:
    """Inputs at the beginning, middle and end of every step between some times."""
    part = np.arange(_STEPS)[:, None] + np.array([0.0, 0.5, 1.0])
    moments = times[:-1, None, None] + np.diff(times)[:, None, None] * part / _STEPS
    return inputs(moments.ravel()).reshape(*moments.shape, count)


def _next(taken: Floats, count: int) -> float:
    """When the sample behind so many is taken, or the last of them has been; infinite where there are fewer."""
    if taken.size == count:
        return float(np.nextafter(taken[-1], np.inf))
    return float(taken[count]) if taken.size > count else math.inf


def _numbers(function: ca.Function, *arguments: float | Floats) -> list[Floats]:
    """The matrices that a function gives."""
    return [np.array(one) for one in function(*arguments)]


def _functions(model: PlantModel) -> tuple[ca.Function, ca.Function]:
    """Some steps, one after the other, and the outputs at some times."""
    return _step(model).mapaccum("steps", _ONCE, 2), _output(model).map(_ONCE)


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
