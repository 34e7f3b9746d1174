"""What every plant must keep."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.errors import NotObservableForm
from hgorun.plants.base import PLANTS, Plant, is_plant, units_of
from hgorun.plants.build import BuiltPlant, build_plant
from hgorun.symbolic.observability import canonical_form
from hgorun.symbolic.triangular import triangular_form
from hgorun.testing.cases import Keys, block_of
from hgorun.testing.contract import Broken, Law, NotApplicable, Report, hold_to, keys_are_described

POINTS = 5  # random ones
SLOPE = 1e-5  # of a difference quotient, relative to the largest slope
BACK = 1e-8  # relative error of a map and its inverse, one after the other


def check_plant(cls: type[Plant], block: Keys | None = None, *, skip: Collection[str] = ()) -> Report:
    """Hold a class of plants to the laws that the rest of hgorun relies on.

    Parameters
    ----------
    cls : type
        The class; it need not be registered.
    block : mapping, optional
        Keys of its block, as in a configuration; best with an ``initial`` state that is typical. Where they
        are left out, every state starts between 0.5 and 1, inputs are 0.1, and ``cls.example`` goes before
        both.
    skip : collection of str
        Names of laws that are not checked.

    Returns
    -------
    Report

    Raises
    ------
    ContractError
        For the first law that is broken: its name, what was found and what would be right.
    """
    if not is_plant(cls):
        raise TypeError(f"check_plant takes a concrete class of plants, found {cls!r}")
    return hold_to(cls.__name__, Subject(cls, dict(block or {})), LAWS, skip)


@dataclass(frozen=True)
class Subject:
    """A class of plants with a block."""

    cls: type[Plant]
    keys: Keys

    def block(self, cls: type[Plant] | None = None) -> Plant:
        """The block, checked; of another class where one is given."""
        cls = self.cls if cls is None else cls
        names = [name for name, known in PLANTS.all().items() if known is self.cls]
        keys = {"type": names[0] if names else cls.__name__, **cls.example(), **self.keys}
        bare = block_of(cls, {"inputs": dict.fromkeys(cls.known_inputs, 0.1), **keys})
        start = dict(zip(bare.state_names, np.linspace(0.5, 1.0, len(bare.state_names)).tolist(), strict=True))
        return block_of(cls, {"inputs": dict.fromkeys(cls.known_inputs, 0.1), "initial": start, **keys})

    @cached_property
    def built(self) -> BuiltPlant:
        """The plant with its numbers."""
        return build_plant(self.block())

    @cached_property
    def points(self) -> list[np.ndarray]:
        """The initial state, and random ones around it."""
        random = np.random.default_rng(1)
        at = self.built.initial
        around = [at * (1 + 0.1 * random.uniform(-1, 1, at.size)) for _ in range(POINTS - 1)]
        return [at, *around]

    def function(self, *expressions: ca.SX) -> Callable[[np.ndarray], list[np.ndarray]]:
        """x -> values of expressions of the model's t, x, u, p, at t = 0.3."""
        model, plant = self.built.model, self.built
        written = [ca.densify(ca.substitute(ca.SX(e), model.u, plant.inputs)) for e in expressions]
        f = ca.Function("plant", [model.t, model.x, model.p], written)

        def values(x: np.ndarray) -> list[np.ndarray]:
            found = f(0.3, x, plant.parameters)
            return [np.asarray(v.full()) for v in (found if isinstance(found, tuple) else (found,))]

        return values


def _names(subject: Subject) -> None:
    block, model = subject.block(), subject.built.model
    for what, names in (("states", block.state_names), ("outputs", block.output_names)):
        if not names or len(set(names)) < len(names):
            raise Broken(f"{what} {names}", "one name each, at least one")
    for what, names, found in (
        ("right-hand sides", model.states, model.dynamics),
        ("outputs", model.outputs, model.output),
    ):
        if found.shape != (len(names), 1):
            raise Broken(f"{found.shape[0]} {what}", f"{len(names)}, one each of {', '.join(names)}")


def _finite(subject: Subject) -> None:
    model = subject.built.model
    values = subject.function(model.dynamics, model.output)
    for x in subject.points:
        for what, found in zip(("the right-hand sides", "the outputs"), values(x), strict=True):
            if not np.all(np.isfinite(found)):
                raise Broken(f"{what} {found.ravel()} at x = {x}", "finite numbers at and around the initial state")


def _repeatable(subject: Subject) -> None:
    _equal(subject, _another(subject), "built again", "the same equations every time")


def _another(subject: Subject, **changes: object) -> Subject:
    """The same plant as a class of its own: what was built for the first is not taken from memory."""
    cls = subject.cls
    return Subject(type(cls.__name__, (cls,), {"__module__": cls.__module__, **changes}), subject.keys)


def _equal(one: Subject, other: Subject, how: str, expected: str) -> None:
    maps = [
        subject.function(
            subject.built.model.dynamics,
            subject.built.model.output,
            *(
                f(subject.built.model.x, subject.built.model.p)
                for f in (subject.built.model.inverse, subject.built.model.transform, subject.built.model.untransform)
                if f is not None
            ),
        )
        for subject in (one, other)
    ]
    for x in one.points:
        for first, second in zip(maps[0](x), maps[1](x), strict=True):
            if not np.array_equal(first, second, equal_nan=True):
                raise Broken(f"{second.ravel()} in place of {first.ravel()} {how}, at x = {x}", expected)


