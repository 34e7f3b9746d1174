"""Any plant as it is, nothing asked of its structure."""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from hgorun.symbolic.forms import Bounds, saturate
from hgorun.symbolic.plant import PlantModel


@dataclass(frozen=True)
class SmoothForm:
    """A plant in its own coordinates."""

    plant: PlantModel

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
    """f at the (saturated) estimate and h, without the disturbance."""

    form: SmoothForm
    t: ca.SX
    u: ca.SX
    p: ca.SX
    bounds: Bounds = field(default_factory=dict)

    def copy(self, xhat: ca.SX) -> ca.SX:
        """The plant's vector field."""
        return self.form.plant.f(self.t, self._saturated(xhat), self.u, self.p)

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
