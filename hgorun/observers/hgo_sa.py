"""The high-gain observer of an integrator chain by stochastic approximation."""

from __future__ import annotations

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.expressions import ExpressionError, parse
from hgorun.config.types import ExpressionText, Positive
from hgorun.errors import Problem
from hgorun.observers.hgo_fd import ForwardDifferenceObserver, eigenvalues
from hgorun.registry import observer
from hgorun.symbolic.canonical import CanonicalForm

_FIRST = 100_000  # samples whose b(k) are all looked at; then powers of two
_LAST = 100  # 2^100 stands for infinity
_LOGARITHMS = 0.05  # of an exponent: factors log(k) make so little of it at 2^100


@observer("hgo_sa")
class StochasticApproximationObserver(ForwardDifferenceObserver):
    """High-gain observer of an integrator chain whose steps get shorter, so that white noise averages out.

    With q = D xhat, D = diag(1, eps, ..., eps^(n-1)),

        q(k+1) = q(k) + (a(k)/eps) (A_0 q(k) + H_0 y_k),    a(k) = alpha eps b(k),    A_0 = A - H_0 C

    The sample k + 1 comes a(k) after the sample k: a(k) is the time between samples, and the sampling has to
    be ``{steps: alpha*eps*b(k)}`` with the numbers of this block. The observer takes a(k) from the clock, so
    that a lost sample makes one longer step; alpha and b are what is checked before the run. An observer
    that stepped by alpha eps b(k) on samples of constant period would give xhat_2 times 1/b(k).

    The theorem asks, (A.2), that the sum of a(k) diverge and that of a(k)^2 converge: b falls like k^-p with
    1/2 < p <= 1. b is evaluated at k = 0 ... 1e5 and at powers of two up to 2^100, where p is read off;
    factors such as log(k), which decide at p = 1/2 and 1, are not told apart. 0 < b(k) <= 1 does not
    increase, so that I + alpha b(k) A_0 is stable for all k when it is for k = 0; for H_0 = (2, 2) when
    alpha b(0) < 1. That is (36), whose c must depend on k: its left side is of the order of alpha b(k).

    The error's variance falls like b(k); its rate over time stays that of the continuous observer, poles over
    eps. Against noise that is not white, or where samples come at a rate of their own, take a filtered
    observer (fhgo2). (21) of the paper prints b(k) < 1; its own example has b(0) = 1. The paper calls (44) an
    observer "for (41)", which is stepped by T: it is one for the plant stepped by a(k), (23).
    """

    reference = "Lee, Choi, Khalil 2016, (21)-(22), (36), (44)"

    alpha: Positive = Field(description="alpha > 0, with I + alpha b(0) A_0 stable")
    b: ExpressionText = Field(
        default="1/(1 + k/20000)",
        description="b(k), expression of k, in (0, 1], not increasing, falling like k^-p, 1/2 < p <= 1",
    )

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        first = self._check_steps()
        H_0 = self.H_0(form.plant.n)
        poles = eigenvalues(H_0)
        radius = np.max(np.abs(1 + self.alpha * first * poles))
        if not radius < 1 - 1e-12:  # roots are rounded
            largest = np.min(-2 * poles.real / np.abs(poles) ** 2) / first
            raise Problem(
                ("alpha",),
                f"I + alpha b(0) A_0 has spectral radius {radius:.6g}: the estimate would not stay bounded; "
                f"found alpha = {self.alpha:g}, expected less than {largest:.6g}",
            )
        return super().design(form)

    def _check_steps(self) -> float:
        """(A.2), as far as numbers tell; b(0)."""
        early, late = np.arange(_FIRST), 2.0 ** np.arange(np.ceil(np.log2(_FIRST)), _LAST + 1)
        k, b = np.concatenate([early, late]), np.concatenate([self._values(early), self._values(late)])
        outside = ~((b > 0) & (b <= 1))
        outside[_FIRST:] &= b[_FIRST:] != 0  # too small for a number: the sum says it better
        if outside.any():
            i = int(np.argmax(outside))
            raise Problem(("b",), f"b(k) must be in (0, 1], found b({k[i]:g}) = {b[i]:g}")
        rises = b[1:] > b[:-1] * (1 + 1e-12)
        if rises.any():
            i = int(np.argmax(rises))
            raise Problem(
                ("b",),
                f"b(k) must not increase, found b({k[i]:g}) = {b[i]:.6g}, b({k[i + 1]:g}) = {b[i + 1]:.6g}",
            )
        p = np.log2(b[-2] / b[-1]) if b[-1] > 0 else np.inf
        if p > 1 + _LOGARITHMS:
            falls = f"like k^-{p:.3g}" if np.isfinite(p) else "faster than any power"
            raise Problem(
                ("b",),
                f"b falls {falls}: the sum of the steps converges, and the estimate stops on its way (A.2); "
                "expected k^-p with 1/2 < p <= 1",
            )
        if p < 0.5 + 1e-6:
            falls = f"falls like k^-{p:.3g}" if p > 1e-6 else "does not fall"
            raise Problem(
                ("b",),
                f"b {falls}: the sum of the squared steps diverges, the noise does not average out (A.2); "
                "expected k^-p with 1/2 < p <= 1. The observer with a constant step is hgo_fd",
            )
        return float(b[0])

    def _values(self, numbers: np.ndarray) -> np.ndarray:
        k = ca.SX.sym("k")
        try:
            b = ca.Function("b", [k], [parse(self.b, names=("k",)).symbol({"k": k})])
        except ExpressionError as error:
            raise Problem(("b",), str(error)) from error
        return np.asarray(b(ca.DM(numbers[None, :])).full(), dtype=float).ravel()
