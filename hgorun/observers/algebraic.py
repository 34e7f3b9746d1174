"""The algebraic differentiator."""

from __future__ import annotations

from collections.abc import Mapping
from math import comb, exp, factorial, lgamma, prod

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import NonNegative
from hgorun.errors import Problem
from hgorun.observers.base import Arrival, observer
from hgorun.observers.capabilities import NO_MODEL, Differentiator
from hgorun.observers.last_samples import LastSamples
from hgorun.observers.least_squares import TINY, projections
from hgorun.observers.stepped import SteppedObserver
from hgorun.symbolic.derivatives import DerivativeCopy, DerivativeForm, derivative_form
from hgorun.symbolic.symbols import Symbols


@observer("algebraic")
class AlgebraicDifferentiator(Differentiator, LastSamples, SteppedObserver[DerivativeForm, DerivativeCopy]):
    """Algebraic differentiator of Mboup, Join and Fliess, for lower triangular plants with one output.

    Each derivative is an integral over the last samples, ``window`` of them, which span the time T:

        z_i(t) = T^-i int_0^1 K_i(tau) y(t - T tau) dtau,    i = 0 .. n-1
        K_i    = d^i/dtau^i [tau^(kappa+i) (1-tau)^(mu+i)] / B(kappa+i+1, mu+i+1)

    which is the mean of y^(i), weighted by the kernel in brackets. So it is exact for polynomials of degree i, and for
    degree i + 1 it is y^(i) at the delay T (kappa+i+1)/(kappa+mu+2i+2): for kappa = mu it is T/2, whatever i. By
    default kappa = mu = i. Larger numbers smooth more within the same window. The integral is a sum with the weights w
    of the trapezoidal rule; of all weights that are exact for degree i, those that are nearest to them are taken, w +
    V^T (V V^T)^-1 (target - V w), V holding the powers of the samples' times. Where samples are at uneven times, or
    late, the weights are those of their times.

    The first samples are a shorter window; before there are as many as states z is what it is at ``initial``, with
    the inputs at the start. The estimate is the state that belongs to z, as for ``levant``, held until the next
    sample. White noise of the standard deviation s leaves s |w| in z_i. It lags by about T/2, and lateness of the
    samples adds to that. A continuous output is measured at the ends of the solver's steps. Choose it where a known
    lag is no harm and the noise is large; ``savgol`` of a higher degree has no lag, and more noise in the same
    window.

    The kernel is derived again, its minimal form is that of the publication; the correction of the sampled
    weights is our own.
    """

    reference = "Mboup, Join, Fliess 2009"
    form = staticmethod(derivative_form)
    lacks = NO_MODEL

    window: int = Field(ge=2, le=501, strict=True, description="number of samples, n or more")
    kappa: NonNegative | None = Field(
        default=None, description="of the kernel, >= 0; by default the order of the derivative"
    )
    mu: NonNegative | None = Field(
        default=None, description="of the kernel, >= 0; by default the order of the derivative"
    )

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"window": 2 * len(states) + 1}

    def design(self, form: DerivativeForm) -> dict[str, np.ndarray]:
        n = form.plant.n
        if self.window < n:
            raise Problem(("window",), f"{n} states take derivatives up to {n - 1}, and these take {n} samples or more")
        orders = np.arange(n, dtype=float)
        kappa, mu = (orders if one is None else np.full(n, one) for one in (self.kappa, self.mu))
        factors = np.zeros((n, n))
        for i in range(n):
            factors[i, : i + 1] = kernel_coefficients(i, kappa[i], mu[i])
        return {"kappa": kappa, "mu": mu, "factors": factors}

    def _ends(self, i: int, tau: ca.SX, k: Symbols) -> ca.SX:
        """tau^kappa (1-tau)^mu."""
        first = power(tau, i) if self.kappa is None else tau ** k.kappa[i]
        return first * (power(1 - tau, i) if self.mu is None else (1 - tau) ** k.mu[i])

    def correct(self, plant: DerivativeCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        y, age, there = self.with_newest(s, arrival)
        T = ca.fmax(ca.mmax(there * age), TINY)
        tau = there * age / T
        weights, z = trapezoid(tau, there), []
        powers = projections([there * (-tau) ** j for j in range(s.xhat.numel())], there * y)
        for i, part in enumerate(powers):
            exact = factorial(i) * part.size / part.slopes[0]  # i! times the highest coefficient of the fit
            w = weights * self._ends(i, tau, k) * kernel(i, tau, k.factors[i, :])
            z.append((exact + ca.dot(w, part.left)) / T**i)
            determined = part.independent
        return {"xhat": ca.if_else(determined, ca.vertcat(*z), s.xhat), "y": y, "age": age, "there": there}


def kernel_coefficients(i: int, kappa: float, mu: float) -> np.ndarray:
    """c_0..c_i of K_i = tau^kappa (1-tau)^mu sum_j c_j tau^(i-j) (1-tau)^j, by Leibniz's rule."""
    inverse_beta = exp(lgamma(kappa + mu + 2 * i + 2) - lgamma(kappa + i + 1) - lgamma(mu + i + 1))
    terms = [comb(i, j) * falling(kappa + i, j) * (-1) ** (i - j) * falling(mu + i, i - j) for j in range(i + 1)]
    return inverse_beta * np.array(terms)


def falling(a: float, count: int) -> float:
    """a (a-1) ... (a-count+1)."""
    return prod(a - j for j in range(count))


def kernel(i: int, tau: ca.SX, c: ca.SX) -> ca.SX:
    """sum_j c_j tau^(i-j) (1-tau)^j at every sample."""
    terms = [c[j] * power(tau, i - j) * power(1 - tau, j) for j in range(i + 1)]
    return sum(terms[1:], terms[0])


def power(base: ca.SX, exponent: int) -> ca.SX:
    """By multiplication, which is faster."""
    found = ca.SX.ones(base.shape)
    for _ in range(exponent):
        found = found * base
    return found


def trapezoid(tau: ca.SX, there: ca.SX) -> ca.SX:
    """Weights of the samples in an integral over tau, 0 for those that are not there."""
    half = (tau[1:] - tau[:-1]) * there[1:] / 2
    return ca.vertcat(half, 0) + ca.vertcat(0, half)
