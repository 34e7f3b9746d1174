"""Han's tracking differentiator."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Positive
from hgorun.errors import Problem
from hgorun.observers.base import observer
from hgorun.observers.capabilities import NotLinear, Punctual
from hgorun.observers.stepped_differentiator import SteppedDifferentiator
from hgorun.symbolic.derivatives import DerivativeForm
from hgorun.symbolic.symbols import Symbols

_PERIODS = 5.0  # h_0 by default


@observer("tracking")
class TrackingDifferentiator(NotLinear, SteppedDifferentiator):
    """Han's tracking differentiator, for lower triangular plants with one output and two states.

    x_1 follows the output y as fast as an acceleration within r allows, and x_2 is its derivative: a step of length h
    is

        x_1+ = x_1 + h x_2,    x_2+ = x_2 + h fhan(x_1 - y, x_2, r, h_0)

    where fhan is the time-optimal control of the double integrator in discrete time, with d = r h_0^2, a_0 = h_0 x_2, s
    = x_1 - y + a_0 and a_1 = sqrt(d (d + 8 |s|)):

        a    = a_0 + s if |s| <= d, else a_0 + sign(s) (a_1 - d)/2
        fhan = -r a/d  if |a| <= d, else -r sign(a)

    r > sup |y''|, in y/time^2: a step of the output of the size c is followed in the time 2 sqrt(c/r), without
    overshoot. h_0 >= h filters; by default it is five times the period h, and where both are equal an error within r
    h^2 is gone after two steps. Larger h_0 let less noise through and lag more: behind a ramp by 2 h_0.

    What uses the sample y_k is the estimate of t_(k+1), where it is taken on. A continuous output is measured at the
    ends of the solver's steps. Late outputs are refused: it follows what it gets, and has no model to bring that to the
    present. Choose it for references with steps and for outputs whose acceleration is bounded; ``red`` is exact for
    smooth outputs without noise, which this one is not for h_0 > h.

    fhan is quoted from memory of the publications.
    """

    because = Punctual.because
    reference = "Han 2009"

    r: Positive = Field(description="largest acceleration, above sup |y''|, in y/time^2, > 0")
    h_0: Positive | None = Field(
        default=None, description="time constant of the filter, not less than the period h; 5 h by default"
    )

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"r": 10.0}

    def design(self, form: DerivativeForm) -> dict[str, np.ndarray]:
        if form.plant.n != 2:
            message = f"it gives an output and its derivative, for two states; this plant has {form.plant.n}"
            raise Problem(("type",), message)
        given = self.h_0 is not None
        return {"r": np.array(self.r), "h_0": np.array([self.h_0 or 0.0, 0.0 if given else _PERIODS])}

    @property
    def not_linear(self) -> str | None:
        return "the acceleration is at its bound r except for errors within r h_0^2"

    def check_times(self, form: DerivativeForm, times: Mapping[str, np.ndarray], origin: float) -> None:
        longest = max((float(np.max(np.diff(one), initial=0.0)) for one in times.values()), default=0.0)
        if self.h_0 is not None and longest > self.h_0 * (1 + 1e-9):
            raise Problem(("h_0",), f"must not be below the time between samples, {longest:.4g}; found {self.h_0:g}")

    def longest_step(self, form: DerivativeForm) -> float:
        return float("inf") if self.h_0 is None else self.h_0

    def advanced(self, s: Symbols, y: ca.SX, h: ca.SX, k: Symbols) -> Mapping[str, ca.SX]:
        x_1, x_2 = ca.vertsplit(s.xhat)
        acceleration = fhan(x_1 - y, x_2, k.r, k.h_0[0] + k.h_0[1] * h)
        return {"xhat": ca.vertcat(x_1 + h * x_2, x_2 + h * acceleration)}


def fhan(x_1: ca.SX, x_2: ca.SX, r: ca.SX, h_0: ca.SX) -> ca.SX:
    """Time-optimal acceleration to the origin, within r."""
    d, a_0 = r * h_0**2, h_0 * x_2
    s = x_1 + a_0
    far = a_0 + ca.sign(s) * (ca.sqrt(d * (d + 8 * ca.fabs(s))) - d) / 2
    a = ca.if_else(ca.fabs(s) <= d, a_0 + s, far)
    return -r * ca.fmin(ca.fmax(a / d, -1), 1)
