"""The steps from sample to sample in which the model is followed; none passes over a change of an input."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.estimate.prepared import PreparedEstimate
from hgorun.pieces import distinct
from hgorun.simulation.timeline.recorded_inputs import RecordedInputs
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.plant import PlantModel

_AT_FIRST = 8  # between two samples
_MOST = 1 << 14
_MOST_CHANGES = 1 << 10  # at which steps end, where inputs count by their means between the ends of steps
_INWARD = 1e-7  # of a step: how far from a change its sides are


@dataclass(frozen=True, eq=False, repr=False)
class Steps:
    """Steps of the classical method of Runge and Kutta.

    Attributes
    ----------
    ends : ndarray, shape (s + 1,)
        The start, and the ends of all steps.
    sharp : ndarray of bool, shape (s + 1,)
        At which of them inputs change, or functions of time have kinks.
    margin : float
        Times that are nearer to such a change than this may be on its other side.
    inputs : callable
        u at the moments of steps, which are given with their ends.
    moments : ndarray, shape (s, 3)
        The beginning, middle and end of every step, on its own side of a change.
    u : ndarray, shape (s, 3, m)
        The inputs there.
    """

    ends: Floats
    sharp: np.ndarray
    margin: float
    inputs: Callable[[Floats, Floats], Floats]
    moments: Floats
    u: Floats

    @classmethod
    def along(cls, times: Floats, prepared: PreparedEstimate) -> Steps:
        """Some between each two times."""
        by_means = _by_means(prepared)
        changes, left = _changes(prepared, float(times[-1]), _MOST_CHANGES if by_means else _MOST)
        schedule = prepared.run.schedule
        integral = _integral(prepared.inputs) if left and by_means and prepared.inputs is not None else None
        nodes = distinct(np.concatenate([times, changes]))
        longest = np.diff(times) / _AT_FIRST
        between = np.searchsorted(times, nodes[1:], side="left") - 1
        pieces = np.ceil(np.diff(nodes) / longest[between] * (1 - 1e-9)).astype(np.int64)
        margin = 4 * (prepared.tolerance + float(np.max(schedule.inward)))

        def at(ends: Floats, moments: Floats) -> Floats:
            u = prepared.u(moments.ravel()).reshape(*moments.shape, -1)
            if integral is not None:  # steps that pass over changes take the mean between their ends
                means = np.diff(integral(ends), axis=0) / np.diff(ends)[:, None]
                u[:, :, prepared.recorded] = means[:, None]
            return u

        return cls._of(_split(nodes, pieces), changes, margin, at)

    @classmethod
    def _of(cls, ends: Floats, changes: Floats, margin: float, inputs: Callable[[Floats, Floats], Floats]) -> Steps:
        sharp, lengths = np.zeros(ends.size, dtype=bool), np.diff(ends)
        sharp[np.searchsorted(ends, changes)] = True
        inward = np.minimum(np.maximum(_INWARD * lengths, margin), lengths / 4)
        begin, end = ends[:-1] + inward * sharp[:-1], ends[1:] - inward * sharp[1:]
        moments = np.stack([begin, ends[:-1] + lengths / 2, end], axis=1)
        return cls(ends, sharp, margin, inputs, moments, inputs(ends, moments))

    @property
    def lengths(self) -> Floats:
        """Of all steps."""
        return np.diff(self.ends)

    def finer(self) -> Steps | None:
        """With the longest ones halved; None where these are too many."""
        if not self.lengths.size:
            return self
        pieces = np.ceil(self.lengths / (self.lengths.max() / 2) * (1 - 1e-9)).astype(np.int64)
        if pieces.sum() >= _MOST:
            return None
        return self._of(_split(self.ends, pieces), self.ends[self.sharp], self.margin, self.inputs)


def _split(nodes: Floats, pieces: np.ndarray) -> Floats:
    """Ends of so many equal steps between each two times, which are among them."""
    numbers = np.concatenate([[0], np.cumsum(pieces)])
    ends = np.interp(np.arange(numbers[-1] + 1), numbers, nodes)
    ends[numbers] = nodes
    return np.asarray(ends)


def _integral(inputs: RecordedInputs) -> Callable[[Floats], Floats]:
    """That of recorded inputs, as a function of time."""
    lengths = np.diff(inputs.times)[:, None]
    parts = inputs.levels[:-1] * lengths + inputs.slopes[:-1] * lengths**2 / 2
    whole = np.concatenate([np.zeros((1, parts.shape[1])), np.cumsum(parts, axis=0)])

    def until(times: Floats) -> Floats:
        i = np.maximum(np.searchsorted(inputs.times, times, side="right") - 1, 0)
        since = (times - inputs.times[i])[:, None]
        return np.asarray(whole[i] + inputs.levels[i] * since + inputs.slopes[i] * since**2 / 2)

    return until


def _by_means(prepared: PreparedEstimate) -> bool:
    """Whether the mean of the derivative is that of the mean of recorded inputs, which it is where u enters as u."""
    model = prepared.run.plant.model
    recorded = [model.u[i] for i in prepared.recorded] if prepared.inputs is not None else []
    return ca.is_linear(model.dynamics, ca.vertcat(*recorded)) if recorded else True


def _changes(prepared: PreparedEstimate, end: float, most: int) -> tuple[Floats, bool]:
    """When functions of time have kinks and recorded inputs change; the largest ones where some are left over."""
    schedule = prepared.run.schedule
    kinks = schedule.events[schedule.inward > 0]
    times, sizes = [kinks], [np.full(kinks.size, np.inf)]
    if prepared.inputs is not None:
        count = int(np.searchsorted(prepared.inputs.times, end, side="right"))
        times.append(prepared.inputs.times[:count])
        sizes.append(_sizes(prepared.inputs.levels[:count], held=prepared.inputs.held))
    t, size = np.concatenate(times), np.concatenate(sizes)
    within = (t > 0) & (t <= end) & (size > 0)  # a step ends before a change at its end
    t, size = t[within], size[within]
    return distinct(t[np.argsort(-size, kind="stable")[:most]]), t.size > most


def _sizes(levels: Floats, *, held: bool) -> Floats:
    """By how much inputs change from value to value, beside their spread; of lines on either side."""
    spread = np.ptp(levels, axis=0)
    steps = np.abs(np.diff(levels, axis=0)) / np.where(spread > 0, spread, 1.0)
    steps = np.concatenate([[0.0], np.max(steps, axis=1, initial=0.0)])
    return steps if held else np.maximum(steps, np.append(steps[1:], 0.0))


def step_of(model: PlantModel) -> ca.Function:
    """Such a step: the state, and its derivative by the start."""
    h, x, p = ca.SX.sym("h"), ca.SX.sym("x", model.n), ca.SX.sym("p", len(model.parameters))
    first, middle, last = (ca.SX.sym(name) for name in ("first", "middle", "last"))
    a, b, c = (ca.SX.sym(name, len(model.inputs)) for name in "abc")
    k1 = model.f(first, x, a, p)
    k2 = model.f(middle, x + h / 2 * k1, b, p)
    k3 = model.f(middle, x + h / 2 * k2, b, p)
    k4 = model.f(last, x + h * k3, c, p)
    then = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    by_start = ca.SX.sym("by_start", model.n, model.n)
    by_both = ca.densify(ca.mtimes(ca.jacobian(then, x), by_start))
    return ca.Function("step", [x, by_start, first, middle, last, h, a, b, c, p], [then, by_both])
