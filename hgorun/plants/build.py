"""From a plant block to a symbolic model with numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from hgorun.config.controller import DRIVEN, Controller
from hgorun.config.expressions import CONSTANTS
from hgorun.config.reads import Reads
from hgorun.errors import Problem, called
from hgorun.memo import Memo
from hgorun.plants.base import Invertible, Plant, TriangularCoordinates, units_of
from hgorun.plants.control import ControlLaw, ControlTexts, Space, driven_of
from hgorun.plants.expressions import Signals, disturbance_of, inputs_of, parameter_values, parameters_of, require_known
from hgorun.plants.undeclared import constants_told, require_readable
from hgorun.symbolic.clock import on_the_clock
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.symbols import Symbols

Map: TypeAlias = Callable[[ca.SX, ca.SX], ca.SX]


@dataclass(frozen=True, eq=False, repr=False)
class SymbolicPlant:
    """A plant without numbers: one object for all plants that differ in nothing else.

    Attributes
    ----------
    model : PlantModel
    numbers : casadi.SX
        Symbols for the numbers written in the expressions of inputs and disturbance.
    inputs, disturbance : casadi.SX
        u(t) and what is added to x', as expressions of the model's t and p and of the numbers. An input that a
        controller drives is its own symbol, the model's u.
    controller : ControlLaw, optional
    """

    model: PlantModel
    numbers: ca.SX
    inputs: ca.SX
    disturbance: ca.SX
    controller: ControlLaw | None = None

    @property
    def everything(self) -> ca.SX:
        """All that is a number in a run: the model's p, then the numbers."""
        return ca.vertcat(self.model.p, self.numbers)


@dataclass(frozen=True, eq=False, repr=False)
class BuiltPlant:
    """A plant ready to be simulated.

    Attributes
    ----------
    symbolic : SymbolicPlant
    parameters, numbers, initial : ndarray
        Values of the model's p and of the numbers in the expressions, and x(start), shape (n,).
    """

    block: Plant
    symbolic: SymbolicPlant
    parameters: np.ndarray
    numbers: np.ndarray
    initial: np.ndarray

    @property
    def model(self) -> PlantModel:
        """Names and equations."""
        return self.symbolic.model

    @property
    def everything(self) -> np.ndarray:
        """Values of :attr:`SymbolicPlant.everything`."""
        return np.concatenate([self.parameters, self.numbers])

    @cached_property
    def inputs(self) -> ca.SX:
        """u(t), an expression of the model's t and p."""
        return ca.substitute(self.symbolic.inputs, self.symbolic.numbers, ca.SX(ca.DM(self.numbers)))

    @cached_property
    def disturbance(self) -> ca.SX:
        """What is added to x', an expression of the model's t and p."""
        return ca.substitute(self.symbolic.disturbance, self.symbolic.numbers, ca.SX(ca.DM(self.numbers)))

    @property
    def units(self) -> dict[str, str]:
        """Units of inputs, states and outputs, where the plant states them; an output that is a state has its unit."""
        stated = units_of(self.block)
        measured = {output: stated[state] for output, state in self.model.measures.items() if state in stated}
        return measured | stated


# buckets of plants that agree in their names and signals; what else of their blocks matters is in the reads
_BUILT: Memo[list[tuple[Reads[Plant], SymbolicPlant]]] = Memo(64)
_BUCKET = 16  # plants in a bucket


def build_plant(block: Plant, origin: float = 0.0, controller: Controller | None = None) -> BuiltPlant:
    """Build the model, or take the one of a plant that differs in its numbers only.

    Parameters
    ----------
    block : Plant
    origin : float
        The time, on the clock of the block's expressions, from which the model counts its t.
    controller : Controller, optional
        That drives some of its inputs.

    Raises
    ------
    Problem
        With the path inside the file, starting at ``plant`` or at ``controller``.
    """
    states, outputs, inputs = block.state_names, block.output_names, block.input_names
    _require_distinct({"states": states, "inputs": inputs})
    if "t" in outputs:
        raise Problem(("plant", "output"), _twice("t", "time", "output"))
    require_known(
        (("plant", "inputs"), block.inputs, inputs),
        (("plant", "initial"), block.initial, states),
        (("plant", "disturbance"), block.disturbance, states),
        parameters_of(block),
    )
    block.require_fit()
    values = parameter_values(block)
    _require_distinct({"states": states, "inputs": inputs, "parameters": tuple(values)})
    for name in inputs:
        if name not in block.inputs:
            raise Problem(("plant", "inputs"), f"input {name} is missing; give an expression of t")
    missing = [s for s in states if s not in block.initial]
    if missing:
        raise Problem(("plant", "initial"), f"the initial value of {', '.join(missing)} is missing")
    known = (*values, "t")
    control = None if controller is None else ControlTexts.of(controller, block, tuple(values))
    driven = () if DRIVEN in values else driven_of(block)
    if control is None and driven:
        raise Problem(("plant", "inputs", driven[0]), f"there is no block {DRIVEN} that gives its law")
    given = {name: text for name, text in block.inputs.items() if name not in driven}
    with constants_told(block):
        signals = inputs_of(tuple(given.items()), known), disturbance_of(tuple(block.disturbance.items()), known)
    key = type(block), origin, states, outputs, inputs, tuple(values), *(s.templates for s in signals)
    key = (*key, None if control is None else control.structure)
    bucket = _BUILT.get(key, list)
    symbolic = next((plant for reads, plant in bucket if reads.hold_for(block)), None)
    if symbolic is None:
        reads = Reads(block)
        symbolic = _symbolic(block, origin, reads.watched, tuple(values), *signals, control)
        bucket.append((reads, symbolic))
        del bucket[:-_BUCKET]
    numbers = [v for s in signals for part in s.numbers for v in part]
    numbers += [] if control is None else control.numbers
    return BuiltPlant(
        block,
        symbolic,
        np.array(list(values.values()), dtype=float),
        np.array(numbers, dtype=float),
        np.array([block.initial[s] for s in states], dtype=float),
    )


