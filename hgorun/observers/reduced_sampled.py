"""Katayama's reduced-order observer for sampled-data systems."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import casadi as ca
import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema

from hgorun.config.types import describe, number
from hgorun.errors import Problem
from hgorun.observers.base import PeriodLimit, Sample, observer
from hgorun.observers.reduced_order import ReducedOrder
from hgorun.symbolic.strict_feedback import StrictFeedbackCopy, StrictFeedbackForm
from hgorun.symbolic.symbols import Symbols


def _rates(value: Any) -> float | tuple[float, ...]:
    several = isinstance(value, (list, tuple))
    rates = tuple(number(v) for v in (value if several else [value]))
    for h in rates:
        if not h > 0:
            raise ValueError(f"every h must be positive, found {h:g}")
    if not rates:
        raise ValueError(f"expected a number or a list of numbers, found {describe(value)}")
    return rates if several else rates[0]


_NUMBER = [{"type": "number"}, {"type": "string"}]
Rates = Annotated[
    float | tuple[float, ...],
    BeforeValidator(_rates),
    WithJsonSchema({"anyOf": [*_NUMBER, {"type": "array", "items": {"anyOf": _NUMBER}}]}),
]


@observer("reduced_sampled")
class ReducedSampledObserver(ReducedOrder):
    """Reduced-order observer for sampled plants of strict-feedback-like form.

    For x' = f_1(x, u) + g(x, u) z, z' = f_2(x, z, u), y(k) = x(t_k), with T = t_(k+1) - t_k,

        zhat(k+1) = (I - T H) zhat(k) + T (H Psi + f_2(y, Psi, u))
        Psi = (g^T g)^-1 g^T ((y(k+1) - y(k)) / T - f_1(y, u))

    y and u in f_1, f_2 and g are those of sample k (not of k + 1); the new value is that of sample k + 1. The
    estimate of the whole state is (y, zhat), in the plant's order, its measured part being the latest sample;
    until the second sample both parts are ``initial``. A2: the n_z x n_z matrix g^T g is nonsingular (m x m
    in the print), so there are at least as many measured states as others.

    H = diag(h_1, ..., h_n_z), h_i > 0: the rates at which what is known by now is forgotten. The error of the
    plant's Euler model follows (I - T H)^k, so that |1 - T h_i| < 1 is needed (A3), h_i < 2/T; beyond it the
    estimate diverges. The estimate of the exact plant is practical: it is right up to a remainder that
    shrinks with T. Noise enters through the difference quotient: small h_i average it, h_i = 1/T is the
    deadbeat observer. It does not vanish with T, as Remark 4.2 has it, but falls to a floor.
    """

    reference = "Katayama, (6), (8)"

    H: Rates = Field(description="h_i of every unmeasured state, or one number for all; 0 < h_i < 2/T")

    def design(self, form: StrictFeedbackForm) -> dict[str, np.ndarray]:
        names = [form.plant.states[i] for i in form.hidden]
        if isinstance(self.H, tuple) and len(self.H) != len(names):
            raise Problem(
                ("H",),
                f"expected one number for all or {len(names)}, for {', '.join(names)}; found {len(self.H)}",
            )
        return {"H": np.broadcast_to(self.H, len(names))}

    def rates(self, form: StrictFeedbackForm) -> np.ndarray:
        return np.broadcast_to(self.H, len(form.hidden))

    def longest_period(self, form: StrictFeedbackForm) -> PeriodLimit:
        return PeriodLimit(2 / float(np.max(self.H)), "|1 - T h_i| of the plant's Euler model, A3")

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"H": 0.5}

    def jump(
        self,
        plant: StrictFeedbackCopy,
        before: StrictFeedbackCopy,
        s: Symbols,
        sample: Sample,
        k: Symbols,
    ) -> Mapping[str, ca.SX]:
        T, y, zhat = sample.interval, sample.previous, before.hidden(s.xhat)
        Psi = before.Psi(y, sample.y, T)
        zhat = (1 - T * k.H) * zhat + T * (k.H * Psi + before.f_2(y, Psi))
        return {"xhat": plant.join(sample.y, zhat)}
