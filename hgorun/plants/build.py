"""From a plant block to a symbolic model with numbers."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca
import numpy as np

from hgorun.config.expressions import Expression, ExpressionError, nearest, parse
from hgorun.errors import Problem
from hgorun.plants.base import Invertible, Plant, TriangularCoordinates
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.symbols import Symbols

Map: TypeAlias = Callable[[ca.SX, ca.SX], ca.SX]


@dataclass(frozen=True)
class BuiltPlant:
    """A plant ready to be simulated.

    Attributes
    ----------
    model : PlantModel
    parameters, initial : ndarray
        Values of the model's parameters, shape (number of parameters,), and x(start), shape (n,).
    inputs, disturbance : casadi.SX
        u(t) and what is added to x', as expressions of the model's t and p.
    units : mapping of str to str
    """

    block: Plant
    model: PlantModel
    parameters: np.ndarray
    initial: np.ndarray
    inputs: ca.SX
    disturbance: ca.SX

    @property
    def units(self) -> dict[str, str]:
        """Units of states and outputs, where the plant states them."""
        return dict(self.block.units)


def build_plant(block: Plant) -> BuiltPlant:
    """Build the model.

    Raises
    ------
    Problem
        With the path inside the file, starting at ``plant``.
    """
    states, outputs, inputs = block.state_names, block.output_names, block.input_names
    _require_known("plant", "inputs", block.inputs, inputs)
    _require_known("plant", "initial", block.initial, states)
    _require_known("plant", "disturbance", block.disturbance, states)
    block.check()
    values = _parameter_values(block)
    _require_distinct({"states": states, "inputs": inputs, "parameters": tuple(values)})
    for name in inputs:
        if name not in block.inputs:
            raise Problem(("plant", "inputs"), f"input {name} is missing; give an expression of t")
    missing = [s for s in states if s not in block.initial]
    if missing:
        raise Problem(("plant", "initial"), f"the initial value of {', '.join(missing)} is missing")

    t = ca.SX.sym("t")
    x, u, p = (ca.vertcat(*[ca.SX.sym(n) for n in names]) for names in (states, inputs, tuple(values)))
    spaces = [_named(names, v) for names, v in ((states, x), (inputs, u), (tuple(values), p))]
    dynamics, output = _equations(block, t, *spaces)
    names = tuple(values)
    maps = (_inverse(block, names), *_triangular(block, states, names))
    model = PlantModel(states, outputs, inputs, names, t, x, u, p, dynamics, output, *maps)
    symbols = {**vars(spaces[2]), "t": t}
    return BuiltPlant(
        block,
        model,
        np.array(list(values.values()), dtype=float),
        np.array([block.initial[s] for s in states], dtype=float),
        _inputs(block, inputs, symbols),
        _disturbance(block, states, symbols),
    )


def _named(names: Sequence[str], values: ca.SX) -> Symbols:
    return Symbols(dict(zip(names, ca.vertsplit(values) if values.numel() else [], strict=True)))


def _inverse(block: Plant, parameters: Sequence[str]) -> Map | None:
    """x of the canonical coordinates, where the plant knows it."""
    if not isinstance(block, Invertible):
        return None
    return lambda z, p: ca.vertcat(*block.inverse(z, _named(parameters, p)))


def _triangular(block: Plant, states: Sequence[str], parameters: Sequence[str]) -> tuple[Map, Map] | tuple[None, None]:
    """(T, T^-1) of the coordinates where the plant is triangular, if it gives any."""
    if not isinstance(block, TriangularCoordinates):
        return None, None
    return (
        lambda x, p: ca.vertcat(*block.to_triangular(_named(states, x), _named(parameters, p))),
        lambda z, p: ca.vertcat(*block.from_triangular(z, _named(parameters, p))),
    )


def _equations(block: Plant, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[ca.SX, ca.SX]:
    values = {**vars(p), **vars(u), **vars(x), "t": t}
    for place, text in block.expressions().items():
        _symbol(("plant", *place), text, values)
    dynamics, output = block.equations(t, x, u, p)
    return ca.SX(ca.vertcat(*dynamics)), ca.SX(ca.vertcat(*output))


def _symbol(path: tuple[str | int, ...], text: str, values: Mapping[str, ca.SX]) -> ca.SX:
    """An expression of known names as a symbolic one."""
    try:
        return parse(text, names=values).symbol(values)
    except ExpressionError as error:
        raise Problem(path, str(error)) from error


def _require_known(block: str, key: str, given: Collection[str], known: Collection[str]) -> None:
    for name in given:
        if name not in known:
            allowed = ", ".join(known) or "none"
            raise Problem((block, key, name), f"unknown name {name!r}; known here: {allowed}.{nearest(name, known)}")


def _require_distinct(groups: Mapping[str, tuple[str, ...]]) -> None:
    owner: dict[str, str] = {"t": "time"}
    for group, names in groups.items():
        for name in names:
            if name in owner:
                raise Problem(("plant",), f"{name!r} is a name of {owner[name]} and of {group}; names must differ")
            owner[name] = group


def _ordered(
    path: tuple[str | int, ...], texts: Mapping[str, str], outer: Collection[str]
) -> list[tuple[str, Expression]]:
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
            raise Problem((*path, circle[0]), f"{', '.join(circle)} are defined through each other, in a circle")
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
    values: dict[str, float] = {}
    for name, expression in _ordered(("plant", "parameters"), texts, ()):
        try:
            values[name] = expression.number(values)
        except ExpressionError as error:
            raise Problem(("plant", "parameters", name), str(error)) from error
    order = [*known, *(n for n in texts if n not in known)]
    return {name: values[name] for name in order}


def _inputs(block: Plant, names: tuple[str, ...], symbols: Mapping[str, ca.SX]) -> ca.SX:
    found = dict(symbols)
    for name, _ in _ordered(("plant", "inputs"), block.inputs, symbols):
        found[name] = _symbol(("plant", "inputs", name), block.inputs[name], found)
    return ca.vertcat(*[found[name] for name in names]) if names else ca.SX(0, 1)


def _disturbance(block: Plant, states: tuple[str, ...], symbols: Mapping[str, ca.SX]) -> ca.SX:
    parts = [ca.SX(0)] * len(states)
    for name, text in block.disturbance.items():
        parts[states.index(name)] = _symbol(("plant", "disturbance", name), text, symbols)
    return ca.vertcat(*parts)