def _symbolic(
    block: Plant,
    origin: float,
    watched: Plant,
    parameters: tuple[str, ...],
    inputs: Signals,
    disturbance: Signals,
    control: ControlTexts | None,
) -> SymbolicPlant:
    states, outputs, input_names = block.state_names, block.output_names, block.input_names
    more = () if control is None else control.names
    t = ca.SX.sym("t")
    x, u, p, numbers = (
        ca.vertcat(*[ca.SX.sym(n) for n in names])
        for names in (states, input_names, parameters, (*inputs.names, *disturbance.names, *more))
    )
    spaces = [_named(names, v) for names, v in ((states, x), (input_names, u), (parameters, p))]
    clock = on_the_clock(t, origin)
    dynamics, output = _equations(block, watched, clock, *spaces)
    inverse, (transform, back) = _inverse(block, watched, parameters), _triangular(block, watched, states, parameters)
    periods = tuple(watched.periods.get(name) for name in outputs)
    model = PlantModel(
        states=states,
        outputs=outputs,
        inputs=input_names,
        parameters=parameters,
        t=t,
        x=x,
        u=u,
        p=p,
        dynamics=dynamics,
        output=output,
        inverse=inverse,
        transform=transform,
        untransform=back,
        periods=periods,
    )
    symbols = {**vars(spaces[2]), "t": clock}
    first, own = len(inputs.names), len(inputs.names) + len(disturbance.names)
    found = inputs.symbols(symbols, numbers[:first], chained=True)
    pushed = disturbance.symbols(symbols, numbers[first:own], chained=False)
    law = None
    if control is not None:
        named = {**symbols, **vars(spaces[0]), **vars(spaces[1])}
        law = control.built(input_names, Space(t, x, u, named, ca.vertcat(p, numbers), numbers[own:]))
    return SymbolicPlant(
        model,
        numbers,
        ca.vertcat(*[found.get(name, u[i]) for i, name in enumerate(input_names)]) if input_names else ca.SX(0, 1),
        ca.vertcat(*[pushed.get(state, ca.SX(0)) for state in states]),
        law,
    )


def _named(names: Sequence[str], values: ca.SX) -> Symbols:
    return Symbols(dict(zip(names, ca.vertsplit(values) if values.numel() else [], strict=True)))


def _inverse(block: Plant, watched: Any, parameters: Sequence[str]) -> Map | None:
    """x of the canonical coordinates, where the plant knows it."""
    if not isinstance(block, Invertible):
        return None
    return lambda z, p: ca.vertcat(*watched.inverse(z, _named(parameters, p)))


def _triangular(
    block: Plant, watched: Any, states: Sequence[str], parameters: Sequence[str]
) -> tuple[Map, Map] | tuple[None, None]:
    """(T, T^-1) of the coordinates where the plant is triangular, if it gives any."""
    if not isinstance(block, TriangularCoordinates):
        return None, None
    return (
        lambda x, p: ca.vertcat(*watched.to_triangular(_named(states, x), _named(parameters, p))),
        lambda z, p: ca.vertcat(*watched.from_triangular(z, _named(parameters, p))),
    )


def _equations(block: Plant, watched: Plant, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[ca.SX, ca.SX]:
    values = {**vars(p), **vars(u), **vars(x), "t": t}
    for place, text in block.expressions().items():
        require_readable(("plant", *place), text, values, tuple(vars(x)))
    with called("plant", block.type, "equations"):
        dynamics, output = watched.equations(t, x, u, p)
        return ca.SX(ca.vertcat(*dynamics)), ca.SX(ca.vertcat(*output))


def _require_distinct(groups: Mapping[str, tuple[str, ...]]) -> None:
    owner: dict[str, str] = {"t": "time", **dict.fromkeys(CONSTANTS, "a constant")}
    for group, names in groups.items():
        for name in names:
            if name in owner:
                raise Problem(("plant", group), _twice(name, owner[name], group))
            owner[name] = group


def _twice(name: str, one: str, other: str) -> str:
    return f"{name!r} is a name of {one} and of {other}; names must differ: call this one otherwise, such as {name}_"
