"""Levant's differentiator."""

from __future__ import annotations

from typing import Any, Literal

import casadi as ca
import numpy as np
from pydantic import Field, ModelWrapValidatorHandler, model_validator

from hgorun.config.types import Positive
from hgorun.errors import Problem
from hgorun.observers.base import ContinuousObserver, Flow, Observer, Sample, SampledObserver, observer
from hgorun.observers.capabilities import NO_MODEL, Differentiator, SlidingMode, Switching
from hgorun.observers.roots import root, root_powers
from hgorun.symbolic.derivatives import DerivativeCopy, DerivativeForm, derivative_form
from hgorun.symbolic.symbols import Symbols

COEFFICIENTS = (1.1, 1.5, 2.0, 3.0, 5.0, 8.0)
_NEWTON_STEPS = 12


def levant_gains(n: int, G: float) -> np.ndarray:
    """lambda_(n-1-i) G^(1/(n-i)) for i = 0..n-1: the gain in the equation of z_i.

    Raises
    ------
    Problem
        When n is above 6, for which Levant gives no coefficients.
    """
    if n > len(COEFFICIENTS):
        raise Problem(
            ("type",),
            f"the differentiator has coefficients for up to {len(COEFFICIENTS)} states; this plant has {n}",
        )
    return np.array([COEFFICIENTS[n - 1 - i] * G ** (1 / (n - i)) for i in range(n)])


def levant_flow(z: ca.SX, error: ca.SX, gains: ca.SX) -> ca.SX:
    """z' of the differentiator: v_0, ..., v_(n-1), with error = z_0 - y.

    Levant writes v_i = z_(i+1) - k_i |z_i - v_(i-1)|^((n-1-i)/(n-i)) sign(z_i - v_(i-1)); the argument
    z_i - v_(i-1) is the correction d_(i-1) of the equation before. So all are powers of the error, and of its n-th
    root, d_i = c_i |error|^((n-1-i)/n) sign(error).
    """
    n = z.numel()
    sign, powers = ca.sign(error), root_powers(ca.fabs(error), n)
    d = [c * power * sign for c, power in zip(gains_of_powers(gains, n), powers, strict=True)]
    return ca.vertcat(*[(z[i + 1] if i + 1 < n else 0) - d[i] for i in range(n)])


def gains_of_powers(gains: ca.SX, n: int) -> list[ca.SX]:
    """Of the powers of the error, from the gains of the equations: c_0 = k_0, c_i = k_i c_(i-1)^((n-1-i)/(n-i))."""
    c = [gains[0]]
    for i in range(1, n):
        c.append(gains[i] * c[-1] ** ((n - 1 - i) / (n - i)))
    return c


class LevantDifferentiator(Differentiator, SlidingMode, Observer[DerivativeForm, DerivativeCopy]):
    """The keys and the gain that both discretisations share."""

    lacks = NO_MODEL

    reference = "Levant 2003; Meiners, Adamy 2025, section IV"
    form = staticmethod(derivative_form)

    G: Positive = Field(description="Lipschitz constant of the derivative y^(n-1), > 0")
    discretisation: Literal["explicit", "implicit"] = Field(
        default="explicit",
        description="explicit: by the solver; implicit: an implicit Euler step at each sample",
    )

    @model_validator(mode="wrap")
    @classmethod
    def _by_discretisation(
        cls, data: Any, check: ModelWrapValidatorHandler[LevantDifferentiator]
    ) -> LevantDifferentiator:
        """A block with ``discretisation: implicit`` is an observer of another kind: it jumps."""
        found = check(data)
        if found.discretisation == "explicit" or isinstance(found, SampledObserver):
            return found
        return ImplicitLevantObserver.model_construct(found.model_fields_set, **dict(found))

    def design(self, form: DerivativeForm) -> dict[str, np.ndarray]:
        return {"gains": levant_gains(form.plant.n, self.G)}

    @classmethod
    def example(cls, states: tuple[str, ...]) -> dict[str, object]:
        return {"G": 1.0}


