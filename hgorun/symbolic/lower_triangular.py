"""Lower triangular models with one output, and the differentiator's coordinates for them.

y = h(x_1, u), x_i' = f_i(x_1..x_(i+1), u), dh/dx_1 and df_i/dx_(i+1) bounded away from zero (Meiners, Adamy
2025, (1), (2)). The states may be listed in any order; x_1 is the one that h measures, x_2 the one that
comes in with f_1, and so on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.errors import NotObservableForm
from hgorun.symbolic import evaluate
from hgorun.symbolic.forms import Bounds
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.points import instants, near
from hgorun.symbolic.reconstruction import Reconstruction, input_derivatives, reconstruction
from hgorun.symbolic.triangular import TriangularCopy, TriangularForm, transformed

_HALVINGS = 6  # of a step of Newton's method
_LOWEST = 0.1  # of the inputs at which slopes are taken: they may stand under a root


@dataclass(frozen=True)
class LowerTriangularForm(TriangularForm):
    """A plant whose states follow one after the other: every block has one state.

    Attributes
    ----------
    points : tuple of ndarray
        Typical states of ``model``.
    parameters : ndarray
        Values of the plant's parameters.
    holds : tuple of callable
        (points, parameters) -> whether other numbers lead to the same form; all of them must.
    """

    points: tuple[np.ndarray, ...] = field(default=(), compare=False)
    parameters: np.ndarray = field(default_factory=lambda: np.zeros(0), compare=False)
    holds: tuple[Callable[[Sequence[np.ndarray], np.ndarray], bool], ...] = field(default=(), compare=False)

    @property
    def order(self) -> tuple[int, ...]:
        """The states of ``model``, x_1 first."""
        return tuple(int(i) for i in np.argsort(self.block))

    @cached_property
    def _reconstruction(self) -> Reconstruction:
        return reconstruction(self.model, self.order, self.points, self.parameters)

    @property
    def Phi(self) -> ca.Function:
        """(t, Y, U, p, guess) -> x, in the coordinates of ``model``."""
        return self._reconstruction.function

    @cached_property
    def damped_Phi(self) -> ca.Function:
        """The same with damped steps, for guesses that are far off; not for equations, which it makes long."""
        return reconstruction(self.model, self.order, self.points, self.parameters, halvings=_HALVINGS).function

    def again(self, at: np.ndarray, parameters: np.ndarray) -> LowerTriangularForm | None:
        """The form with other numbers, where they lead to the same equations."""
        points = tuple(near(self.start(at, parameters, False)))
        known = self.__dict__.get("_reconstruction")
        if known is not None and not known.holds(self.model, points, parameters):
            return None
        if not all(holds(points, parameters) for holds in self.holds):
            return None
        form = replace(self, points=points, parameters=parameters)
        if known is not None:
            form.__dict__["_reconstruction"] = known
        return form

    @cached_property
    def links(self) -> np.ndarray:
        """Slopes of the output in x_1 and of x_i' in x_(i+1) at typical states, shape (N, n); maybe not finite."""
        return np.array(_values(_links(self), self.model, self.points, self.parameters))

    @property
    def guesses(self) -> bool:
        """Whether Phi starts Newton's method somewhere."""
        return bool(self._reconstruction.slopes)

    def copy(self, t: ca.SX, u: ca.SX, p: ca.SX, canonical: bool, bounds: Bounds) -> LowerTriangularCopy:
        return LowerTriangularCopy(self, t, u, p, bounds)


@dataclass(frozen=True)
class LowerTriangularCopy(TriangularCopy):
    """f, h and Phi of a lower triangular plant, without the disturbance."""

    form: LowerTriangularForm

    @property
    def A(self) -> ca.DM:
        """The anti-shift matrix, for the states as they are listed, shape (n, n)."""
        block = np.array(self.form.block)
        return ca.DM((block[None, :] == block[:, None] + 1).astype(float))

    def along(self, gain: ca.SX) -> ca.SX:
        """One number each for x_1, ..., x_n as a vector for the states as they are listed."""
        return ca.vertcat(*[gain[k] for k in self.form.block])

    def Theta(self, theta: ca.SX) -> ca.SX:
        """diag(theta, theta^2, ..., theta^n)."""
        return theta * self.inv_Delta(theta)

    def output(self, xhat: ca.SX) -> ca.SX:
        """h(xhat, u), shape (1,)."""
        return self.form.model.h(self.t, xhat, self.u, self.p)

    def slope(self, xhat: ca.SX) -> ca.SX:
        """c = (dh/dx_1, 0, ..., 0) at the estimate, shape (1, n)."""
        model = self.form.model
        c = ca.densify(ca.jacobian(model.output, model.x))
        return ca.Function("c", [model.t, model.x, model.u, model.p], [c])(self.t, xhat, self.u, self.p)

    def reconstruct(self, Y: ca.SX, guess: ca.SX, *, damped: bool = False) -> ca.SX:
        """x = Phi(y, y', ..., u, u', ...)."""
        Phi = self.form.damped_Phi if damped and self.form.guesses else self.form.Phi
        return Phi(self.t, Y, input_derivatives(self.u, self.t, self.n), self.p, guess)


