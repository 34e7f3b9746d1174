"""The coordinates in which an observer's theory is written, and the plant's slopes there.

A constant-gain observer's are z = Phi(x), the chains; a time-varying one's those where its plant is triangular.
In them f = F z + phi: what is not on the chains' links is phi.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.analysis.reasons import NoValue, Outcome, outcome
from hgorun.memo import Memo, same
from hgorun.plants.build import BuiltPlant
from hgorun.symbolic.enclosures import Enclosure
from hgorun.symbolic.evaluate import evaluate
from hgorun.symbolic.forms import BlockForm, ChainForm, Form
from hgorun.symbolic.points import around, instants

_CURVED = 1e-8  # relative change of a slope that is rounding
_DEEP = 100  # operations down to which expressions are compared
_CHARTS: Memo[Outcome[Chart]] = Memo(64)  # by form and numbers: observers of one form share it, and so do their runs
_OF_FORMS: Memo[Outcome[Chart]] = Memo(64)  # by form alone, with the numbers of the plant that came first
_INPUTS: Memo[Enclosure] = Memo(64)  # by the numbers that they follow from
_FUNCTIONS: Memo[ca.Function] = Memo(128)  # by their expressions, which charts of other numbers share


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Chart:
    """Coordinates z of a plant, and phi's slopes.

    Functions are made of its expressions when they are first asked for, and kept.

    Attributes
    ----------
    names : tuple of str
        The plant's states where z is x, else z1..zn.
    positions : ndarray of int, shape (n,)
        Place of each coordinate in its chain, from 0: zbar_i = theta^(-position) z_i.
    t, x, z, u, p : casadi.SX
        Symbols.
    field : casadi.SX, shape (n,)
        The plant's dynamics, of x.
    slopes : casadi.SX, shape (n, n)
        d phi/dz as functions of z, where z can be inverted.
    slopes_in_x : casadi.SX, shape (n, n)
        The same as functions of x.
    map : casadi.SX, shape (n,)
        z, of x.
    variables, raw : casadi.SX
        d phi/d(variables), shape (n, n), of the variables: x, or z where phi is written in it.
    straight : bool
        Whether the variables are z.
    plant : BuiltPlant
        With its numbers.
    invertible : bool
        Whether x is known as a function of z.
    """

    names: tuple[str, ...]
    positions: np.ndarray
    t: ca.SX
    x: ca.SX
    z: ca.SX
    u: ca.SX
    p: ca.SX
    field: ca.SX
    slopes: ca.SX
    slopes_in_x: ca.SX
    map: ca.SX
    variables: ca.SX
    raw: ca.SX
    plant: BuiltPlant
    invertible: bool

    @cached_property
    def straight(self) -> bool:
        return self.identity or not ca.is_equal(self.variables, self.x)

    @cached_property
    def identity(self) -> bool:
        """Whether z is x."""
        return bool(ca.is_equal(self.map, self.x))

    @property
    def directions(self) -> ca.SX:
        """dz/dx."""
        return ca.jacobian(self.map, self.x)

    def image(self, x: np.ndarray) -> np.ndarray:
        """z at many points, shape (Nt, n)."""
        if self.identity:
            return x
        return evaluate(self._image, x, self.plant.parameters)[0]

    @property
    def _image(self) -> ca.Function:
        return _function(self.map, self.x, self.p)

    def slopes_at(self, time: np.ndarray, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """d phi/dz at many points, shape (N, n, n), of times (N,), states (N, n) and inputs (N, m)."""
        return evaluate(self._slopes, time[:, None], x, u, self.plant.parameters)[0].reshape(
            -1, *self.slopes_in_x.shape
        )

    @property
    def _slopes(self) -> ca.Function:
        return _function(self.slopes_in_x, self.t, self.x, self.u, self.p)

    @cached_property
    def entries(self) -> dict[tuple[int, int], Enclosure]:
        """The slopes of z that may differ from zero, of (z, u, t), by row and column: none off the chains' triangle.

        Equal ones are one enclosure.
        """
        slopes = self._with_numbers(self.slopes)
        arguments = ca.vertcat(self.z, self.u, self.t)
        places = [(i, j) for i, j in np.ndindex(*slopes.shape) if self.positions[j] <= self.positions[i]]
        found: dict[tuple[int, int], Enclosure] = {}
        for at in places:
            if not slopes[at].is_zero():
                equal = next((other for other in found if ca.is_equal(slopes[other], slopes[at], _DEEP)), None)
                found[at] = _enclosure(arguments, slopes[at]) if equal is None else found[equal]
        return found

    @cached_property
    def along_segments(self) -> Enclosure:
        """``raw`` and ``directions``, column after column, of (variables, u, t)."""
        matrices = ca.vertcat(ca.vec(self.raw), ca.vec(self.directions))
        return _enclosure(ca.vertcat(self.variables, self.u, self.t), self._with_numbers(matrices))

    @cached_property
    def inputs(self) -> Enclosure:
        """The plant's inputs, of time: one for all charts of the same inputs, whatever else the plant's numbers are."""
        symbolic, numbers = self.plant.symbolic, [self.plant.numbers.tobytes()]
        if ca.depends_on(symbolic.inputs, self.p):
            numbers.append(self.plant.parameters.tobytes())
        key = same(symbolic), *numbers
        return _INPUTS.get(key, lambda: _enclosure(self.t, self._with_numbers(self.plant.inputs)))

    def _with_numbers(self, expression: ca.SX) -> ca.SX:
        """An expression with the numbers of the plant's parameters."""
        return ca.substitute(ca.densify(expression), self.p, ca.DM(self.plant.parameters))


