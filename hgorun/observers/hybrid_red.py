"""The differentiator with a linear correction beside the sliding mode."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Positive
from hgorun.errors import Problem
from hgorun.observers.base import observer
from hgorun.observers.capabilities import SlidingMode, Switching
from hgorun.observers.red import LAMBDA, Explicit, drift
from hgorun.observers.stepped_differentiator import SteppedDifferentiator
from hgorun.symbolic.derivatives import DerivativeForm
from hgorun.symbolic.symbols import Symbols

MU = (2.0, 3.0, 4.0, 7.0, 9.0, 13.0, 19.0, 23.0)


@observer("hybrid_red")
class HybridDifferentiator(SlidingMode, Switching, SteppedDifferentiator):
    """Levant's differentiator with linear terms, for lower triangular plants with one output.

    Of order n, for n + 1 states, n <= 7. Beside the terms of the exact differentiator (``red``, ``levant``) there is a
    linear one that brings large errors down exponentially. With w_0 = z_0 - y and, for j = 0..n,

        w_(j+1) = lambda_(n-j) L^(1/(n-j+1)) |w_j|^((n-j)/(n-j+1)) sign(w_j) + mu_(n-j) M w_j
        z_j'    = z_(j+1) - w_(j+1)
        lambda  = 1.1, 1.5, 2, 3, 5, 7, 10, 12,    mu = 2, 3, 4, 7, 9, 13, 19, 23,  from the last equation to the first

    L > 0 bounds |y^(n+1)|, and M > 0, per time, is the bandwidth of the linear part, by default 2 L^(1/(n+1)). With M =
    0 it would be the exact differentiator, with L = 0 the standard high-gain observer without a model, theta = M and G
    = (mu_n, mu_n mu_(n-1), ...). Near the truth the sliding mode prevails, far from it the linear part.

    It is a recursion of samples as ``red`` is, by Euler steps (``discretisation: explicit``) or with the Taylor terms
    of the chain (``proper``); what uses the sample y_k is the estimate of t_(k+1). A continuous output is measured at
    the ends of the solver's steps. Euler steps of the linear part are stable for h M < 0.5, 0.14, 0.025 at n = 1, 2,
    3. Late outputs are refused: a relay with a delay ends in a limit cycle. Choose it over ``red`` if the initial
    error is large; against noise, which the linear part also passes, choose ``filtering``.

    The default of M is for outputs of order one: with it both parts of w_1 are of one size where |z_0 - y| is
    (lambda_n/(2 mu_n))^(n+1) units of y, 1/16 of one at n = 1, and L does not tell how large y is. The same signal in
    another unit of y gets another M: in one a million times smaller, at n = 1, M is a thousand times as large, and
    Euler steps that were stable diverge. Where y is of another size give M, about 2 (L/|y|)^(1/(n+1)).

    Coefficients and form are quoted from memory of the publication; both limits are checked.
    """

    reference = "Levant 2009"

    L: Positive = Field(description="bound of the derivative after the last, |y^(n+1)| <= L, in y/time^(n+1), > 0")
    M: Positive | None = Field(
        default=None,
        description="bandwidth of the linear terms, per time, > 0; 2 L^(1/(n+1)) by default, for outputs of order one: "
        "else give about 2 (L/|y|)^(1/(n+1))",
    )
    discretisation: Explicit = Field(default="explicit", description="explicit (Euler) or proper (Taylor terms)")

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"L": 1.0}

    def design(self, form: DerivativeForm) -> dict[str, np.ndarray]:
        n = form.plant.n - 1
        M = 2 * self.L ** (1 / (n + 1)) if self.M is None else self.M
        linear, sliding = hybrid_gains(n, self.L, M)
        return {"linear": linear, "sliding": sliding}

    def advanced(self, s: Symbols, y: ca.SX, h: ca.SX, k: Symbols) -> Mapping[str, ca.SX]:
        w = hybrid_corrections(s.xhat[0] - y, k.linear, k.sliding)
        return {"xhat": drift(self.discretisation, s.xhat, h) - h * w}


def hybrid_gains(n: int, L: float, M: float) -> tuple[np.ndarray, np.ndarray]:
    """mu_(n-j) M and lambda_(n-j) L^(1/(n-j+1)), j = 0..n.

    Raises
    ------
    Problem
        When n is above 7, for which there are no coefficients.
    """
    if n >= len(MU):
        raise Problem(("type",), f"it has coefficients for up to {len(MU)} states; this plant has {n + 1}")
    order = range(n, -1, -1)
    return np.array([MU[m] * M for m in order]), np.array([LAMBDA[m] * L ** (1 / (m + 1)) for m in order])


def hybrid_corrections(w: ca.SX, linear: ca.SX, sliding: ca.SX) -> ca.SX:
    """w_1..w_(n+1) from w_0."""
    count, found = linear.numel(), []
    for j in range(count):
        p = count - 1 - j
        w = sliding[j] * ca.fabs(w) ** (p / (p + 1)) * ca.sign(w) + linear[j] * w
        found.append(w)
    return ca.vertcat(*found)
