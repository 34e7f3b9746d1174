"""Any plant as it is, with the Jacobians that a linearisation along the estimate asks for."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.symbolic.forms import Bounds, saturate
from hgorun.symbolic.plant import PlantModel


@dataclass(frozen=True)
class SmoothForm:
    """A plant in its own coordinates, nothing asked of its structure."""

    plant: PlantModel

    @property
    def n(self) -> int:
        """Number of states."""
        return self.plant.n

    @cached_property
    def slopes(self) -> ca.Function:
        """(t, x, u, p) -> F = df/dx, shape (n, n), and H = dh/dx, shape (q, n)."""
        model = self.plant
        F, H = (ca.densify(ca.jacobian(of, model.x)) for of in (model.dynamics, model.output))
        return ca.Function("slopes", [model.t, model.x, model.u, model.p], [F, H])

    def saturable(self, canonical: bool) -> tuple[str, ...]:
        return self.plant.states

    def coordinates(self, canonical: bool) -> ca.SX:
        return self.plant.x

    def start(self, x: np.ndarray, parameters: np.ndarray, canonical: bool) -> np.ndarray:
        return x

    def again(self, at: np.ndarray, parameters: np.ndarray) -> SmoothForm:
        """Itself: numbers decide nothing."""
        return self

    def copy(self, t: ca.SX, u: ca.SX, p: ca.SX, canonical: bool, bounds: Bounds) -> SmoothCopy:
        return SmoothCopy(self, t, u, p, bounds)


@dataclass(frozen=True)
class SmoothCopy:
    """f, h, F and H at the (saturated) estimate, without the disturbance."""

    form: SmoothForm
    t: ca.SX
    u: ca.SX
    p: ca.SX
    bounds: Bounds = field(default_factory=dict)

    def copy(self, xhat: ca.SX) -> ca.SX:
        """The plant's vector field."""
        return self.form.plant.f(self.t, self._saturated(xhat), self.u, self.p)

    def F(self, xhat: ca.SX) -> ca.SX:
        """df/dx, shape (n, n)."""
        return self.form.slopes(self.t, self._saturated(xhat), self.u, self.p)[0]

    def H(self, xhat: ca.SX) -> ca.SX:
        """dh/dx, shape (q, n)."""
        return self.form.slopes(self.t, self._saturated(xhat), self.u, self.p)[1]

    def output(self, xhat: ca.SX) -> ca.SX:
        """h(xhat)."""
        return self.form.plant.h(self.t, xhat, self.u, self.p)

    def state(self, xhat: ca.SX) -> ca.SX:
        """The estimate itself."""
        return xhat

    def _saturated(self, x: ca.SX) -> ca.SX:
        return saturate(x, self.form.plant.states, self.bounds)


def smooth_form(plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> SmoothForm:
    """Any plant."""
    return SmoothForm(plant)
