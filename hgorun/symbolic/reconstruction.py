"""The state from the derivatives of output and input: the map Phi of direct reconstruction.

For a lower triangular model y = h(x_1, u), x_i' = f_i(x_1..x_(i+1), u) the state follows from y, y', ...,
y^(n-1) and u, u', ...: h gives x_1 and its derivatives, f_1 = x_1' gives x_2 and its derivatives, and so
on (Meiners, Adamy 2025, (4), (10)).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np

from hgorun.symbolic.evaluate import at
from hgorun.symbolic.parameters import flat
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.points import instants

_NEWTON_STEPS = 12
_SAME = 1e-12  # of what is sought: rounding
_AFFINE = 1e-9  # relative change of a slope that counts as rounding


class Jets:
    """Symbols for the derivatives of state and input, and the time derivative of what is written in them.

    Attributes
    ----------
    X, U : casadi.SX, shapes (n, orders), (m, orders)
        X[i, k] is the k-th derivative of x_i.
    """

    def __init__(self, model: PlantModel, orders: int) -> None:
        self.model = model
        self.X = ca.SX.sym("X", model.n, orders)
        self.U = ca.SX.sym("U", len(model.inputs), orders)

    def of(self, expression: ca.SX) -> ca.SX:
        """An expression of the model's x and u in these symbols."""
        model = self.model
        f = ca.Function("f", [model.t, model.x, model.u, model.p], [expression])
        return f(model.t, self.X[:, 0], self.U[:, 0], model.p)

    def derivative(self, expression: ca.SX) -> ca.SX:
        """d/dt; the highest derivatives count as constant."""
        total = ca.jacobian(expression, self.model.t)
        for jet in (self.X, self.U):
            if jet.shape[0] and jet.shape[1] > 1:
                total += ca.jtimes(expression, ca.vec(jet[:, :-1]), ca.vec(jet[:, 1:]))
        return total

    def function(self, expression: ca.SX) -> ca.Function:
        """(t, X, U, p) -> the expression."""
        return ca.Function("jet", [self.model.t, self.X, self.U, self.model.p], [expression])


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """The map Phi, and what was decided on the way to it.

    Attributes
    ----------
    function : casadi.Function
        (t, Y, U, p, guess) -> x.
    slopes : tuple of (casadi.Function, int, bool)
        Slopes that are written with their own state, the state, and whether they change with it.
    """

    function: ca.Function
    slopes: tuple[tuple[ca.Function, int, bool], ...]

    def holds(self, model: PlantModel, points: Sequence[np.ndarray], parameters: np.ndarray) -> bool:
        """Whether other points and parameters lead to the same decisions."""
        return all(_affine(slope, i, model, points, parameters) == affine for slope, i, affine in self.slopes)


def reconstruction(
    model: PlantModel,
    order: Sequence[int],
    points: Sequence[np.ndarray],
    parameters: np.ndarray,
    *,
    halvings: int = 0,
) -> Reconstruction:
    """Phi: (t, Y, U, p, guess) -> x.

    Y = (y, y', ..., y^(n-1)); U, shape (m, n), has u and its derivatives as columns. Where h or f_i is affine
    in the next state the guess plays no role; elsewhere it starts Newton's method, twelve steps of it.

    Parameters
    ----------
    model : PlantModel
        With one output.
    order : sequence of int
        The model's states as the equations reach them, the one in h first.
    points : sequence of ndarray
        States at which is decided whether an equation is affine, when that does not show in its form.
    parameters : ndarray
    halvings : int
        So often a step of Newton's method may be halved, until it comes nearer to what is sought; without, every step
        is taken, which costs less and may lead away from a guess that is far off.
    """
    n, t, p = model.n, model.t, model.p
    jets = Jets(model, n)
    Y, guess = ca.SX.sym("Y", n), ca.SX.sym("guess", n)
    known = ca.SX.zeros(n, n)
    slopes = []
    for i, state in enumerate(order):
        source = model.output[0] if i == 0 else model.dynamics[order[i - 1]]
        targets = Y if i == 0 else known[order[i - 1], 1:].T
        relation = jets.of(source)
        slope = jets.function(ca.jacobian(relation, jets.X[state, 0]))
        for k in range(n - i):
            value = jets.function(relation)
            if k > 0:  # the k-th derivative of the relation is affine in the k-th derivative of the state
                known[state, k] = (targets[k] - value(t, known, jets.U, p)) / slope(t, known, jets.U, p)
            elif not ca.depends_on(slope(t, jets.X, jets.U, p), jets.X[state, 0]):
                known[state, 0] = (targets[0] - value(t, known, jets.U, p)) / slope(t, known, jets.U, p)
            else:
                known[state, 0] = guess[state]
                affine = _affine(slope, state, model, points, parameters)
                slopes.append((slope, state, affine))
                for _ in range(1 if affine else _NEWTON_STEPS):
                    miss = targets[0] - value(t, known, jets.U, p)
                    step = miss / slope(t, known, jets.U, p)
                    if halvings and not affine:
                        of_step = partial(_miss, jets, value, targets[0], known, state)
                        step = _shortened(step, halvings, of_step, _SAME * ca.fabs(targets[0]))
                    known[state, 0] += step
            relation = jets.derivative(relation)
    return Reconstruction(ca.Function("Phi", [t, Y, jets.U, p, guess], [ca.cse(known[:, 0])]), tuple(slopes))


