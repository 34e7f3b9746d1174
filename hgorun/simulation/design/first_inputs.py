"""The inputs of a plant at the start of a run, for observers whose first state depends on them."""

from __future__ import annotations

from typing import TypeAlias

import casadi as ca
import numpy as np

from hgorun.memo import Memo, same
from hgorun.plants.build import BuiltPlant, SymbolicPlant
from hgorun.symbolic.evaluate import Floats, at
from hgorun.symbolic.forms import Driven, Form
from hgorun.symbolic.reconstruction import input_derivatives

Recorded: TypeAlias = tuple[tuple[int, float, float], ...]
"""Of inputs that are recorded the number among all inputs, and the value and the slope at the start."""

_FUNCTIONS: Memo[ca.Function] = Memo(64)


def inputs_at_start(plant: BuiltPlant, recorded: Recorded) -> Floats:
    """u, u', ..., u^(n-1) at the start, shape (m, n).

    What a controller drives is zero, as it is before the controller first acts.
    """
    model, symbolic = plant.model, plant.symbolic
    function = _FUNCTIONS.get(same(symbolic), lambda: _derivatives(symbolic))
    inputs = at(function, 0.0, plant.parameters, plant.numbers)[0].reshape(len(model.inputs), model.n)
    for number, *line in recorded:
        inputs[number] = 0.0
        inputs[number, :2] = line[: model.n]
    return inputs


def started(form: Form, x: Floats, plant: BuiltPlant, canonical: bool, recorded: Recorded = ()) -> Floats:
    """The first state of an observer's estimate, which is x then.

    Raises
    ------
    ValueError
        Where there is none.
    """
    if isinstance(form, Driven):
        return np.asarray(form.start_driven(x, plant.parameters, canonical, inputs_at_start(plant, recorded)))
    return np.asarray(form.start(x, plant.parameters, canonical))


def _derivatives(plant: SymbolicPlant) -> ca.Function:
    model = plant.model
    u = ca.substitute(plant.inputs, model.u, ca.SX.zeros(model.u.shape))
    rows = ca.densify(input_derivatives(u, model.t, model.n))
    return ca.Function("inputs", [model.t, model.p, plant.numbers], [rows])
