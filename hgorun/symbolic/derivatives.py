"""Lower triangular plants seen through the derivatives of their output, as a differentiator sees them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.symbolic import evaluate
from hgorun.symbolic.forms import Bounds
from hgorun.symbolic.lower_triangular import LowerTriangularCopy, LowerTriangularForm, lower_triangular_form
from hgorun.symbolic.parameters import flat
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.reconstruction import output_derivatives


@dataclass(frozen=True)
class DerivativeForm:
    """A lower triangular plant seen through the derivatives of its output, z = (y, y', ..., y^(n-1))."""

    lower: LowerTriangularForm

    @cached_property
    def _derivatives(self) -> ca.Function:
        return output_derivatives(self.lower.model)

    @property
    def plant(self) -> PlantModel:
        """The plant."""
        return self.lower.plant

    def again(self, at: np.ndarray, parameters: np.ndarray) -> DerivativeForm | None:
        """The form with other numbers, where they lead to the same equations."""
        lower = self.lower.again(at, parameters)
        if lower is None:
            return None
        form = replace(self, lower=lower)
        form.__dict__["_derivatives"] = self._derivatives
        return form

    @property
    def guess(self) -> np.ndarray | None:
        """Where Newton's method starts, in the coordinates of the lower triangular model."""
        return self.lower.points[0] if self.lower.guesses else None

    def saturable(self, canonical: bool) -> tuple[str, ...]:
        """A differentiator has no copy of the plant whose arguments could be saturated."""
        return ()

    def coordinates(self, canonical: bool) -> ca.SX:
        """The derivatives of the output at x with the inputs at zero."""
        model = self.lower.model
        still = ca.SX.zeros(model.u.numel(), model.n)
        return output_derivatives(model)(model.t, self.lower.coordinates(canonical), still, model.p)

    def start(self, x: np.ndarray, parameters: np.ndarray, canonical: bool) -> np.ndarray:
        """The derivatives of the output at x with the inputs at zero and t = 0."""
        model = self.lower.model
        return self.start_driven(x, parameters, canonical, np.zeros((model.u.numel(), model.n)))

    def start_driven(
        self, x: np.ndarray, parameters: np.ndarray, canonical: bool, inputs: evaluate.Floats
    ) -> np.ndarray:
        """The derivatives of the output at x with these inputs and t = 0; NaN where they depend on inputs of NaN."""
        at = self.lower.start(x, parameters, canonical)
        (z,) = evaluate.at(self._derivatives, 0.0, at, flat(inputs), parameters)
        if not (np.all(np.isfinite(z)) or np.any(np.isnan(inputs))):
            raise ValueError("the derivatives of the output are not finite at the initial estimate")
        return z

    def copy(self, t: ca.SX, u: ca.SX, p: ca.SX, canonical: bool, bounds: Bounds) -> DerivativeCopy:
        return DerivativeCopy(self, self.lower.copy(t, u, p, canonical, bounds))


@dataclass(frozen=True)
class DerivativeCopy:
    """What a differentiator knows of the plant: the way from derivatives to the state."""

    form: DerivativeForm
    lower: LowerTriangularCopy
    guess: ca.SX | None = None

    def started_at(self, guess: ca.SX) -> DerivativeCopy:
        """The same, with another start of Newton's method."""
        return replace(self, guess=guess)

    def state(self, z: ca.SX) -> ca.SX:
        """The estimate in the plant's coordinates, Phi(z, u, u', ...)."""
        guess = ca.DM(self.form.lower.points[0]) if self.guess is None else self.guess
        return self.lower.state(self.lower.reconstruct(z, guess, damped=True))

    def output(self, z: ca.SX) -> ca.SX:
        """y, shape (1,)."""
        return z[0]


def derivative_form(plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> DerivativeForm:
    """The derivatives of the output as coordinates of a lower triangular plant.

    Raises
    ------
    NotObservableForm
    """
    return DerivativeForm(lower_triangular_form(plant, at, parameters))
