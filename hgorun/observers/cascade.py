"""Khalil's cascade high-gain observer, which does not peak."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Positive
from hgorun.errors import Problem
from hgorun.observers.base import ContinuousObserver, Flow, observer
from hgorun.observers.capabilities import NO_MODEL, Differentiator, HighGain, LocallyLinear
from hgorun.observers.nested import clipped
from hgorun.symbolic.derivatives import DerivativeCopy, DerivativeForm, derivative_form
from hgorun.symbolic.symbols import Symbols

_ROUNDED = 16 * np.finfo(float).eps  # of each of the two summands of q_i: three roundings of start, and two of q
_MAPPED = 1e-9  # relative: rounding of a map into the plant's states and back, far below what runs tell apart


@observer("cascade")
class CascadeObserver(Differentiator, LocallyLinear, HighGain, ContinuousObserver[DerivativeForm, DerivativeCopy]):
    """Cascade high-gain observer, for lower triangular plants with one output, n >= 2.

    It uses no model of the plant, only bounds of its states. With x_i the derivatives of the output,

        xhat_1' = w + theta alpha_1 (y - xhat_1),    w' = theta^2 alpha_2 (y - xhat_1),    xhat_2 = sat_(M_1)(w)
        z_i'    = -q_i,    q_i = alpha_i theta (z_i + xhat_(i-1)),    xhat_i = sat_(M_(i-1))(q_i),    i >= 3

    so that xhat_2 is y filtered by alpha_2 s/(mu^2 s^2 + alpha_1 mu s + alpha_2), mu = 1/theta, and each further one is
    the one before, filtered by s/(1 + mu s/alpha_i). M_i > 0 bounds |x_(i+1)|: no estimate ever leaves its bounds,
    whatever theta and the initial error. theta appears to the power 2 at most. Where x_i' is constant the missing
    model leaves

        xhat_i - x_i = -(alpha_1/alpha_2 + sum_(j=3..i) 1/alpha_j) x_i'/theta.

    Choose it if there is no model, or if the estimate must not peak; take ``low_power`` with ``saturate`` if the
    model is known, since the error of this one does not go to zero. On plants that are not chains of integrators the
    estimate is the state that belongs to these derivatives; ``initial`` gives those at the start, with the inputs
    there.
    """

    lacks = NO_MODEL

    reference = "Khalil 2017"
    form = staticmethod(derivative_form)

    theta: Positive = Field(description="high gain theta > 0: 1/mu; the error is of the order of 1/theta")
    alpha: tuple[Positive, ...] | None = Field(
        default=None, description="alpha_1..alpha_n > 0; 2, 1, 1, ..., 1 by default, all eigenvalues at -theta"
    )
    M: tuple[Positive, ...] = Field(description="bounds of |x_2|..|x_n|, derivatives of the output: n - 1 numbers > 0")

    @classmethod
    def example(cls, states: tuple[str, ...]) -> dict[str, object]:
        return {"theta": 2.0, "M": [1e3] * (len(states) - 1)}

    def design(self, form: DerivativeForm) -> dict[str, np.ndarray]:
        n = form.plant.n
        if n < 2:
            raise Problem(("type",), "cascade estimates derivatives of the output and needs n >= 2, found n = 1")
        if len(self.M) != n - 1:
            raise Problem(("M",), f"expected {n - 1} bounds, of x_2..x_{n}; found {len(self.M)}")
        return {"theta": np.array(self.theta), "alpha": self._alpha(n), "M": np.array(self.M)}

    def _alpha(self, n: int) -> np.ndarray:
        if self.alpha is not None and len(self.alpha) != n:
            raise Problem(("alpha",), f"expected {n} numbers; found {len(self.alpha)}")
        return np.array([2.0, *[1.0] * (n - 1)] if self.alpha is None else self.alpha)

    @property
    def nonlinear(self) -> str | None:
        return "a saturation is active while an estimate is at its bound M"

    def beyond(self, plant: DerivativeCopy, s: Symbols, e: ca.SX, k: Symbols) -> ca.SX:
        # s is rebuilt from the estimate, and with it what a bound has cut off: each q comes out at the bound, rounded
        q, xhat = self._derivatives(s, k)
        parts = [ca.SX(0), *[k.alpha[i] * k.theta * ca.fabs(xhat[i - 2]) for i in range(2, s.xhat.numel())]]
        return ca.fabs(ca.vertcat(*q)) + _ROUNDED * ca.vertcat(*parts) >= (1 - _MAPPED) * k.M

    def start(self, xhat: np.ndarray, k: Mapping[str, np.ndarray]) -> np.ndarray:
        """(xhat_1, w, z_3, ..., z_n), the state that is called xhat."""
        z = np.array(xhat)
        z[..., 2:] = xhat[..., 2:] / (k["alpha"][2:] * k["theta"]) - xhat[..., 1:-1]
        return z

    def estimate(self, s: Symbols, k: Symbols) -> ca.SX:
        _, xhat = self._derivatives(s, k)
        return ca.vertcat(s.xhat[0], *xhat)

    def _derivatives(self, s: Symbols, k: Symbols) -> tuple[list[ca.SX], list[ca.SX]]:
        """(w, q_3, ..., q_n), and the same saturated: xhat_2, ..., xhat_n."""
        q = [s.xhat[1]]
        xhat = [clipped(q[0], k.M[0])]
        for i in range(2, s.xhat.numel()):
            q.append(k.alpha[i] * k.theta * (s.xhat[i] + xhat[-1]))
            xhat.append(clipped(q[-1], k.M[i - 1]))
        return q, xhat

    def equations(self, plant: DerivativeCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        (w, *q), _ = self._derivatives(s, k)
        correction = k.theta * k.alpha[0] * e
        rates = [w - correction, -(k.theta**2) * k.alpha[1] * e, *[-one for one in q]]
        return Flow({"xhat": ca.vertcat(*rates)}, correction=correction)

    def fastest_rate(self, form: DerivativeForm) -> float:
        alpha = self._alpha(form.plant.n)
        pair = np.abs(np.roots([1.0, alpha[0], alpha[1]]))
        return float(self.theta * np.max(np.append(pair, alpha[2:])))