def _miss(jets: Jets, value: ca.Function, target: ca.SX, known: ca.SX, state: int, step: ca.SX) -> ca.SX:
    """By how much a relation misses its target when a state has moved by a step."""
    moved = ca.SX(known)
    moved[state, 0] += step
    return ca.fabs(target - value(jets.model.t, moved, jets.U, jets.model.p))


def _shortened(step: ca.SX, halvings: int, miss: Callable[[ca.SX], ca.SX], rounding: ca.SX) -> ca.SX:
    """The longest of step, step/2, step/4, ... that misses by no more than no step does; or else the last."""
    allowed = miss(ca.SX(0)) + rounding
    found = step / 2**halvings
    for k in reversed(range(halvings)):
        found = ca.if_else(miss(step / 2**k) <= allowed, step / 2**k, found)
    return found


def output_derivatives(model: PlantModel) -> ca.Function:
    """(t, x, U, p) -> (y, y', ..., y^(n-1)); U, shape (m, n), has u and its derivatives as columns."""
    U = ca.SX.sym("U", model.u.numel(), model.n)
    drift = ca.substitute(model.dynamics, model.u, U[:, 0])
    function = ca.substitute(model.output[0], model.u, U[:, 0])
    rows = []
    for _ in range(model.n):
        rows.append(function)
        along = ca.jtimes(function, model.x, drift) + ca.jacobian(function, model.t)
        if U.numel() and model.n > 1:
            along += ca.jtimes(function, ca.vec(U[:, :-1]), ca.vec(U[:, 1:]))
        function = ca.cse(along)
    return ca.Function("derivatives", [model.t, model.x, U, model.p], [ca.vertcat(*rows)])


def input_derivatives(u: ca.SX, t: ca.SX, orders: int) -> ca.SX:
    """(u, u', ...), shape (m, orders), of an expression of time."""
    columns = [u]
    for _ in range(orders - 1):
        columns.append(ca.jacobian(columns[-1], t))
    return ca.horzcat(*columns)


def _affine(
    slope: ca.Function, state: int, model: PlantModel, points: Sequence[np.ndarray], parameters: np.ndarray
) -> bool:
    """Whether the slope does not change with the state, though it is written with it."""
    seen = False
    for i in instants(points, len(model.inputs), low=0.1):
        X, U = np.zeros((model.n, model.n)), np.zeros((len(model.inputs), model.n))
        X[:, 0], U[:, 0] = i.x, i.u
        there = X.copy()
        there[state, 0] *= 1.1
        there[state, 0] += 1e-3 * (i.x[state] == 0)
        a, b = (float(at(slope, 0.0, flat(values), flat(U), parameters)[0][0]) for values in (X, there))
        if np.isfinite(a) and np.isfinite(b):
            seen = True
            if abs(a - b) > _AFFINE * (abs(a) + abs(b)):
                return False
    return seen
