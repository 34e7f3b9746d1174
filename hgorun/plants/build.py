"""From a plant block to a symbolic model with numbers."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from hgorun.config.expressions import CONSTANTS, Expression, ExpressionError, nearest, parse
from hgorun.config.literals import Template, template
from hgorun.config.reads import Reads
from hgorun.errors import KeyPath, Problem, called
from hgorun.memo import Memo
from hgorun.plants.base import Invertible, Plant, TriangularCoordinates, units_of
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
        u(t) and what is added to x', as expressions of the model's t and p and of the numbers.
    """

    model: PlantModel
    numbers: ca.SX
    inputs: ca.SX
    disturbance: ca.SX

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
        """Units of states and outputs, where the plant states them."""
        return units_of(self.block)


@dataclass(frozen=True, eq=False, repr=False)
class _Signals:
    """Expressions of time by the name of what they are for, their numbers apart."""

    key: str
    templates: tuple[tuple[str, Template], ...]
    numbers: tuple[tuple[float, ...], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """A name for every number."""
        return tuple(
            f"{self.key}.{name}[{i}]"
            for (name, _), numbers in zip(self.templates, self.numbers, strict=True)
            for i in range(len(numbers))
        )

    def symbols(self, values: Mapping[str, ca.SX], numbers: ca.SX, *, chained: bool) -> dict[str, ca.SX]:
        """The expressions, from symbols for their numbers; ``chained``: they may use each other."""
        known, found, start = dict(values), {}, 0
        for (name, template_), count in zip(self.templates, map(len, self.numbers), strict=True):
            found[name] = template_.symbol(known, numbers[start : start + count])
            start += count
            if chained:
                known[name] = found[name]
        return found


# buckets of plants that agree in their names and signals; what else of their blocks matters is in the reads
_BUILT: Memo[list[tuple[Reads[Plant], SymbolicPlant]]] = Memo(64)
_BUCKET = 16  # plants in a bucket


def build_plant(block: Plant, origin: float = 0.0) -> BuiltPlant:
    """Build the model, or take the one of a plant that differs in its numbers only.

    Parameters
    ----------
    block : Plant
    origin : float
        The time, on the clock of the block's expressions, from which the model counts its t.

    Raises
    ------
    Problem
        With the path inside the file, starting at ``plant``.
    """
    states, outputs, inputs = block.state_names, block.output_names, block.input_names
    _require_distinct({"states": states, "inputs": inputs})
    _require_known("plant", "inputs", block.inputs, inputs)
    _require_known("plant", "initial", block.initial, states)
    _require_known("plant", "disturbance", block.disturbance, states)
    block.require_fit()
    values = _parameter_values(block)
    _require_distinct({"states": states, "inputs": inputs, "parameters": tuple(values)})
    for name in inputs:
        if name not in block.inputs:
            raise Problem(("plant", "inputs"), f"input {name} is missing; give an expression of t")
    missing = [s for s in states if s not in block.initial]
    if missing:
        raise Problem(("plant", "initial"), f"the initial value of {', '.join(missing)} is missing")
    known = (*values, "t")
    signals = _inputs(tuple(block.inputs.items()), known), _disturbance(tuple(block.disturbance.items()), known)
    key = type(block), origin, states, outputs, inputs, tuple(values), *(s.templates for s in signals)
    bucket = _BUILT.get(key, list)
    symbolic = next((plant for reads, plant in bucket if reads.hold_for(block)), None)
    if symbolic is None:
        reads = Reads(block)
        symbolic = _symbolic(block, origin, reads.watched, tuple(values), *signals)
        bucket.append((reads, symbolic))
        del bucket[:-_BUCKET]
    numbers = [v for s in signals for part in s.numbers for v in part]
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
    inputs: _Signals,
    disturbance: _Signals,
) -> SymbolicPlant:
    states, outputs, input_names = block.state_names, block.output_names, block.input_names
    t = ca.SX.sym("t")
    x, u, p, numbers = (
        ca.vertcat(*[ca.SX.sym(n) for n in names])
        for names in (states, input_names, parameters, (*inputs.names, *disturbance.names))
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
    first = len(inputs.names)
    found = inputs.symbols(symbols, numbers[:first], chained=True)
    pushed = disturbance.symbols(symbols, numbers[first:], chained=False)
    return SymbolicPlant(
        model,
        numbers,
        ca.vertcat(*[found[name] for name in input_names]) if input_names else ca.SX(0, 1),
        ca.vertcat(*[pushed.get(state, ca.SX(0)) for state in states]),
    )


Texts: TypeAlias = tuple[tuple[str, str], ...]


@lru_cache(maxsize=256)  # of a family of plants most have the same
def _inputs(texts: Texts, known: tuple[str, ...]) -> _Signals:
    return _signals("inputs", _ordered(("plant", "inputs"), dict(texts), known))


@lru_cache(maxsize=256)
def _disturbance(texts: Texts, known: tuple[str, ...]) -> _Signals:
    return _signals("disturbance", [(s, _read(("plant", "disturbance", s), text, known)) for s, text in texts])


def _signals(key: str, expressions: list[tuple[str, Expression]]) -> _Signals:
    templates, numbers = [], []
    for name, expression in expressions:
        try:
            lifted, values = template(expression)
        except ExpressionError as error:
            raise Problem(("plant", key, name), str(error)) from error
        templates.append((name, lifted))
        numbers.append(values)
    return _Signals(key, tuple(templates), tuple(numbers))


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
        _symbol(("plant", *place), text, values)
    with called("plant", block.type, "equations"):
        dynamics, output = watched.equations(t, x, u, p)
        return ca.SX(ca.vertcat(*dynamics)), ca.SX(ca.vertcat(*output))


def _symbol(path: KeyPath, text: str, values: Mapping[str, ca.SX]) -> ca.SX:
    """An expression of known names as a symbolic one."""
    try:
        return parse(text, names=values).symbol(values)
    except ExpressionError as error:
        raise Problem(path, str(error)) from error


def _read(path: KeyPath, text: str, names: Collection[str]) -> Expression:
    try:
        return parse(text, names=names)
    except ExpressionError as error:
        raise Problem(path, str(error)) from error


def _require_known(block: str, key: str, given: Collection[str], known: Collection[str]) -> None:
    for name in given:
        if name not in known:
            allowed = ", ".join(known) or "none"
            raise Problem((block, key, name), f"unknown name {name!r}; known here: {allowed}.{nearest(name, known)}")


def _require_distinct(groups: Mapping[str, tuple[str, ...]]) -> None:
    owner: dict[str, str] = {"t": "time", **dict.fromkeys(CONSTANTS, "a constant")}
    for group, names in groups.items():
        for name in names:
            if name in owner:
                message = f"{name!r} is a name of {owner[name]} and of {group}; names must differ"
                raise Problem(("plant", group), message)
            owner[name] = group


def _ordered(path: KeyPath, texts: Mapping[str, str], outer: Collection[str]) -> list[tuple[str, Expression]]:
    """Definitions that may refer to each other, in the order in which they can be evaluated."""
    parsed = {}
    for name, text in texts.items():
        try:
            parsed[name] = parse(text, names=[*outer, *texts])
        except ExpressionError as error:
            raise Problem((*path, name), str(error)) from error
    done: dict[str, Expression] = {}
    while len(done) < len(parsed):
        ready = [n for n, e in parsed.items() if n not in done and all(d in done for d in e.names if d in parsed)]
        if not ready:
            circle = sorted(set(parsed) - set(done))
            raise Problem((*path, circle[0]), f"{', '.join(circle)} are defined in terms of each other")
        done.update({name: parsed[name] for name in ready})
    return list(done.items())


def _parameter_values(block: Plant) -> dict[str, float]:
    known = block.known_parameters
    if known:
        _require_known("plant", "parameters", block.parameters, known)
    texts = {name: repr(q.default) for name, q in known.items() if q.default is not None} | dict(block.parameters)
    missing = [name for name in known if name not in texts]
    if missing:
        raise Problem(("plant", "parameters"), f"the value of {', '.join(missing)} is missing")
    values = _values(tuple(texts.items()))
    order = [*known, *(n for n in texts if n not in known)]
    return {name: values[name] for name in order}


@lru_cache(maxsize=256)
def _values(texts: Texts) -> dict[str, float]:
    values: dict[str, float] = {}
    for name, expression in _ordered(("plant", "parameters"), dict(texts), ()):
        try:
            values[name] = expression.number(values)
        except ExpressionError as error:
            raise Problem(("plant", "parameters", name), str(error)) from error
    return values