@observer("levant")
class LevantObserver(Switching, LevantDifferentiator, ContinuousObserver[DerivativeForm, DerivativeCopy]):
    """Levant's arbitrary-order exact differentiator, for lower triangular plants with one output.

        z_0'     = v_0     = z_1 - k_0 |z_0 - y|^((n-1)/n) sign(z_0 - y)
        z_i'     = v_i     = z_(i+1) - k_i |z_i - v_(i-1)|^((n-1-i)/(n-i)) sign(z_i - v_(i-1))
        z_(n-1)' = v_(n-1) = -k_(n-1) sign(z_(n-1) - v_(n-2)),        k_i = lambda_(n-1-i) G^(1/(n-i))

    with lambda = 1.1, 1.5, 2, 3, 5, 8 from the last equation to the first, so n <= 6. G > 0 is a Lipschitz
    constant of y^(n-1), a bound on |y^(n)|: then z_i = y^(i) exactly after a finite time when there is no
    noise; a larger G amplifies noise, a smaller one loses the signal. There is no copy of the plant in it.
    The estimate is the state that belongs to these derivatives, Phi(z_0, z_1, ..., u, u', ...), which for a
    chain of integrators is z itself. ``initial`` gives z(0): the output's derivatives there, with the
    inputs at the start.

    ``discretisation: explicit`` integrates the equations by the solver; they are discontinuous, so take
    ``method: euler`` with a fixed step (the papers use 50 us) and expect chattering of the size k_(n-1)
    step. ``implicit`` makes one implicit Euler step at each sample after the first, where z(0) stands, with
    sign(0) = [-1, 1]: it does not chatter, whatever G and the period; it needs samples, and without noise z_i
    comes to rest on the i-th backward difference quotient of the output, which is y^(i) up to the order of
    the period.

    Meiners and Adamy print order 1 of it (n = 2), which is right.
    """

    def equations(self, plant: DerivativeCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        z, rates = s.xhat, levant_flow(s.xhat, e, k.gains)
        drift = z[1] if z.numel() > 1 else 0
        return Flow({"xhat": rates}, correction=drift - rates[0])


class ImplicitLevantObserver(LevantDifferentiator, SampledObserver[DerivativeForm, DerivativeCopy]):
    """Levant's differentiator with one implicit Euler step a sample; see :class:`LevantObserver`."""

    def jump(
        self, plant: DerivativeCopy, before: DerivativeCopy, s: Symbols, sample: Sample, k: Symbols
    ) -> dict[str, ca.SX]:
        return {"xhat": levant_implicit_step(s.xhat, sample.y, sample.interval, k.gains)}


def levant_implicit_step(z: ca.SX, y: ca.SX, h: ca.SX, gains: ca.SX) -> ca.SX:
    """z one implicit Euler step of length h later, y being the sample there.

    All corrections are powers of the new error, d_i = c_i |e|^((n-1-i)/n) sign(e). In the new error the step
    is e + sum_i h^(i+1) d_i(e) = b, where b is the error without corrections. With |e| = (h r)^n that is
    r^n + c_0 r^(n-1) + ... + c_(n-1) = |b|/h^n, which increases in r, or e = 0 and d_(n-1) = b/h^n where
    |b|/h^n <= c_(n-1). Newton's method from above falls to the root without crossing it.
    """
    return implicit_step(z, y, h, gains_of_powers(gains, z.numel()))


def implicit_step(z: ca.SX, y: ca.SX, h: ca.SX, c: list[ca.SX], newton_steps: int = _NEWTON_STEPS) -> ca.SX:
    """The same, from the gains c_i of the powers of the new error."""
    n = z.numel()
    powers = [h**j for j in range(n + 1)]
    b = sum((powers[j] * z[j] for j in range(1, n)), z[0]) - y
    size = ca.fabs(b) / powers[n]
    rest = ca.fmax(size - c[n - 1], 0)
    r = root(rest, n)  # above the root, as is each term's own bound
    for i in range(n - 1):
        r = ca.fmin(r, root(rest / c[i], n - 1 - i))
    for _ in range(newton_steps if n > 1 else 0):
        value, slope = ca.SX(1), ca.SX(0)
        for i in range(n):  # Horner, with the slope
            value, slope = value * r + (c[i] if i < n - 1 else -rest), slope * r + value
        r = ca.if_else(rest > 0, r - value / slope, 0)
    sign = ca.sign(b)
    d = [sign * c[i] * (h * r) ** (n - 1 - i) for i in range(n - 1)]
    d.append(sign * ca.fmin(size, c[n - 1]))
    new: list[ca.SX] = []
    following: ca.SX | int = 0
    for i in reversed(range(n)):
        following = z[i] + h * (following - d[i])
        new.insert(0, following)
    return ca.vertcat(*new)
