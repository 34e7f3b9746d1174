"""Triangular models as they are, block by block, for observers whose gain follows F(u, x).

x = (x^(1), ..., x^(q)), y = x^(1), and the derivative of block k depends on x^(1)..x^(k+1) (Robles
Magdaleno 2023, (2.1)-(2.5), (3.84)). F_k = d f^(k) / d x^(k+1), whether or not f^(k) is affine in it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from hgorun.errors import NotObservableForm
from hgorun.symbolic.forms import Bounds, saturate
from hgorun.symbolic.plant import PlantModel


@dataclass(frozen=True, eq=False, repr=False)
class TriangularForm:
    """A plant with its states sorted into blocks.

    Attributes
    ----------
    plant : PlantModel
        As configured; results are in its coordinates.
    model : PlantModel
        In the coordinates where it is triangular: the plant's own, or those that the plant gives.
    block : tuple of int
        For each state of ``model`` the number of its block, 0 for the measured ones.
    measured : tuple of int
        For each output the state that it is.
    """

    plant: PlantModel
    model: PlantModel
    block: tuple[int, ...]
    measured: tuple[int, ...]

    @property
    def n(self) -> int:
        """Number of states."""
        return self.model.n

    def saturable(self, canonical: bool) -> tuple[str, ...]:
        return self.model.states

    def coordinates(self, canonical: bool) -> ca.SX:
        plant = self.plant
        return plant.x if plant.transform is None else plant.transform(plant.x, plant.p)

    def start(self, x: np.ndarray, parameters: np.ndarray, canonical: bool) -> np.ndarray:
        if self.plant.transform is None:
            return x
        start: np.ndarray = self.plant.image(x[None], parameters)[0]
        if not np.all(np.isfinite(start)):
            where = ", ".join(f"{name} = {value:g}" for name, value in zip(self.plant.states, x, strict=True))
            raise ValueError(f"the point ({where}) has no image in the coordinates where the plant is triangular")
        return start

    def again(self, at: np.ndarray, parameters: np.ndarray) -> TriangularForm | None:
        """Itself: numbers decide nothing."""
        return self

    def copy(self, t: ca.SX, u: ca.SX, p: ca.SX, canonical: bool, bounds: Bounds) -> TriangularCopy:
        return TriangularCopy(self, t, u, p, bounds)


@dataclass(frozen=True, eq=False, repr=False)
class TriangularCopy:
    """f, F and C of a triangular model at the estimate, without the disturbance."""

    form: TriangularForm
    t: ca.SX
    u: ca.SX
    p: ca.SX
    bounds: Bounds = field(default_factory=dict)

    @property
    def n(self) -> int:
        """Number of states."""
        return self.form.n

    @property
    def C(self) -> ca.DM:
        """y = C x, shape (q, n)."""
        return ca.DM(np.eye(self.n)[list(self.form.measured)])

    def F(self, xhat: ca.SX) -> ca.SX:
        """The block superdiagonal of df/dx at the (saturated) estimate, shape (n, n)."""
        F = superdiagonal(self.form.model, self.form.block)
        return F(self.t, self.saturated(xhat), self.u, self.p)

    def links(self, xhat: ca.SX) -> ca.SX:
        """F: what leads from each block to the next."""
        return self.F(xhat)

    def lift(self, xhat: ca.SX, kappa: ca.SX) -> ca.SX:
        """A correction as it is: the estimate is in the coordinates of the blocks."""
        return kappa

    def copy(self, xhat: ca.SX) -> ca.SX:
        """F(u, sat x) x + phi(u, sat x): the x that multiplies F is not saturated."""
        clipped = self.saturated(xhat)
        f = self.form.model.f(self.t, clipped, self.u, self.p)
        return f + self.F(xhat) @ (xhat - clipped) if self.bounds else f

    def inv_Delta(self, theta: ca.SX) -> ca.SX:
        """Delta^-1(theta): theta^(k-1) on block k, shape (n, n)."""
        powers = [ca.SX(1)]
        for _ in range(max(self.form.block)):
            powers.append(powers[-1] * theta)
        return ca.diag(ca.vertcat(*[powers[k] for k in self.form.block]))

    def measured(self, kappa: ca.SX) -> ca.SX:
        """The components of a correction in the equations of the measured states, shape (q,)."""
        return ca.vertcat(*[kappa[i] for i in self.form.measured])

    def output(self, xhat: ca.SX) -> ca.SX:
        """C xhat."""
        return self.measured(xhat)

    def state(self, xhat: ca.SX) -> ca.SX:
        """The estimate in the plant's coordinates."""
        plant = self.form.plant
        return xhat if plant.transform is None else plant.untransform(xhat, self.p)  # type: ignore[misc]  # both or none

    def saturated(self, x: ca.SX) -> ca.SX:
        """The estimate clipped to its bounds."""
        return saturate(x, self.form.model.states, self.bounds)


