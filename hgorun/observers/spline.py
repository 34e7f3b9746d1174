"""The smoothing spline of all samples so far: what observers are compared with."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Positive
from hgorun.observers.base import Arrival, Flow, Role, observer
from hgorun.observers.capabilities import NO_MODEL, Differentiator
from hgorun.observers.stepped import SteppedObserver
from hgorun.symbolic.derivatives import DerivativeCopy, DerivativeForm, derivative_form
from hgorun.symbolic.matrices import A
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols

_UNKNOWN = 1e8  # variance of each derivative at the start, over that of a sample


@observer("spline")
class SmoothingSpline(Differentiator, SteppedObserver[DerivativeForm, DerivativeCopy]):
    """Causal smoothing spline, for lower triangular plants with one output.

    At every time the function f is taken that minimises

        sum_k (y_k - f(t_k))^2 + smoothing int (f^(n))^2 dt

    over all samples so far: a natural spline of degree 2 n - 1, for n = 2 the cubic one. The output's derivatives are
    z_i = f^(i) at that time, i = 0 .. n-1, and the estimate is the state that belongs to them, as for ``levant``.
    Behind the newest sample f is a polynomial of degree n - 1. A continuous output is measured at the ends of the
    solver's steps, which have to be given.

    It is computed without the samples of the past: f and its derivatives at the end are those that the Kalman filter
    gives for y^(n) = white noise of the density 1/smoothing, samples with noise of the variance 1, and a start of which
    nothing is known (Wahba 1978). With A, B, C of the chain of n integrators

        z' = A z,    P' = A P + P A^T + B B^T/smoothing,    P(0) = 1e8 I

    and at a sample K = P C^T/(C P C^T + 1), z+ = z + K (y - z_0), P+ = (I - K C) P (I - K C)^T + K K^T.

    ``smoothing`` has the unit time^(2n-1). For samples of a short period T it is, after a while, the high-gain observer
    of the chain with theta = (smoothing T)^(-1/(2n)) and Butterworth poles, without the model phi: a baseline, and an
    observer that knows the model should be better.
    """

    reference = "Reinsch 1967; Wahba 1978"
    form = staticmethod(derivative_form)
    lacks = NO_MODEL

    smoothing: Positive = Field(description="weight of the n-th derivative's square against that of the residuals, > 0")

    def design(self, form: DerivativeForm) -> dict[str, np.ndarray]:
        return {"smoothing": np.array(self.smoothing)}

    def states(self, form: DerivativeForm) -> dict[str, np.ndarray | Symmetric]:
        return {"P": Symmetric(_UNKNOWN * np.eye(form.plant.n)), "age": np.ones(1)}

    def roles(self, form: DerivativeForm) -> dict[str, Role]:
        return {"P": "gain", "age": "gain"}

    def equations(self, plant: DerivativeCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        n = s.xhat.numel()
        chain, driven = A(n), ca.SX.zeros(n, n)
        driven[n - 1, n - 1] = 1 / k.smoothing
        return Flow(
            {"xhat": chain @ s.xhat, "P": chain @ s.P + s.P @ chain.T + driven, "age": ca.SX.ones(1)},
            correction=ca.SX.zeros(e.shape),
        )

    def decide(self, plant: DerivativeCopy, s: Symbols, e: ca.SX, k: Symbols) -> Mapping[str, ca.SX]:
        """A continuous output is measured once at a time: ``age``, the time since then, is above 0."""
        new = super().decide(plant, s, e, k)
        return {name: ca.if_else(s.age > 0, value, vars(s)[name]) for name, value in new.items()} | {"age": ca.SX(0)}

    def correct(self, plant: DerivativeCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        K = arrival.fresh * s.P[:, 0] / (s.P[0, 0] + 1)
        left = ca.SX.eye(s.xhat.numel())
        left[:, 0] -= K
        return {"xhat": s.xhat + K * (arrival.y - s.xhat[0]), "P": left @ s.P @ left.T + K @ K.T}

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"smoothing": 1e-4}
