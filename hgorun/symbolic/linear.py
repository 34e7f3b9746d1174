"""Linear plants: constant slopes of the dynamics and of the outputs."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.errors import NotObservableForm
from hgorun.symbolic.evaluate import at as at_point
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.smooth import SmoothForm


@dataclass(frozen=True, eq=False, repr=False)
class LinearForm(SmoothForm):
    """x' = A x + g(t, u), y = C x + h(t, u), in the plant's own coordinates.

    Attributes
    ----------
    A, C : ndarray, shapes (n, n), (q, n)
    slopes : casadi.Function
        A and C of (x, p).
    """

    A: np.ndarray
    C: np.ndarray
    slopes: ca.Function

    def again(self, at: np.ndarray, parameters: np.ndarray) -> LinearForm:
        return _with_numbers(self.plant, self.slopes, at, parameters)


def linear_form(plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> LinearForm:
    """The slopes of a linear plant.

    Raises
    ------
    NotObservableForm
        Where a slope depends on the state, on time or on an input.
    """
    slopes = [ca.simplify(ca.jacobian(of, plant.x)) for of in (plant.dynamics, plant.output)]
    for what, slope in zip(("dynamics", "outputs"), slopes, strict=True):
        if ca.depends_on(slope, ca.vertcat(plant.t, plant.x, plant.u)):
            raise NotObservableForm(f"the slopes of the {what} are not constant: the plant is not linear")
    function = ca.Function("slopes", [plant.x, plant.p], [ca.densify(slope) for slope in slopes])
    return _with_numbers(plant, function, at, parameters)


def _with_numbers(plant: PlantModel, slopes: ca.Function, at: np.ndarray, parameters: np.ndarray) -> LinearForm:
    A, C = at_point(slopes, at, parameters)
    return LinearForm(plant, A.reshape(plant.n, plant.n), C.reshape(-1, plant.n), slopes)
