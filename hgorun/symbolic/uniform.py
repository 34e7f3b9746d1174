"""Whether every input shows all states, as a constant gain needs it: in z the model is triangular."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from hgorun.errors import NotObservableForm
from hgorun.symbolic import evaluate, ranks
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.points import Instants

_INPUTS = (1.0, 1e-4, 1e4, 1e-8, 1e8, 1.0, 1e-12, 1e12, 1.0)  # sizes of inputs, whose units are unknown
_TRIANGULAR = 1e-7  # relative size of a slope that is rounding
_BESIDE = 1e-8  # relative distance at which rounding differs and a slope does not


def require_uniform(
    form: CanonicalForm, states: list[np.ndarray], parameters: np.ndarray, slopes: ca.Function | None
) -> None:
    """In z the model must be a chain plus phi(u, z) with phi_i a function of z_1..z_i only.

    What is not drift is what inputs and time bring in; the drift's own slopes say what is rounding.

    Parameters
    ----------
    states : list of ndarray
        Where it is decided, at random inputs.
    slopes : casadi.Function or None
        The :func:`input_slopes` of the form.

    Raises
    ------
    NotObservableForm
    """
    if slopes is None:
        return
    above = _above(form.chains)
    points = Instants.of(states, form.plant.u.numel(), _INPUTS)
    in_z, scale = _added(form, slopes, points, parameters)
    with np.errstate(invalid="ignore"):
        slope = above & (np.abs(in_z) > _TRIANGULAR * scale)
    for k in np.flatnonzero(slope.any(axis=(1, 2))):
        at = points.one(int(k))
        if not ranks.is_regular(form.jacobian_at(at.x[0], parameters)):
            continue
        for i, j in np.argwhere(slope[k]):
            if not _is_rounding(form, slopes, at, parameters, i, j):
                raise NotObservableForm(
                    f"not uniformly observable: in the coordinates z = (h, L_f h, ...) the derivative of "
                    f"z{i + 1} depends on z{j + 1} through an input or time (slope {in_z[k, i, j]:.3g}), so some "
                    "input can hide a state; a constant-gain observer needs a triangular model"
                )


@lru_cache(maxsize=64)
def _above(chains: tuple[int, ...]) -> np.ndarray:
    """Which slopes of z_i' in z_j, shape (m, m), have to be zero."""
    position = np.concatenate([np.arange(length) for length in chains])
    last = position == np.repeat(chains, chains) - 1
    return np.asarray((position > position[:, None]) & ~last[:, None])


def input_slopes(form: CanonicalForm) -> ca.Function | None:
    """The slopes in x of z' with the inputs less z' without them, and of z' itself, and J, from (t, x, u, p).

    None where the model is triangular whatever the numbers are: without inputs, and where z_i and what inputs add to
    z_i' depend on the same i states.
    """
    plant = form.plant
    if not plant.inputs:
        return None
    drift = plant.f(plant.t, plant.x, ca.SX.zeros(plant.u.shape), plant.p)
    added = ca.jacobian(form.jacobian @ (plant.dynamics - drift), plant.x)
    if len(form.chains) == 1 and form.square and _always_triangular(form.jacobian, added):
        return None
    whole = ca.jacobian(form.jacobian @ plant.dynamics, plant.x)
    arguments = [plant.t, plant.x, plant.u, plant.p]
    return ca.Function("slopes", arguments, [ca.densify(ca.cse(one)) for one in (added, whole, form.jacobian)])


def _always_triangular(jacobian: ca.SX, added: ca.SX) -> bool:
    """Whether row i of both has entries in the same i columns alone; the last row of what is added may have any."""
    known: set[int] = set()
    last = jacobian.shape[0] - 1
    for i in range(last):
        known |= _columns(jacobian, i)
        if len(known) != i + 1 or not _columns(added, i) <= known:
            return False
    return True


def _columns(matrix: ca.SX, row: int) -> set[int]:
    """Where a row has entries."""
    return set(ca.sparsify(matrix[row, :]).sparsity().get_col())


def _added(
    form: CanonicalForm, slopes: ca.Function, points: Instants, parameters: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The slopes in z of what inputs and time add to z', and the size of their terms, shapes (points, m, m).

    They are not numbers where the Jacobian has no inverse.
    """
    values = evaluate.evaluate(slopes, points.t[:, None], points.x, points.u, parameters)
    added, whole, jacobians = (v.reshape(len(points.t), -1, form.plant.n) for v in values)
    back = _inverses(jacobians, form.square)
    return added @ back, (np.abs(added) + np.abs(whole)) @ np.abs(back)


def _inverses(matrices: np.ndarray, square: bool) -> np.ndarray:
    """The inverse of each, from the left where there are more rows than columns; not a number where there is none."""
    try:
        return np.linalg.inv(matrices) if square else np.linalg.pinv(matrices)
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full(matrices.swapaxes(-1, -2).shape, np.nan)
        return np.concatenate([_inverses(matrix[None], square) for matrix in matrices])


def _is_rounding(
    form: CanonicalForm, slopes: ca.Function, at: Instants, parameters: np.ndarray, i: int, j: int
) -> bool:
    """Whether a slope is another one right beside: terms of a large input that cancel leave rounding."""
    beside = 1 + _BESIDE * np.array([[-9], [-5], [0], [4], [7]])
    near = Instants(np.repeat(at.t, 5), at.x * beside, np.repeat(at.u, 5, axis=0))
    values = _added(form, slopes, near, parameters)[0][:, i, j]
    return bool(np.ptp(values) > 0.1 * abs(values[2]))
