"""Plants that move by themselves, and linear ones with any inputs."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.errors import NotObservableForm
from hgorun.symbolic.evaluate import Floats, evaluate
from hgorun.symbolic.linear import linear_form
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.smooth import SmoothForm


@dataclass(frozen=True, eq=False, repr=False)
class DriftForm(SmoothForm):
    """A plant that moves by itself, with its numbers; or a linear one, with any inputs.

    Attributes
    ----------
    parameters : ndarray
    A, C : ndarray, shapes (n, n), (q, n), or None
        Slopes, where the plant is linear.
    autonomous : bool
        Whether neither time nor an input enters.
    field : casadi.Function
        (x, p) -> f, h, the inputs at zero.
    """

    parameters: np.ndarray
    A: np.ndarray | None
    C: np.ndarray | None
    autonomous: bool
    field: ca.Function

    def again(self, at: np.ndarray, parameters: np.ndarray) -> DriftForm:
        return drift_form(self.plant, at, parameters)

    @property
    def offset(self) -> bool:
        """Whether f or h is not zero where the state is."""
        return any(np.any(part != 0) for part in self.values(np.zeros((1, self.plant.n))))

    def values(self, x: Floats) -> tuple[Floats, Floats]:
        """f and h at points, shapes (N, n), (N, q)."""
        f, h = evaluate(self.field, x, self.parameters)
        return f, h


def drift_form(plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> DriftForm:
    """The drift of a plant.

    Raises
    ------
    NotObservableForm
        Where the plant is driven and not linear.
    """
    autonomous = not ca.depends_on(ca.vertcat(plant.dynamics, plant.output), ca.vertcat(plant.t, plant.u))
    A = C = None
    try:
        linear = linear_form(plant, at, parameters)
        A, C = linear.A, linear.C
    except NotObservableForm:
        if not autonomous:
            raise NotObservableForm(
                "time or inputs enter the plant, which is not linear: the map T of kkl is that of a plant that moves "
                "by itself"
            ) from None
    still = ca.substitute([plant.dynamics, plant.output], [plant.u, plant.t], [ca.SX.zeros(*plant.u.shape), ca.SX(0)])
    field = ca.Function("field", [plant.x, plant.p], [ca.densify(part) for part in still])
    return DriftForm(plant, parameters, A, C, autonomous, field)
