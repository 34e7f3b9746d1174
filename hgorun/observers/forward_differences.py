"""What the observers of integrator chains by forward differences share: the plants, the gain, the step."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Number, Poles, Positive
from hgorun.errors import NotObservableForm, Problem
from hgorun.observers.base import PeriodLimit, Sample, SampledObserver
from hgorun.observers.capabilities import Differentiator
from hgorun.observers.constant_gain import PlacedGain
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.matrices import A, C
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.symbols import Symbols


class IntegratorChainForm(CanonicalForm):
    """x_i' = x_(i+1), x_n' = phi(t, x, u), y = x_1: nothing but the order matters to the observer."""

    def saturable(self, canonical: bool) -> tuple[str, ...]:
        return ()


def integrator_chain(plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> IntegratorChainForm:
    """A plant that is a chain of integrators as it is written, Lee, Choi, Khalil 2016, (12)-(14).

    Raises
    ------
    NotObservableForm
        When the output is not the first state, or a state before the last has another derivative than the
        state that follows it.
    """
    x, names = plant.x, plant.states
    if plant.measured != (0,):
        raise NotObservableForm(
            f"this observer differentiates one output that is the first state, {names[0]}; "
            f"here the output is {', '.join(str(plant.output[i]) for i in range(len(plant.outputs)))}"
        )
    for i in range(plant.n - 1):
        if not ca.simplify(plant.dynamics[i] - x[i + 1]).is_zero():
            raise NotObservableForm(
                "this observer has no copy of the plant: it needs a chain of integrators, "
                f"{names[i]}' = {names[i + 1]} alone, but here {names[i]}' = {plant.dynamics[i]}; "
                "use shgo for other models"
            )
    return IntegratorChainForm(plant, (plant.n,), x, ca.SX.eye(plant.n), identity=True)


class ForwardDifferences(Differentiator, PlacedGain, SampledObserver):
    """One Euler step a sample of the high-gain observer of a chain; its time scale is eps."""

    form = staticmethod(integrator_chain)

    poles: Poles = Field(default=complex(-1), description="eigenvalues of A_0: a number (for all) or a list of n")
    gains: tuple[Number, ...] | None = Field(default=None, description="H_0, n numbers, instead of poles")
    eps: Positive = Field(description="eps > 0: the error's eigenvalues are the poles over eps")

    def H_0(self, n: int) -> np.ndarray:
        """The gain of a chain of n integrators, shape (n,); it makes A_0 Hurwitz."""
        H_0 = self.gain(n)
        worst = max(eigenvalues(H_0), key=lambda value: float(value.real))
        if not worst.real < 0:
            raise Problem(
                ("gains",), f"s^n + h_1 s^(n-1) + ... + h_n must be Hurwitz, found a root at {worst:.4g} (17)"
            )
        return H_0

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"eps": np.array(self.eps), "H_0": self.H_0(form.plant.n)}

    def jump(
        self,
        plant: PlantCopy,
        before: PlantCopy,
        s: Symbols,
        sample: Sample,
        k: Symbols,
    ) -> Mapping[str, ca.SX]:
        D, inv_D = plant.inv_Delta(k.eps), plant.inv_Delta(1 / k.eps)  # Delta^-1(eps) = diag(1, eps, ...)
        A_0 = A(plant.n) - k.H_0 @ C(plant.n)
        q = D @ s.xhat
        q += sample.interval / k.eps * (A_0 @ q + k.H_0 * sample.previous)
        return {"xhat": inv_D @ q}

    def longest_period(self, form: CanonicalForm) -> PeriodLimit:
        poles = eigenvalues(self.H_0(form.plant.n))
        value = self.eps * float(np.min(-2 * poles.real / np.abs(poles) ** 2))
        return PeriodLimit(value, "spectral radius of I + (T/eps) A_0")

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"eps": 0.5}


def eigenvalues(H_0: np.ndarray) -> np.ndarray:
    """Of A_0 = A - H_0 C, shape (n,)."""
    return np.roots([1.0, *H_0])
