"""The first samples of a recording, and the model's way along them from any start."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from hgorun.engine.plan import Integers
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import stated
from hgorun.estimate.start.steps import Steps, step_of
from hgorun.memo import Memo, same
from hgorun.pieces import distinct
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.plant import PlantModel

_ONCE = 64  # steps, and times, that a function is for: to make one for each number of them takes longer
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
    way : Steps
        In which the model is followed from the first to the last of them.
    u : ndarray, shape (k, m)
        The inputs at these times.
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
    way: Steps
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
        u = prepared.u(times)
        along = _FUNCTIONS.get(same(model), lambda: _functions(model))
        gates, tolerances = np.repeat(limits, counts), np.repeat(small, counts)
        parameters = prepared.run.plant.parameters
        way = Steps.along(times, prepared)
        return cls(model, parameters, times, way, u, seen, gates, *along, firsts, tolerances)

    def finer(self) -> StartTask | None:
        """The same with the longest steps halved; None where these are too many."""
        way = self.way.finer()
        return None if way is None else replace(self, way=way)

    @property
    def key(self) -> Hashable:
        """All that a fit depends on, beside its first guess, and the numbers of the samples: late ones have others."""
        numbers = self.parameters, self.times, self.u, self.way.moments, self.way.u, self.gates, *self.numbers
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

    def turned(self, x: Floats, left: Sequence[Integers]) -> Floats:
        """A start from which the model passes the same way, whole periods of measured states elsewhere.

        The outputs are near to the samples as numbers, and not only as angles: beside the first of each output that is
        not left out.
        """
        model, moved, y, seen = self.model, x.copy(), self._along(x)[0], set[int]()
        for i, (output, (places, values, _)) in enumerate(zip(model.outputs, self.seen, strict=True)):
            period = model.periods[i] if model.periods else None
            kept = np.flatnonzero(~np.isin(self.numbers[i], left[i]))
            if period is None or output not in model.measures or not kept.size:
                continue
            state = model.states.index(model.measures[output])
            if state not in seen:  # of several outputs that measure it the first one says where it is
                seen.add(state)
                beyond = y[places[kept[0]], i] - values[kept[0]]
                moved[state] -= period * round(float(beyond) / period)
        same = np.all(np.abs(self.residuals(moved)[0] - self.residuals(x)[0]) <= self.tolerances)
        return moved if same else x

    def weighted(self, x: Floats) -> tuple[Floats, Floats]:
        """The same, multiplied by the weights."""
        error, slope = self.residuals(x)
        with np.errstate(invalid="ignore"):  # as before: what is infinite, and left out, is no number
            return error * self.weights, slope * np.reshape(self.weights, (-1, 1))

    def _along(self, x: Floats) -> tuple[Floats, Floats]:
        """The outputs at every time, shape (k, q), and their derivatives by the state at the start, (k, q, n)."""
        n, k, q = x.size, self.times.size, len(self.seen)
        states, by_start = x[:, None], np.eye(n)
        if k > 1:
            along, by_first = self._stepped(x)
            last = np.searchsorted(self.way.ends, self.times[1:]) - 1
            states = np.column_stack([states, along[:, last]])
            by_start = np.column_stack([by_start, by_first.reshape(n, -1, n)[:, last].reshape(n, -1)])
        y, by_state = self._seen(states, self.u.T)
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

    def _stepped(self, x: Floats) -> tuple[Floats, Floats]:
        """States and their derivatives by the start behind every step."""
        state, slope, count = x[:, None], np.eye(x.size), self.way.lengths.size
        rows = [*self.way.moments.T[:, None], self.way.lengths[None], *self.way.u.transpose(1, 2, 0)]
        parts: list[list[Floats]] = []
        for first in range(0, count, _ONCE):
            *times, lengths, a, b, c = (_filled(one[:, first : first + _ONCE]) for one in rows)
            lengths = np.where(np.arange(_ONCE) < count - first, lengths, 0.0)
            parts.append(_numbers(self.steps, state, slope, *times, lengths, a, b, c, self._everywhere(_ONCE)))
            state, slope = parts[-1][0][:, -1:], parts[-1][1][:, -x.size :]
        states, slopes = (np.hstack(ones) for ones in zip(*parts, strict=True))
        return states[:, :count], slopes[:, : count * x.size]

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
    return step_of(model).mapaccum("steps", _ONCE, 2), _output(model).map(_ONCE)


def _output(model: PlantModel) -> ca.Function:
    """The output, and its derivative by the state."""
    y = ca.densify(model.output)
    arguments = [model.t, model.x, model.u, model.p]
    return ca.Function("output", arguments, [y, ca.densify(ca.jacobian(y, model.x))])
