"""Whether every input shows all states, as a constant gain needs it: in z the model is triangular."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import casadi as ca
import numpy as np

from hgorun.errors import NotObservableForm
from hgorun.symbolic import evaluate, ranks
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.points import Instant, instants

_INPUTS = (1.0, 1e-4, 1e4, 1e-8, 1e8, 1.0, 1e-12, 1e12, 1.0)  # sizes of inputs, whose units are unknown
_TRIANGULAR = 1e-7  # relative size of a slope that is rounding
_BESIDE = 1e-8  # relative distance at which rounding differs and a slope does not


def require_uniform(form: CanonicalForm, states: list[np.ndarray], parameters: np.ndarray, slopes: ca.Function) -> None:
    """In z the model must be a chain plus phi(u, z) with phi_i a function of z_1..z_i only.

    What is not drift is what inputs and time bring in; the drift's own slopes say what is rounding.

    Parameters
    ----------
    states : list of ndarray
        Where it is decided, at random inputs.
    slopes : casadi.Function
        The :func:`input_slopes` of the form.

    Raises
    ------
    NotObservableForm
    """
    if not form.plant.inputs:
        return
    position = [k for length in form.chains for k in range(length)]
    last = [k == length - 1 for length in form.chains for k in range(length)]
    above = [(i, j) for i, j in product(range(len(position)), repeat=2) if position[j] > position[i] and not last[i]]
    for at in instants(states, form.plant.u.numel(), sizes=_INPUTS):
        if not ranks.singular_value_ratio(form.jacobian_at(at.x, parameters)) > ranks.SINGULAR:
            continue
        in_z, scale = _added(form, slopes, at, parameters)
        for i, j in above:
            if abs(in_z[i, j]) > _TRIANGULAR * scale[i, j] and not _is_rounding(form, slopes, at, parameters, i, j):
                raise NotObservableForm(
                    f"not uniformly observable: in the coordinates z = (h, L_f h, ...) the derivative of "
                    f"z{i + 1} depends on z{j + 1} through an input or time (slope {in_z[i, j]:.3g}), so some "
                    "input can hide a state; a constant-gain observer needs a triangular model"
                )


def input_slopes(form: CanonicalForm) -> ca.Function:
    """The slopes in x of z' with the inputs less z' without them, and of z' itself, from (t, x, u, p)."""
    plant = form.plant
    drift = plant.f(plant.t, plant.x, ca.SX.zeros(plant.u.shape), plant.p)
    added = ca.jacobian(form.jacobian @ (plant.dynamics - drift), plant.x)
    whole = ca.jacobian(form.jacobian @ plant.dynamics, plant.x)
    arguments = [plant.t, plant.x, plant.u, plant.p]
    return ca.Function("slopes", arguments, [ca.densify(ca.cse(added)), ca.densify(ca.cse(whole))])


def _added(
    form: CanonicalForm, slopes: ca.Function, at: Instant, parameters: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The slopes in z of what inputs and time add to z', and the size of their terms."""
    jacobian = form.jacobian_at(at.x, parameters)
    back = np.linalg.inv(jacobian) if form.square else np.linalg.pinv(jacobian)
    added, whole = (v.reshape(-1, form.plant.n) for v in evaluate.at(slopes, at.t, at.x, at.u, parameters))
    return added @ back, (np.abs(added) + np.abs(whole)) @ np.abs(back)


def _is_rounding(form: CanonicalForm, slopes: ca.Function, at: Instant, parameters: np.ndarray, i: int, j: int) -> bool:
    """Whether a slope is another one right beside: terms of a large input that cancel leave rounding."""
    beside = [replace(at, x=at.x * (1 + k * _BESIDE)) for k in (-9, -5, 0, 4, 7)]
    values = [_added(form, slopes, near, parameters)[0][i, j] for near in beside]
    return bool(np.ptp(values) > 0.1 * abs(values[2]))
