"""States of the plant in the coordinates where an observer computes."""

from __future__ import annotations

import casadi as ca
import numpy as np

from hgorun.symbolic.forms import Form


def transformed(form: Form, x: np.ndarray, parameters: np.ndarray, *, canonical: bool = False) -> np.ndarray:
    """z = T(x) of many states x (M, n), shape (M, n)."""
    plant, image = form.plant, form.coordinates(canonical)
    if ca.is_equal(image, plant.x):
        return x
    values = ca.Function("T", [plant.x, plant.p], [image])(ca.DM(x.T), ca.DM(parameters))
    return np.asarray(values.full()).T
