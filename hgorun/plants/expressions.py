"""The expressions of a plant's block: its parameters, and inputs and disturbance with their numbers apart."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import casadi as ca

from hgorun.config.expressions import Expression, ExpressionError, nearest, parse
from hgorun.config.literals import Template, template
from hgorun.errors import KeyPath, Problem
from hgorun.plants.base import Plant


@dataclass(frozen=True, eq=False, repr=False)
class Signals:
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


Texts: TypeAlias = tuple[tuple[str, str], ...]


@lru_cache(maxsize=256)  # of a family of plants most have the same
def inputs_of(texts: Texts, known: tuple[str, ...]) -> Signals:
    return _signals(("plant", "inputs"), _ordered(("plant", "inputs"), dict(texts), known))


def signals_of(path: KeyPath, texts: Mapping[str, str], known: Collection[str]) -> Signals:
    """Expressions of known names at a place in the file."""
    read = [(name, _read((*path, name), text, known)) for name, text in texts.items()]
    return _signals(path, read)


@lru_cache(maxsize=256)
def disturbance_of(texts: Texts, known: tuple[str, ...]) -> Signals:
    return signals_of(("plant", "disturbance"), dict(texts), known)


def _signals(path: KeyPath, expressions: list[tuple[str, Expression]]) -> Signals:
    templates, numbers = [], []
    for name, expression in expressions:
        try:
            lifted, values = template(expression)
        except ExpressionError as error:
            raise Problem((*path, name), str(error)) from error
        templates.append((name, lifted))
        numbers.append(values)
    return Signals(str(path[-1]), tuple(templates), tuple(numbers))


def _read(path: KeyPath, text: str, names: Collection[str]) -> Expression:
    try:
        return parse(text, names=names)
    except ExpressionError as error:
        raise Problem(path, str(error)) from error


def require_known(*given: tuple[KeyPath, Collection[str], Collection[str]]) -> None:
    """Refuse names at keys that do not know them.

    Parameters
    ----------
    *given : (KeyPath, collection of str, collection of str)
        A key, the names there, and those that are known.

    Raises
    ------
    Problem
        For the first; ``others`` are further ones.
    """
    problems = [
        Problem(
            (*path, name), f"unknown name {name!r}; known here: {', '.join(known) or 'none'}.{nearest(name, known)}"
        )
        for path, names, known in given
        for name in names
        if name not in known
    ]
    if problems:
        problems[0].others = tuple(problems[1:])
        raise problems[0]


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


def parameters_of(block: Plant) -> tuple[KeyPath, Collection[str], Collection[str]]:
    """The key of a plant's parameters, the names there, and those that are known: of a model of one's own all are."""
    return ("plant", "parameters"), block.parameters, block.known_parameters or block.parameters


def parameter_values(block: Plant) -> dict[str, float]:
    known = block.known_parameters
    require_known(parameters_of(block))
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