def _function(values: ca.SX, *arguments: ca.SX) -> ca.Function:
    """Made once of the same expressions."""
    key = tuple(map(same, (values, *arguments)))
    return _FUNCTIONS.get(key, lambda: ca.Function("f", list(arguments), [ca.densify(values)]))


def _enclosure(arguments: ca.SX, values: ca.SX) -> Enclosure:
    return Enclosure(ca.Function("m", [arguments], [ca.cse(ca.densify(values))]))


def chart_of(form: Form, plant: BuiltPlant) -> Chart:
    """The chart of a plant in an observer's form, made once, wherever the plant starts.

    Raises
    ------
    NoValue
        For forms whose theory is another.
    """
    key = same(form), same(plant.symbolic), plant.parameters.tobytes(), plant.numbers.tobytes()
    return _CHARTS.get(key, lambda: outcome(lambda: _made(form, plant))).value


def _made(form: Form, plant: BuiltPlant) -> Chart:
    if isinstance(form, ChainForm):
        key = same(form), same(plant.symbolic)
        return replace(_OF_FORMS.get(key, lambda: outcome(lambda: _of_chains(form, plant))).value, plant=plant)
    if isinstance(form, BlockForm):
        return _of_triangle(form, plant)
    raise NoValue("the theory of high-gain observers with a Lipschitz constant does not apply to this observer")


def _of_chains(form: ChainForm, plant: BuiltPlant) -> Chart:
    m = form.plant
    positions = np.array([k for length in form.chains for k in range(length)], dtype=int)
    if positions.size > m.n:
        raise NoValue("redundant outputs have a chain each, so z has more components than x")
    z = m.x if form.identity else ca.vertcat(*[ca.SX.sym(f"z{i + 1}") for i in range(m.n)])
    names = _names(form)
    moving = form.jacobian @ m.dynamics  # z'
    raw = ca.jacobian(moving, m.x) - _shift(form) @ form.jacobian
    slopes_in_x = raw if form.identity else ca.solve(form.jacobian.T, raw.T).T
    inverse = z if form.identity else _inverse(form, z)
    slopes = slopes_in_x
    if inverse is not None and not form.identity:
        in_z = ca.substitute(ca.cse(moving), m.x, inverse)
        slopes = ca.jacobian(in_z, z) - _shift(form)
    return Chart(
        names=names,
        positions=positions,
        t=m.t,
        x=m.x,
        z=z,
        u=m.u,
        p=m.p,
        field=m.dynamics,
        slopes=ca.SX(slopes),
        slopes_in_x=ca.SX(slopes_in_x),
        map=form.phi_map,
        variables=m.x,
        raw=ca.SX(raw),
        plant=plant,
        invertible=inverse is not None,
    )


