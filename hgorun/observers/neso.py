"""Han's nonlinear extended-state observer."""

from __future__ import annotations

from collections.abc import Mapping
from math import comb

import casadi as ca
import numpy as np
from pydantic import Field, model_validator

from hgorun.config.types import Name, Positive
from hgorun.errors import Problem
from hgorun.observers.base import Flow, observer
from hgorun.observers.capabilities import LocallyLinear, Speed
from hgorun.observers.extended_state import ExtendedState
from hgorun.observers.threshold import NoiseThreshold
from hgorun.symbolic.derivatives import DerivativeCopy, DerivativeForm
from hgorun.symbolic.symbols import Symbols


@observer("neso")
class NonlinearExtendedStateObserver(Speed, NoiseThreshold, LocallyLinear, ExtendedState):
    """Han's nonlinear extended-state observer, for lower triangular plants with one output.

    The linear one, ``eso``, with powers of the innovation e = z_1 - y below 1 in its corrections, so that small errors
    are corrected more, and large ones less:

        z_i'   = z_(i+1) - beta_i fal(e, alpha_i, delta),    i < n
        z_n'   = sigma + b_0 u - beta_n fal(e, alpha_n, delta)
        sigma' = -beta_(n+1) fal(e, alpha_(n+1), delta)
        fal    = e/delta^(1-alpha) for |e| <= delta, else |e|^alpha sign(e)

    alpha_i in (0, 1], by default 1, 1/2, 1/4, ..., so that the first correction is linear. For |e| <= delta, and
    where all alpha are 1, it is ``eso`` with the gains beta_i delta^(alpha_i-1), whose eigenvalues ``fastest_rate``
    and ``analyze`` give. delta in the units of the output has to exceed the noise, by default by the factor 1.5:
    below it the slope of fal is largest. beta_i > 0 are given, or ``omega_o``, with which beta_i = binom(n+1, i)
    omega_o^i. That small errors decay does not follow from either, and a remark says where they do not; for larger
    errors there is no proof here.

    Choose it over ``eso`` if the initial error is large and the noise is known; its gains have to be tuned for the
    size of the errors, since e is in the units of the output. Samples come through the common innovation. Late
    outputs are refused, as by ``eso``, and the estimate is the state that belongs to the derivatives z.

    The form is quoted from memory of the publications; beta from omega_o is our own choice.
    """

    reference = "Han 2009"

    omega_o: Positive | None = Field(
        default=None, description="in place of beta: beta_i = binom(n+1, i) omega_o^i, per time, > 0"
    )
    beta: tuple[Positive, ...] | None = Field(default=None, description="n + 1 gains > 0")
    alpha: tuple[Positive, ...] | None = Field(
        default=None, description="n + 1 powers in (0, 1]; 1, 1/2, 1/4, ... by default"
    )
    delta: Positive | dict[Name, Positive] | None = Field(
        default=None,
        description="innovation up to which corrections are linear, in the units of the output, > 0; 1.5 times the "
        "amplitude of the noise by default",
    )

    @model_validator(mode="after")
    def _one_of_omega_o_and_beta(self) -> NonlinearExtendedStateObserver:
        if (self.omega_o is None) == (self.beta is None):
            raise ValueError("give either omega_o or beta")
        if self.alpha is not None and max(self.alpha, default=0.0) > 1:
            raise Problem(("alpha",), f"expected powers in (0, 1], found {max(self.alpha):g}")
        return self

    @property
    def speed_key(self) -> str | None:
        return None if self.omega_o is None else "omega_o"

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"omega_o": 4.0, "delta": 0.5}

    def design(self, form: DerivativeForm) -> dict[str, np.ndarray]:
        (delta,) = self.threshold(form, "delta", self.delta)
        beta, alpha = self._gains(form)
        if np.all(np.isfinite(beta)) and not np.all(np.isfinite(beta * float(delta) ** (alpha - 1))):
            raise Problem(("delta",), f"{float(delta):g} is too small: the slopes beta delta^(alpha-1) overflow")
        return {"beta": beta, "alpha": alpha, "delta": np.array(delta), "b_0": self.of_inputs(form)}

    def remarks(self, form: DerivativeForm) -> tuple[str, ...]:
        (delta,) = self.threshold(form, "delta", self.delta)
        beta, alpha = self._gains(form)
        if np.all(_poles(beta, alpha, float(delta)).real < 0):
            return ()
        slopes = ", ".join(f"{one:.4g}" for one in beta * delta ** (alpha - 1))
        return (f"small errors grow: for |e| <= {delta:g} its gains are {slopes}, whose poles are not all stable",)

    def _gains(self, form: DerivativeForm) -> tuple[np.ndarray, np.ndarray]:
        """beta and alpha, shapes (n + 1,).

        Raises
        ------
        Problem
        """
        order = form.plant.n + 1
        for key, given in (("beta", self.beta), ("alpha", self.alpha)):
            if given is not None and len(given) != order:
                raise Problem((key,), f"expected {order} numbers, one an equation; found {len(given)}")
        powers = np.arange(1, order + 1)
        alpha = 0.5 ** (powers - 1.0) if self.alpha is None else np.array(self.alpha)
        if self.omega_o is None:
            return np.array(self.beta), alpha
        return np.array([comb(order, i) * self.omega_o**i for i in powers]), alpha

    @property
    def nonlinear(self) -> str | None:
        if self.alpha is not None and min(self.alpha) == 1:
            return None
        return "the corrections are powers of the innovation while |e| > delta"

    def beyond(self, plant: DerivativeCopy, s: Symbols, e: ca.SX, k: Symbols) -> ca.SX:
        return ca.fabs(e) > k.delta

    def equations(self, plant: DerivativeCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        size = ca.fmax(ca.fabs(e), k.delta)
        fal = e * size ** (k.alpha - 1) if self.alpha is not None else e / size * halved_powers(size, k.alpha.numel())
        return self.flow(plant, s, k.beta * fal, k)

    def fastest_rate(self, form: DerivativeForm) -> float:
        """That of small errors, where the slope of fal is largest."""
        (delta,) = self.threshold(form, "delta", self.delta)
        return float(np.max(np.abs(_poles(*self._gains(form), float(delta)))))


def halved_powers(size: ca.SX, count: int) -> ca.SX:
    """size, size^(1/2), size^(1/4), ...: the powers that are taken by default, as roots, which are faster."""
    found = [size]
    for _ in range(count - 1):
        found.append(ca.sqrt(found[-1]))
    return ca.vertcat(*found)


def _poles(beta: np.ndarray, alpha: np.ndarray, delta: float) -> np.ndarray:
    """Eigenvalues of small errors."""
    return np.asarray(np.roots([1.0, *(beta * delta ** (alpha - 1))]))