def _order(subject: Subject) -> None:
    known = subject.cls.known_parameters
    if len(known) < 2:
        raise NotApplicable("it has no two parameters")
    other = _another(subject, known_parameters=dict(reversed(list(known.items()))))
    _equal(subject, other, "with its parameters declared in another order", "numbers that belong to names")


def _slopes(subject: Subject) -> None:
    model = subject.built.model
    both = ca.vertcat(model.dynamics, model.output)
    values, slopes = subject.function(both), subject.function(ca.jacobian(both, model.x))
    for x in subject.points:
        (jacobian,) = slopes(x)
        step = 1e-6 * np.maximum(np.abs(x), 1e-2)
        quotient = np.column_stack(
            [(values(x + h)[0] - values(x - h)[0])[:, 0] / (2 * h[i]) for i, h in enumerate(np.diag(step))]
        )
        off = np.abs(jacobian - quotient)
        if not np.max(off) <= SLOPE * (1 + np.max(np.abs(quotient))):
            i, j = np.unravel_index(int(np.argmax(np.where(np.isfinite(off), off, np.inf))), off.shape)
            names = [*model.states, *model.outputs]
            raise Broken(
                f"the slope {jacobian[i, j]:.6g} of {names[i]} in {model.states[j]} at x = {x}",
                f"the difference quotient {quotient[i, j]:.6g}: equations that can be differentiated",
            )


def _inverse(subject: Subject) -> None:
    model, plant = subject.built.model, subject.built
    if model.inverse is None:
        raise NotApplicable("it declares no inverse of its canonical map")
    form = canonical_form(model, plant.initial, plant.parameters)
    _leads_back(subject, model.inverse(form.phi_map, model.p), "inverse(Phi(x))")


def _triangular(subject: Subject) -> None:
    model, plant = subject.built.model, subject.built
    if model.transform is None or model.untransform is None:
        raise NotApplicable("it declares no triangular coordinates")
    _leads_back(
        subject, model.untransform(model.transform(model.x, model.p), model.p), "from_triangular(to_triangular(x))"
    )
    try:
        triangular_form(model, plant.initial, plant.parameters)
    except NotObservableForm as error:
        raise Broken(f"a model that is not triangular in them: {error}", "coordinates where it is") from error


def _leads_back(subject: Subject, both: ca.SX, what: str) -> None:
    values = subject.function(both)
    for x in subject.points:
        (found,) = values(x)
        if not np.allclose(found[:, 0], x, rtol=BACK, atol=BACK * np.max(np.abs(x))):
            raise Broken(f"{what} = {found[:, 0]} at x = {x}", "x itself")


def _declared(subject: Subject) -> None:
    cls, model = subject.cls, subject.built.model
    known = {*model.inputs, *model.states, *model.outputs}
    for name in units_of(cls):
        if name not in known:
            expected = f"units of inputs, states and outputs alone: {', '.join(sorted(known))}"
            raise Broken(f"a unit of {name!r}", expected)
    everything = ca.vertcat(model.dynamics, model.output)
    for i, name in enumerate(model.parameters):
        if name in cls.known_parameters and not ca.depends_on(everything, model.p[i]):
            raise Broken(f"the parameter {name}, which no equation holds", "parameters that matter")
    for i, name in enumerate(model.inputs):
        if name in cls.known_inputs and not ca.depends_on(everything, model.u[i]):
            raise Broken(f"the input {name}, which no equation holds", "inputs that matter")


def _explains_itself(subject: Subject) -> None:
    cls = subject.cls
    if not cls.__doc__:  # its own: inspect.getdoc would find that of a base
        raise Broken("no docstring", "one with the equations and what the states are")
    if not cls.reference:
        raise Broken("an empty `reference`", "the publication that the equations are from")
    if not cls.valid:
        raise Broken("an empty `valid`", "where the equations hold, such as x1 > 0, or `everywhere`")
    meanings = {name: declared.meaning for name, declared in cls.known_parameters.items()}
    for name, meaning in {
        **meanings,
        **{name: declared.meaning for name, declared in cls.known_inputs.items()},
    }.items():
        if not meaning:
            raise Broken(f"{name} without a meaning", "a meaning of every parameter and input")
    keys_are_described(cls)


LAWS: tuple[Law[Subject], ...] = (
    Law("names", "as many equations as names", _names),
    Law("finite", "its equations are numbers at and around the initial state", _finite),
    Law("repeatable", "built again it is the same", _repeatable),
    Law("order of parameters", "the order of known_parameters changes nothing", _order),
    Law("slopes", "the derivatives of its equations are their slopes", _slopes),
    Law("inverse", "the inverse of the canonical map leads back", _inverse),
    Law("triangular coordinates", "they lead back, and the model is triangular there", _triangular),
    Law("declarations", "units, parameters and inputs are those of its equations", _declared),
    Law("documentation", "it explains itself", _explains_itself),
)
