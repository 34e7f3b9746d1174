"""The filtering differentiator."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Positive
from hgorun.errors import Problem
from hgorun.observers.base import Role, observer
from hgorun.observers.capabilities import SlidingMode, Switching
from hgorun.observers.red import LAMBDA, Explicit, drift, nonrecursive
from hgorun.observers.roots import signed_powers
from hgorun.observers.stepped_differentiator import SteppedDifferentiator
from hgorun.symbolic.derivatives import DerivativeForm
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


@observer("filtering")
class FilteringDifferentiator(SlidingMode, Switching, SteppedDifferentiator):
    """Levant's and Livne's filtering differentiator, for lower triangular plants with one output.

    The exact differentiator (``red``) of order n_d behind n_f integrators of its error, which average noise of high
    frequency. With N = n_d + n_f <= 12, the coefficients lt_0..lt_N of ``red`` at order N, and |w|^a short for |w|^a
    sign(w),

        w_i' = w_(i+1) - lt_(N+1-i) L^(i/(N+1)) |w_1|^((N+1-i)/(N+1)),    i = 1..n_f,    w_(n_f+1) = z_0 - y
        z_j' = z_(j+1) - lt_(n_d-j) L^((n_f+1+j)/(N+1)) |w_1|^((n_d-j)/(N+1)),    j = 0..n_d

    L > 0 bounds |y^(n_d+1)|. n_f = 0 is ``red``; with all powers 1 it would be the filtered high-gain observer
    ``fhgo2``, r = n_f. Noise of the frequency omega leaves errors of the order omega^(-n_f (n_d+1-j)/(N+1)) in z_j,
    instead of its own amplitude: where there is no noise, or noise of low frequency, n_f lengthens the transient and
    gains nothing. n_d is n - 1 for n states, or more, whose last derivatives are not shown (internal state ``more``).

    It is a recursion of samples as ``red`` is, by Euler steps (``discretisation: explicit``), or with the Taylor terms
    of the chain for z (``proper``); what uses the sample y_k is the estimate of t_(k+1). A continuous output is
    measured at the ends of the solver's steps. Late outputs are refused: a relay with a delay ends in a limit cycle.
    Choose it over ``red`` where the sampling is fast and the noise is large and of high frequency.

    The form is that of the authors' public code.
    """

    reference = "Levant, Livne 2020"

    L: Positive = Field(description="bound of the derivative after the last, |y^(n_d+1)| <= L, in y/time^(n_d+1), > 0")
    n_d: int | None = Field(
        default=None, ge=0, le=12, strict=True, description="order of differentiation, n - 1 (the default) or more"
    )
    n_f: int = Field(default=1, ge=0, le=12, strict=True, description="order of the filter, >= 0; n_d + n_f <= 12")
    discretisation: Explicit = Field(default="explicit", description="explicit (Euler) or proper (Taylor terms)")

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"L": 1.0}

    def _order(self, form: DerivativeForm) -> int:
        """n_d.

        Raises
        ------
        Problem
        """
        n = form.plant.n
        n_d = n - 1 if self.n_d is None else self.n_d
        if n_d < n - 1:
            raise Problem(("n_d",), f"{n} states take derivatives up to {n - 1}: expected that order or more")
        if n_d + self.n_f >= len(LAMBDA):
            key = ("n_f",) if self.n_f else ("type",)
            found = f"n_d = {n_d}, n_f = {self.n_f}"
            raise Problem(key, f"it has coefficients for n_d + n_f up to {len(LAMBDA) - 1}; found {found}")
        return n_d

    def design(self, form: DerivativeForm) -> dict[str, np.ndarray]:
        return {"a": filtering_gains(self._order(form), self.n_f, self.L)}

    def states(self, form: DerivativeForm) -> Mapping[str, np.ndarray | Symmetric]:
        own = {"w": np.zeros(self.n_f), "more": np.zeros(self._order(form) + 1 - form.plant.n)}
        return {**super().states(form), **{name: value for name, value in own.items() if value.size}}

    def roles(self, form: DerivativeForm) -> dict[str, Role]:
        return {name: "signal" if name == "more" else role for name, role in super().roles(form).items()}

    def advanced(self, s: Symbols, y: ca.SX, h: ca.SX, k: Symbols) -> Mapping[str, ca.SX]:
        n, n_f, known = s.xhat.numel(), self.n_f, vars(s)
        z = ca.vertcat(s.xhat, known.get("more", ca.SX(0, 1)))
        w = ca.vertcat(known["w"] if n_f else ca.SX(0, 1), z[0] - y)
        corrections = k.a * signed_powers(w[0], k.a.numel())
        z = drift(self.discretisation, z, h) - h * corrections[n_f:]
        new = {"xhat": z[:n]}
        if z.numel() > n:
            new["more"] = z[n:]
        if n_f:
            new["w"] = known["w"] + h * (w[1:] - corrections[:n_f])
        return new


def filtering_gains(n_d: int, n_f: int, L: float) -> np.ndarray:
    """Of w_1..w_(n_f), then of z_0..z_(n_d): lt_(N+1-i) L^(i/(N+1)), and lt_(n_d-j) L^((n_f+1+j)/(N+1))."""
    N = n_d + n_f
    lt = nonrecursive(N)
    return np.array([lt[N - m] * L ** ((m + 1) / (N + 1)) for m in range(N + 1)])
