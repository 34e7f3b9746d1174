"""The first samples of a recording, and the model's way along them from any start."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.engine.plan import Integers
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import stated
from hgorun.memo import Memo, same
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.levels import distinct
from hgorun.symbolic.plant import PlantModel

_STEPS = 8  # of the classical method of Runge and Kutta, between two samples
_FUNCTIONS: Memo[tuple[ca.Function, ca.Function]] = Memo(16)
_MAPPED: Memo[tuple[ca.Function, ca.Function]] = Memo(64)


@dataclass(frozen=True, eq=False, repr=False)
class StartTask:
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
    numbers : list of ndarray
        Of each output which of its samples these are.
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
    numbers: list[Integers]
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
            Whether those of slow outputs end where the fastest one has so many: over a longer time what the model lacks
            counts more than the noise.
        """
        model, known = prepared.run.plant.model, stated(prepared.experiment)
        firsts = [np.argsort(one.taken, kind="stable") for one in prepared.samples]
        if without is not None:
            firsts = [first[~np.isin(first, left)] for first, left in zip(firsts, without, strict=True)]
        firsts = [first[:count] for first in firsts]
        if together:
            end = min(
                (
                    one.taken[first[-1]]
                    for one, first in zip(prepared.samples, firsts, strict=True)
                    if first.size == count
                ),
                default=np.inf,
            )
            firsts = [first[one.taken[first] <= end] for one, first in zip(prepared.samples, firsts, strict=True)]
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
        return cls(model, prepared.run.plant.parameters, times, u, seen, gates, *along, firsts)

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