def triangular_form(plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> TriangularForm:
    """Sort a plant's states into blocks, or say why that cannot be done.

    Raises
    ------
    NotObservableForm
        When an output is not a state, or a state reaches the measured ones through no other.
    """
    model = transformed(plant) if plant.transform is not None else plant
    block, measured = blocks_of(model)
    return TriangularForm(plant, model, block, measured)


def blocks_of(model: PlantModel) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """For each state the number of its block, 0 for the measured ones, and for each output its state.

    Raises
    ------
    NotObservableForm
        When an output is not a state, or a state reaches the measured ones through no other.
    """
    measured = []
    for name, state in zip(model.outputs, model.measured, strict=True):
        if state is None:
            raise NotObservableForm(
                f"output {name} is not one of the states: an observer with time-varying gain takes a triangular "
                "model as it is, with the measured states first"
            )
        measured.append(state)
    depends = np.zeros((model.n, model.n), dtype=bool)
    sparsity = ca.jacobian(model.dynamics, model.x).sparsity()
    depends[sparsity.row(), sparsity.get_col()] = True
    block = {i: 0 for i in measured}
    level, last = 0, set(measured)
    while len(block) < model.n:
        following = {j for i in last for j in range(model.n) if depends[i, j] and j not in block}
        if not following:
            lost = ", ".join(model.states[j] for j in range(model.n) if j not in block)
            raise NotObservableForm(
                f"state {lost} does not appear in the equations through which the output "
                f"{', '.join(model.outputs)} is reached: it cannot be observed"
            )
        level += 1
        block.update(dict.fromkeys(following, level))
        last = following
    return tuple(block[i] for i in range(model.n)), tuple(measured)


def superdiagonal(model: PlantModel, block: tuple[int, ...]) -> ca.Function:
    """F(t, x, u, p): the entries of df/dx that lead from one block to the next, shape (n, n)."""
    jacobian = ca.jacobian(model.dynamics, model.x)
    entries = ca.SX(model.n, model.n)
    for i in range(model.n):
        for j in range(model.n):
            if block[j] == block[i] + 1:
                entries[i, j] = jacobian[i, j]
    return ca.Function("F", [model.t, model.x, model.u, model.p], [entries])


def transformed(plant: PlantModel) -> PlantModel:
    """The plant in the coordinates z = T(x) that it gives."""
    assert plant.transform is not None
    assert plant.untransform is not None
    z = ca.vertcat(*[ca.SX.sym(f"z{i + 1}") for i in range(plant.n)])
    x = plant.untransform(z, plant.p)
    slopes = ca.Function("J", [plant.x, plant.p], [ca.jacobian(plant.transform(plant.x, plant.p), plant.x)])
    dynamics = ca.cse(slopes(x, plant.p) @ plant.f(plant.t, x, plant.u, plant.p))
    output = ca.simplify(plant.h(plant.t, x, plant.u, plant.p))
    names = tuple(f"z{i + 1}" for i in range(plant.n))
    return PlantModel(
        states=names,
        outputs=plant.outputs,
        inputs=plant.inputs,
        parameters=plant.parameters,
        t=plant.t,
        x=z,
        u=plant.u,
        p=plant.p,
        dynamics=dynamics,
        output=output,
        periods=plant.periods,
    )
