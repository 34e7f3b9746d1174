"""Plants of strict-feedback-like form: some states are measured, the others enter their derivatives linearly.

x' = f_1(x, u) + g(x, u) z, z' = f_2(x, z, u), y = x (Katayama, (1)). x are the states that are outputs, z the
others in the plant's order. The letters are the paper's: here x is not the whole state.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.errors import NotObservableForm
from hgorun.symbolic import evaluate, ranks
from hgorun.symbolic.forms import Bounds
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.points import around, instants


@dataclass(frozen=True)
class StrictFeedbackForm:
    """A plant with its states sorted into measured and unmeasured ones.

    Attributes
    ----------
    plant : PlantModel
    measured, hidden : tuple of int
        Places in the plant's state of x, in the order of the outputs, and of z.
    """

    plant: PlantModel
    measured: tuple[int, ...]
    hidden: tuple[int, ...]

    def again(self, at: np.ndarray, parameters: np.ndarray) -> StrictFeedbackForm | None:
        """Itself, where g has full rank with other numbers too."""
        return self if _rank(self, at, parameters) == len(self.hidden) else None

    @cached_property
    def _g(self) -> ca.Function:
        plant = self.plant
        return ca.Function("g", [plant.t, plant.x, plant.u, plant.p], [ca.simplify(self.slopes)])

    @property
    def slopes(self) -> ca.SX:
        """g = d x' / dz, shape (n_x, n_z), in the plant's symbols."""
        x, z = list(self.measured), list(self.hidden)
        return ca.densify(ca.jacobian(self.plant.dynamics, self.plant.x)[x, z])

    def saturable(self, canonical: bool) -> tuple[str, ...]:
        """None: the arguments of f_1, f_2 and g are measurements."""
        return ()

    def coordinates(self, canonical: bool) -> ca.SX:
        return self.plant.x

    def start(self, x: np.ndarray, parameters: np.ndarray, canonical: bool) -> np.ndarray:
        return x

    def copy(self, t: ca.SX, u: ca.SX, p: ca.SX, canonical: bool, bounds: Bounds) -> StrictFeedbackCopy:
        return StrictFeedbackCopy(self, t, u, p)


@dataclass(frozen=True)
class StrictFeedbackCopy:
    """f_1, f_2 and g at a time, with that time's inputs, without the disturbance."""

    form: StrictFeedbackForm
    t: ca.SX
    u: ca.SX
    p: ca.SX

    def f_1(self, x: ca.SX) -> ca.SX:
        """What the measured states do at z = 0, shape (n_x,)."""
        return self._f(x, ca.SX.zeros(len(self.form.hidden)))[list(self.form.measured)]

    def g(self, x: ca.SX) -> ca.SX:
        """How z enters the derivatives of the measured states, shape (n_x, n_z)."""
        plant = self.form.plant
        at = self.join(x, ca.SX.zeros(len(self.form.hidden)))
        g = ca.Function("g", [plant.t, plant.x, plant.u, plant.p], [self.form.slopes])
        return g(self.t, at, self.u, self.p)

    def f_2(self, x: ca.SX, z: ca.SX) -> ca.SX:
        """What the unmeasured states do, shape (n_z,)."""
        return self._f(x, z)[list(self.form.hidden)]

    def Psi(self, y: ca.SX, following: ca.SX, T: ca.SX) -> ca.SX:
        """z as two samples a time T apart show it, (6), shape (n_z,)."""
        g = self.g(y)
        return ca.solve(g.T @ g, g.T @ ((following - y) / T - self.f_1(y)))

    def join(self, x: ca.SX, z: ca.SX) -> ca.SX:
        """The plant's state from its measured and unmeasured part."""
        parts = [ca.SX(0)] * self.form.plant.n
        for places, values in ((self.form.measured, x), (self.form.hidden, z)):
            for i, place in enumerate(places):
                parts[place] = values[i]
        return ca.vertcat(*parts)

    def hidden(self, xhat: ca.SX) -> ca.SX:
        """z of an estimate of the plant's state."""
        return xhat[list(self.form.hidden)]

    def state(self, xhat: ca.SX) -> ca.SX:
        """The estimate in the plant's coordinates: it is."""
        return xhat

    def output(self, xhat: ca.SX) -> ca.SX:
        """C xhat."""
        return xhat[list(self.form.measured)]

    def _f(self, x: ca.SX, z: ca.SX) -> ca.SX:
        return self.form.plant.f(self.t, self.join(x, z), self.u, self.p)


def strict_feedback_form(plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> StrictFeedbackForm:
    """Sort a plant's states into measured and unmeasured ones, or say why that cannot be done.

    Parameters
    ----------
    plant : PlantModel
    at : ndarray, shape (n,)
        A typical state: the rank of g is decided at random points around it.
    parameters : ndarray
        Values of the parameters.

    Raises
    ------
    NotObservableForm
        When an output is not a state, all states are measured, the derivative of a measured state is not
        affine in the others, or g^T g is singular (assumption A2).
    """
    form = StrictFeedbackForm(plant, *_sorted(plant))
    z = [plant.states[i] for i in form.hidden]
    z_symbols = plant.x[list(form.hidden)]
    slopes = ca.simplify(form.slopes)
    for row, place in enumerate(form.measured):
        bend = ca.jacobian(slopes[row, :], z_symbols)
        if not bend.is_zero():
            bent = sorted({z[j] for j in bend.sparsity().get_col()})
            raise NotObservableForm(
                f"{plant.states[place]}' is not affine in {', '.join(bent)}: this observer needs "
                "x' = f_1(x, u) + g(x, u) z, x being the measured states and z the others"
            )
    _require_rank(form, at, parameters)
    return form


def _sorted(plant: PlantModel) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Places of the measured and of the other states."""
    measured: list[int] = []
    for name, state in zip(plant.outputs, plant.measured, strict=True):
        if state is None:
            raise NotObservableForm(
                f"output {name} is not one of the states: a reduced-order observer takes the measured states "
                "from the samples and estimates the others"
            )
        if state in measured:
            raise NotObservableForm(f"state {plant.states[state]} is measured twice")
        measured.append(state)
    hidden = tuple(k for k in range(plant.n) if k not in measured)
    if not hidden:
        raise NotObservableForm("all states are measured: a reduced-order observer has nothing to estimate")
    return tuple(measured), hidden


def _rank(form: StrictFeedbackForm, at: np.ndarray, parameters: np.ndarray) -> int:
    """The rank of g, decided at random points around the typical state."""
    plant = form.plant
    best = 0
    for i in instants(around(at, plant.states)[1:], plant.u.numel()):
        (value,) = evaluate.at(form._g, i.t, i.x, i.u, parameters)
        best = max(best, ranks.rank(value.reshape(len(form.measured), len(form.hidden))))
    return best


def _require_rank(form: StrictFeedbackForm, at: np.ndarray, parameters: np.ndarray) -> None:
    """A2: g has full column rank."""
    plant, n_z = form.plant, len(form.hidden)
    best = _rank(form, at, parameters)
    if best < n_z:
        names = ", ".join(plant.states[i] for i in form.hidden)
        outputs = ", ".join(plant.outputs)
        raise NotObservableForm(
            f"the derivative of the output {outputs} shows {best} of the {n_z} unmeasured states {names} "
            f"(rank of g, assumption A2): this observer needs g(x, u) with {n_z} independent columns"
        )
