"""The robust exact differentiator, in three discretisations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Positive
from hgorun.errors import Problem
from hgorun.observers.base import Role, observer
from hgorun.observers.capabilities import SlidingMode, Switching
from hgorun.observers.levant import implicit_step
from hgorun.observers.roots import signed_powers
from hgorun.observers.sample_times import EvenSamples
from hgorun.observers.stepped_differentiator import SteppedDifferentiator
from hgorun.symbolic.derivatives import DerivativeForm
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols

LAMBDA = (1.1, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 12.0, 14.0, 17.0, 20.0, 26.0, 32.0)
_NEWTON_STEPS = 5, 6  # up to two derivatives and beyond: after them the root is right to rounding, whatever the numbers
Explicit = Literal["proper", "explicit"]
Discretisation = Literal["implicit"] | Explicit


@observer("red")
class RobustExactDifferentiator(EvenSamples, SlidingMode, Switching, SteppedDifferentiator):
    """Levant's robust exact differentiator as a recursion of samples, for lower triangular plants with one output.

    Of order n, for n + 1 states and n derivatives, n <= 12. With s = z_0 - y, and |s|^a short for |s|^a sign(s),

        z_j' = z_(j+1) - a_j |s|^((n-j)/(n+1)),  j < n,      z_n' = -a_n sign(s)
        a_j = lt_(n-j) L^((j+1)/(n+1)),    lt_n = lambda_n,  lt_j = lambda_j lt_(j+1)^(j/(j+1))
        lambda_0.. = 1.1, 1.5, 2, 3, 5, 7, 10, 12, 14, 17, 20, 26, 32

    L > 0 is a bound of |y^(n+1)|: then z_j = y^(j) after a finite time. It is the non-recursive form of ``levant``,
    whose G is this L, but for lambda_5, which is 8 there. A step takes h, the time between samples:

        explicit   z+ = (I + h A) z - h (a_0 |s|^(n/(n+1)), ..., a_n sign(s))    s of z and y at t_k, z+ for t_(k+1)
        proper     z+ = e^(A h) z - h (...)                                       likewise
        implicit   z+ = z + h A z+ - h (...),  s of z+ and y at t_(k+1), sign(0) = [-1, 1]

    The implicit equation is solved exactly. With b = z_0 + h z_1 + ... + h^n z_n - y it has s = 0 where |b| is at most
    h^(n+1) a_n; else |s| = r^(n+1) with r > 0 the root of r^(n+1) + sum_j h^(j+1) a_j r^(n-j) = |b|, which Newton's
    method approaches from above. It does not chatter, and in sliding z_j is the backward difference quotient
    nabla^j y/h^j. So what is shown is M z: row j of M holds the coefficients of (-ln(1-x))^j, times h^(i-j), which adds
    h z_2/2 to z_1 and so on. Then, on even samples, polynomials of degree n are exact after a finite time, without
    noise, and errors of y^(j) are of the order h^(n+1-j), as those of ``proper``; ``explicit`` lags by h y''/2. On
    uneven ones (jitter, lost samples, times of their own) z_1 = nabla y/h still is a quotient over the last step, but
    z_j, j >= 2, and what M adds to the others are off by a part of y^(j) that is of the order of the unevenness of h;
    a remark says so for n >= 2.

    Choose it if there is no model, and a bound of the highest derivative is known; take ``implicit``, the default,
    unless you want to repeat published numbers. It treats noise as signal: ``filtering`` averages noise of high
    frequency, and an observer that knows the plant needs less bandwidth. Late outputs are refused: a relay with a
    delay d ends in a limit cycle of the size L d^(n+1-j) in z_j. A continuous output is measured at the ends of the
    solver's steps. With ``substeps: m`` every step is m steps of h/m with the same sample. The estimate is the state
    that belongs to the derivatives, as for ``levant``, and ``initial`` gives them at the start, with the inputs
    there.

    The coefficients are those in public code, the recursion for lt reproduces its tables; the implicit step and M are
    derived here.
    """

    reference = "Levant 2003; coefficients as in public code of the differentiation toolboxes"

    L: Positive = Field(description="bound of the derivative after the last, |y^(n+1)| <= L, in y/time^(n+1), > 0")
    discretisation: Discretisation = Field(
        default="implicit", description="implicit, proper (Taylor terms of the chain) or explicit (Euler)"
    )
    substeps: int = Field(default=1, ge=1, le=50, strict=True, description="steps of the recursion a sample, >= 1")

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"L": 1.0}

    @property
    def implicit(self) -> bool:
        return self.discretisation == "implicit"

    @property
    def even_only(self) -> bool:
        return self.implicit

    @property
    def switches(self) -> bool:
        return not self.implicit

    def design(self, form: DerivativeForm) -> dict[str, np.ndarray]:
        return {"a": red_gains(form.plant.n - 1, self.L)}

    def states(self, form: DerivativeForm) -> Mapping[str, np.ndarray | Symmetric]:
        clock = super().states(form)
        return {**clock, "period": np.zeros(1)} if self.implicit else clock

    def roles(self, form: DerivativeForm) -> dict[str, Role]:
        return {**super().roles(form), "period": "gain"} if self.implicit else super().roles(form)

    def estimate(self, s: Symbols, k: Symbols) -> ca.SX:
        return quotients_to_derivatives(s.xhat, s.period / self.substeps) if self.implicit else s.xhat

    def advanced(self, s: Symbols, y: ca.SX, h: ca.SX, k: Symbols) -> Mapping[str, ca.SX]:
        z = s.xhat
        for _ in range(self.substeps):
            z = self._step(z, y, h / self.substeps, k.a)
        return {"xhat": z, "period": h} if self.implicit else {"xhat": z}

    def _step(self, z: ca.SX, y: ca.SX, h: ca.SX, a: ca.SX) -> ca.SX:
        if self.implicit:
            return implicit_step(z, y, h, [a[j] for j in range(z.numel())], _NEWTON_STEPS[z.numel() > 3])
        return drift(self.discretisation, z, h) - h * (a * signed_powers(z[0] - y, z.numel()))


def red_gains(n: int, L: float) -> np.ndarray:
    """a_0..a_n.

    Raises
    ------
    Problem
        When n is above 12, for which there are no coefficients.
    """
    if n >= len(LAMBDA):
        raise Problem(("type",), f"it has coefficients for up to {len(LAMBDA)} states; this plant has {n + 1}")
    lt = nonrecursive(n)
    return np.array([lt[n - j] * L ** ((j + 1) / (n + 1)) for j in range(n + 1)])


def nonrecursive(n: int) -> list[float]:
    """lt_0..lt_n, from lambda."""
    lt = [LAMBDA[n]]
    for j in reversed(range(n)):
        lt.insert(0, LAMBDA[j] * lt[0] ** (j / (j + 1)))
    return lt


def drift(discretisation: Discretisation, z: ca.SX, h: ca.SX) -> ca.SX:
    """The chain of integrators a step later, without corrections."""
    return taylor(z, h) if discretisation == "proper" else euler(z, h)


def euler(z: ca.SX, h: ca.SX) -> ca.SX:
    """(I + h A) z."""
    return ca.vertcat(*[z[j] + h * z[j + 1] for j in range(z.numel() - 1)], z[-1])


def taylor(z: ca.SX, h: ca.SX) -> ca.SX:
    """e^(A h) z, by Horner's scheme."""
    n, rows = z.numel(), []
    for j in range(n):
        value = z[-1]
        for i in reversed(range(1, n - j)):
            value = z[j + i - 1] + h / i * value
        rows.append(value)
    return ca.vertcat(*rows)


def quotients_to_derivatives(z: ca.SX, h: ca.SX) -> ca.SX:
    """M z: derivatives from backward difference quotients z_j = nabla^j y/h^j, up to the last that there is."""
    n = z.numel()
    logarithm = np.append(0.0, 1 / np.arange(1, n))  # -ln(1-x) = x + x^2/2 + x^3/3 + ...
    row, rows = np.eye(1, n)[0], []
    for j in range(n):
        value = ca.SX(0)
        for i in reversed(range(j, n)):
            value = row[i] * z[i] + h * value
        rows.append(value)
        row = np.convolve(row, logarithm)[:n]
    return ca.vertcat(*rows)