def _names(form: ChainForm) -> tuple[str, ...]:
    """What z_i are called: like the states, where they are these in some order."""
    m, z = form.plant, form.phi_map
    order = [next((k for k in range(m.n) if ca.is_equal(z[i], m.x[k])), None) for i in range(m.n)]
    known = tuple(m.states[k] for k in order if k is not None)
    return known if len(known) == m.n else tuple(f"z{i + 1}" for i in range(m.n))


def _shift(form: ChainForm) -> ca.SX:
    """The links of the chains: z' = shift z + phi."""
    return ca.SX(ca.diagcat(*[ca.DM(np.eye(length, k=1)) for length in form.chains]))


def _inverse(form: ChainForm, z: ca.SX) -> ca.SX | None:
    """x of z: that of a linear map, or the plant's own."""
    m = form.plant
    if not ca.depends_on(form.jacobian, m.x):
        offset = ca.substitute(form.phi_map, m.x, ca.SX.zeros(m.n))
        return ca.solve(form.jacobian, z - offset)
    return None if m.inverse is None else m.inverse(z, m.p)


def _of_triangle(form: BlockForm, plant: BuiltPlant) -> Chart:
    m, outer = form.model, form.plant
    positions = np.array(form.block, dtype=int)
    links = positions[None, :] == positions[:, None] + 1
    jacobian = ca.jacobian(m.dynamics, m.x)
    _require_affine(form, plant, [(int(i), int(j)) for i, j in zip(*np.nonzero(links), strict=True)])
    slopes = jacobian * ca.DM(~links)
    in_plant = form.coordinates(False)
    in_x = ca.substitute(slopes, m.x, in_plant)
    return Chart(
        names=m.states,
        positions=positions,
        t=m.t,
        x=outer.x,
        z=m.x,
        u=m.u,
        p=m.p,
        field=outer.dynamics,
        slopes=slopes,
        slopes_in_x=ca.SX(in_x),
        map=in_plant,
        variables=m.x,
        raw=slopes,
        plant=plant,
        invertible=True,
    )


def _require_affine(form: BlockForm, plant: BuiltPlant, links: list[tuple[int, int]]) -> None:
    """f^(k) = F_k(u, x^(1)..x^(k)) x^(k+1) + phi^(k): decided at random points, since symbols may hide it."""
    m, block = form.model, form.block
    z = ca.Function("z", [form.plant.x, form.plant.p], [form.coordinates(False)])(plant.initial, plant.parameters)
    points = around(np.asarray(z.full()).ravel(), m.states)[1:]
    for i, j in links:
        slope = ca.jacobian(m.dynamics[i], m.x[j])
        places = [k for k in range(m.n) if block[k] == block[j]]
        following = ca.vertcat(*[m.x[k] for k in places])
        curvature = ca.Function("c", [m.t, m.x, m.u, m.p], [slope, ca.densify(ca.jacobian(slope, following))])
        for at in instants(points, m.u.numel()):
            first, second = curvature(at.t, at.x, at.u, plant.parameters)
            change = float(np.max(np.abs(np.asarray(second.full()).ravel() * at.x[places])))
            if change > _CURVED * abs(float(first)):
                raise NoValue(
                    f"the derivative of {m.states[i]} is not affine in {m.states[j]}: F(u, xhat) x + phi(u, x) of "
                    "the theorem is not the plant"
                )
