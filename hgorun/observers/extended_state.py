"""What the extended-state observers of active disturbance rejection share: the chain without a model, and its input."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Name, Number
from hgorun.errors import Problem
from hgorun.observers.base import ContinuousObserver, Flow
from hgorun.observers.capabilities import Differentiator, Punctual
from hgorun.symbolic.derivatives import DerivativeCopy, DerivativeForm, derivative_form
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


class ExtendedState(Punctual, Differentiator, ContinuousObserver[DerivativeForm, DerivativeCopy]):
    """A chain of n integrators with b_0 u at its end, and one state more, sigma, for all else that acts there."""

    because = "without a model nothing brings the estimate to the present; extended has one"
    lacks = {"extend": "it estimates the unknown input already: sigma"}

    form = staticmethod(derivative_form)

    b_0: Number | dict[Name, Number] | None = Field(
        default=None,
        description="how the input enters y^(n), about: a number for one input, or {input: number}; 0 by default",
    )

    def states(self, form: DerivativeForm) -> Mapping[str, np.ndarray | Symmetric]:
        return {"sigma": np.zeros(1)}

    def of_inputs(self, form: DerivativeForm) -> np.ndarray:
        """b_0 of every input, shape (m,).

        Raises
        ------
        Problem
        """
        inputs = form.plant.inputs
        known = ", ".join(inputs) or "none"
        if self.b_0 is None:
            return np.zeros(len(inputs))
        if isinstance(self.b_0, dict):
            for name in self.b_0:
                if name not in inputs:
                    raise Problem(("b_0", name), f"unknown input; the plant has: {known}")
            return np.array([self.b_0.get(name, 0.0) for name in inputs])
        if len(inputs) != 1:
            raise Problem(("b_0",), f"one number is for one input: give {{input: number}}; the plant has: {known}")
        return np.array([self.b_0])

    def flow(self, plant: DerivativeCopy, s: Symbols, corrections: ca.SX, k: Symbols) -> Flow:
        """The chain with b_0 u and sigma at its end, less the corrections of its n + 1 equations."""
        driven = s.sigma + (ca.dot(k.b_0, plant.lower.u) if k.b_0.numel() else 0)
        rates = ca.vertcat(*ca.vertsplit(s.xhat)[1:], driven) - corrections[:-1]
        return Flow({"xhat": rates, "sigma": -corrections[-1]}, correction=corrections[0])
