"""Where observers start: the state from which the model passes nearest to the first samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

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
_DIGITS = 10  # of the start: those behind are the C library's, since here CasADi's own functions are called, for speed
_FUNCTIONS: Memo[tuple[ca.Function, ca.Function]] = Memo(16)


def fitted_start(prepared: PreparedEstimate, count: int) -> dict[str, float]:
    """The state at the start from which the model passes nearest to the first samples.

    x(0) minimises the sum of ((y_k - h(x(t_k)))/std)^2 over the first samples of every output, x being the solution of
    the model from x(0), by the method of Gauss and Newton with the derivatives of the solution. Where no ``std`` is
    stated it is 1. What the samples do not tell stays at the initial state of the plant.

    Parameters
    ----------
    prepared : PreparedEstimate
        With the initial state of the plant as a first guess.
    count : int
        How many samples of each output.

    Raises
    ------
    Problem
        Where the model leaves the numbers from every state near the guess.
    """
    model = prepared.run.plant.model
    task = _Task.of(prepared, count)
    guess = dict(prepared.experiment.plant_block.initial)
    x = np.array([float(guess.get(state, 0.0)) for state in model.states])
    error, slope = task.residuals(x)
    for _ in range(_PASSES):
        if not np.all(np.isfinite(error)):
            break
        step = _least_squares(slope, error)
        for halving in range(_HALVINGS):
            tried = x - step / 2**halving
            found, its_slope = task.residuals(tried)
            if np.all(np.isfinite(found)) and found @ found < error @ error:
                break
        else:
            break
        less = 1 - (found @ found) / (error @ error)
        x, error, slope = tried, found, its_slope
        if less < _ENOUGH:
            break
    if not np.all(np.isfinite(error)):
        message = f"from the first of {count} samples the model leaves all bounds before the last of them"
        raise Problem(("data", "first_samples"), message)
    return {state: float(f"{value:.{_DIGITS}g}") for state, value in zip(model.states, x.tolist(), strict=True)}


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
    """

    model: PlantModel
    parameters: np.ndarray
    times: Floats
    u: Floats
    seen: list[tuple[np.ndarray, Floats, float]]
    step: ca.Function
    output: ca.Function

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
        step, output = _FUNCTIONS.get(same(model), lambda: (_step(model), _output(model)))
        return cls(model, prepared.run.plant.parameters, times, u, seen, step, output)

    def residuals(self, x: Floats) -> tuple[Floats, Floats]:
        """Estimated minus measured over the standard deviation, and its derivative by the state at the start."""
        errors, slopes = [], []
        with np.errstate(all="ignore"):  # from a bad guess the model may leave the numbers
            along = list(self._along(x))
            for i, (places, values, std) in enumerate(self.seen):
                for place, value in zip(places.tolist(), values.tolist(), strict=True):
                    y, by_start = along[place]
                    errors.append(float(self.model.wrapped(i, np.array(y[i] - value))) / std)
                    slopes.append(by_start[i] / std)
        return np.array(errors), np.array(slopes)

    def _along(self, x: Floats) -> Iterator[tuple[Floats, Floats]]:
        """The output at every time, and its derivative by the state at the start."""
        by_start = np.eye(x.size)
        for k, t in enumerate(self.times.tolist()):
            u = self.u[k, 0, 0] if k < len(self.u) else self.u[-1, -1, -1] if len(self.u) else np.zeros(0)
            y, by_state = _numbers(self.output, t, x, u, self.parameters)
            yield y[:, 0], by_state @ by_start
            if k < len(self.u):
                h = (self.times[k + 1] - t) / _STEPS
                for i, (a, b, c) in enumerate(self.u[k]):
                    then, by_before = _numbers(self.step, t + i * h, h, x, a, b, c, self.parameters)
                    x, by_start = then[:, 0], by_before @ by_start


def _numbers(function: ca.Function, *arguments: float | Floats) -> list[Floats]:
    """The matrices that a function gives."""
    return [np.array(one) for one in function(*arguments)]


def _step(model: PlantModel) -> ca.Function:
    """A step of the classical method of Runge and Kutta, and its derivative by the state before."""
    t, h, x, p = ca.SX.sym("t"), ca.SX.sym("h"), ca.SX.sym("x", model.n), ca.SX.sym("p", len(model.parameters))
    a, b, c = (ca.SX.sym(name, len(model.inputs)) for name in "abc")
    k1 = model.f(t, x, a, p)
    k2 = model.f(t + h / 2, x + h / 2 * k1, b, p)
    k3 = model.f(t + h / 2, x + h / 2 * k2, b, p)
    k4 = model.f(t + h, x + h * k3, c, p)
    then = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return ca.Function("step", [t, h, x, a, b, c, p], [then, ca.densify(ca.jacobian(then, x))])


def _output(model: PlantModel) -> ca.Function:
    """The output, and its derivative by the state."""
    y = ca.densify(model.output)
    arguments = [model.t, model.x, model.u, model.p]
    return ca.Function("output", arguments, [y, ca.densify(ca.jacobian(y, model.x))])