def lower_triangular_form(plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> LowerTriangularForm:
    """Order a plant's states, in the coordinates that the plant gives for it if it gives any.

    Raises
    ------
    NotObservableForm
        When there are several outputs, or the model is not lower triangular.
    """
    model = transformed(plant) if plant.transform is not None else plant
    if len(model.outputs) != 1:
        raise NotObservableForm(
            f"{len(model.outputs)} outputs ({', '.join(model.outputs)}): an observer for lower triangular "
            "plants takes one"
        )
    start = TriangularForm(plant, model, tuple(range(model.n)), (0,)).start(at, parameters, False)
    points = near(start)
    rows = ca.vertcat(model.output, model.dynamics)
    depends = np.zeros((1 + model.n, model.n), dtype=bool)
    sparsity = ca.jacobian(rows, model.x).sparsity()
    depends[sparsity.row(), sparsity.get_col()] = True
    holds = []
    if plant.transform is not None:  # what cancels does not show in the form of the equations
        jacobian = _function(model, ca.jacobian(rows, model.x))
        seen = _dependence(jacobian, model, points, parameters)
        depends &= seen
        holds.append(lambda points, parameters: bool(np.all(_dependence(jacobian, model, points, parameters) == seen)))
    order: list[int] = []
    names = [f"the output {model.outputs[0]}", *(f"the derivative of {s}" for s in model.states)]
    row = 0
    while True:
        following = [j for j in range(model.n) if depends[row, j] and j not in order]
        if len(following) > 1:
            found = " and ".join(model.states[j] for j in following)
            raise NotObservableForm(
                f"not lower triangular: {names[row]} depends on {found}; only x_1 may be measured, and only "
                "one more state may appear with each derivative"
            )
        if not following:
            break
        order.append(following[0])
        row = 1 + following[0]
    if len(order) < model.n:
        lost = ", ".join(model.states[j] for j in range(model.n) if j not in order)
        raise NotObservableForm(
            f"not lower triangular: state {lost} does not appear in the output {model.outputs[0]} or the "
            f"derivative of {', '.join(model.states[j] for j in order) or 'any state'}"
        )
    block = tuple(order.index(j) for j in range(model.n))
    return LowerTriangularForm(plant, model, block, (order[0],), tuple(points), parameters, tuple(holds))


def state_affine_form(plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> LowerTriangularForm:
    """Lower triangular with y = x_1 and x_i' = g_i(x_1..x_i, u) + x_(i+1) (Meiners, Adamy 2025, (5)).

    Raises
    ------
    NotObservableForm
    """
    form = lower_triangular_form(plant, at, parameters)
    model, order, function = form.model, form.order, _links(form)

    def of_slope_one(values: np.ndarray) -> np.ndarray:
        return np.asarray(~np.isfinite(values) | (np.abs(values - 1) <= 1e-9))

    for values in _values(function, model, form.points, parameters):
        for i, (value, fits) in enumerate(zip(values, of_slope_one(values), strict=True)):
            if not fits:
                what = f"the output {model.outputs[0]}" if i == 0 else f"the derivative of {model.states[order[i - 1]]}"
                raise NotObservableForm(
                    f"not state-affine: the slope of {what} in {model.states[order[i]]} is {value:.4g} and "
                    "must be 1: the dynamic gain takes x_i' = g_i(x_1..x_i, u) + x_(i+1), y = x_1"
                )

    def holds(points: Sequence[np.ndarray], parameters: np.ndarray) -> bool:
        return all(np.all(of_slope_one(values)) for values in _values(function, model, points, parameters))

    return replace(form, holds=(*form.holds, holds))


def _links(form: LowerTriangularForm) -> ca.Function:
    """Slopes of the output in x_1 and of x_i' in x_(i+1), from (t, x, u, p)."""
    model, order = form.model, form.order
    rows = [model.output[0], *(model.dynamics[i] for i in order[:-1])]
    slopes = [ca.jacobian(row, model.x[j]) for row, j in zip(rows, order, strict=True)]
    return _function(model, ca.vertcat(*slopes))


def _values(
    function: ca.Function, model: PlantModel, points: Sequence[np.ndarray], parameters: np.ndarray
) -> list[np.ndarray]:
    """A function of (t, x, u, p) at the points, at random times and inputs."""
    return [
        evaluate.at(function, i.t, i.x, i.u, parameters)[0] for i in instants(points, len(model.inputs), low=_LOWEST)
    ]


def _function(model: PlantModel, expression: ca.SX) -> ca.Function:
    return ca.Function("f", [model.t, model.x, model.u, model.p], [ca.densify(expression)])


def _dependence(
    jacobian: ca.Function, model: PlantModel, points: Sequence[np.ndarray], parameters: np.ndarray
) -> np.ndarray:
    """Which row depends on which state at one of the points, shape (rows, n)."""
    entries = [e.reshape(-1, model.n) for e in _values(jacobian, model, points, parameters)]
    size = np.max([np.where(np.isfinite(e), np.abs(e), 0) for e in entries], axis=0)
    size = size * np.max(np.abs(points), axis=0)  # what each state brings in, all in the unit of the row
    return np.asarray(size > 1e-12 * size.max(axis=1, keepdims=True))
