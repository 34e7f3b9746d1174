"""The units of the terms of a plant's equations, as far as the units of its signals say them.

A number or a parameter may have any unit, and so may what a function gives; where none of these is a factor, a term has
the unit of its signals. A factor of 1 that is not written may have a unit, too, so that terms of different kinds are no
fault: what is one is the same kind in another unit, as 1/h beside 1/min, and a difference of temperatures from two
zeros, as of K and degC.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from hgorun.data.units.unit_per_time import Factors, product, size_of
from hgorun.symbolic.plant import PlantModel

_LONGEST = 10_000  # operations that are looked at
_NEAR = 1e-6
_OF_TEMPERATURES = [((name, 1),) for name in ("K", "degR", "delta_degC", "delta_degF")]


@dataclass(frozen=True, eq=False, repr=False)
class Term:
    """A part of a right-hand side whose unit is known, and the signals in it."""

    unit: Factors
    signals: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Beside:
    """A term beside another one, or beside the rate of a state, in another unit of the same kind.

    Attributes
    ----------
    term, other : Term
    factor : float
        How many units of the first one of the other is; 1 where only the zeros of two temperatures differ.
    rate : bool
        Whether the other one is the rate, and the name in it that of the state.
    """

    term: Term
    other: Term
    factor: float
    rate: bool


def mistaken_terms(model: PlantModel, units: Mapping[str, Factors], time: str) -> Iterator[tuple[str, Beside]]:
    """The states in whose right-hand side a term has another unit than what it stands beside.

    A right-hand side that is a state alone is not looked at: its unit is that of a derivative, of any kind.

    Parameters
    ----------
    units : mapping of str to Factors
        Of signals.
    time : str
    """
    symbols = [*zip(model.states, ca.vertsplit(model.x), strict=True)]
    states = {s.element_hash() for _, s in symbols}
    symbols += zip(model.inputs, ca.vertsplit(model.u) if model.inputs else [], strict=True)
    known = {s.element_hash(): Term(units[name], (name,)) for name, s in symbols if name in units}
    for name, expression in zip(model.states, ca.vertsplit(model.dynamics), strict=True):
        if expression.element_hash() in states or ca.n_nodes(expression) > _LONGEST:
            continue
        walk = _Walk(known)
        rates = walk.terms(expression)
        if name in units:
            right = Term(product(units[name], {time: -1}), (name,))
            walk.found += [one for rate in rates if (one := _beside(rate, right, rate=True)) is not None]
        walk.compare_zeros(expression)
        if walk.found:
            yield name, walk.found[0]


def _beside(term: Term, other: Term, *, rate: bool = False) -> Beside | None:
    """Where two units are of one kind and not the same."""
    if term.unit == other.unit:
        return None
    size = size_of(product(other.unit, term.unit, -1))
    return None if size is None or abs(size - 1) <= _NEAR else Beside(term, other, size, rate)


class _Walk:
    """A way through an expression, from its symbols up.

    Attributes
    ----------
    found : list of Beside
        Sums of what is in different units.
    """

    def __init__(self, known: Mapping[int, Term]) -> None:
        self._known = dict[int, list[Term]]({key: [term] for key, term in known.items()})
        # how often each temperature is in a sum
        self._counts = {key: {key: 1} for key, term in known.items() if tuple(term.unit.items()) in _OF_TEMPERATURES}
        self.found: list[Beside] = []

    def terms(self, whole: ca.SX) -> list[Term]:
        """What may be its unit: none where that is not known, several where it is a sum of several kinds."""
        stack = [whole]
        while stack:
            node = stack[-1]
            key = node.element_hash()
            if key in self._known:
                stack.pop()
                continue
            parts = [node.dep(i) for i in range(node.n_dep())]
            waiting = [part for part in parts if part.element_hash() not in self._known]
            if waiting:
                stack += waiting
            else:
                stack.pop()
                self._known[key] = self._of(node, [self._known[part.element_hash()] for part in parts])
                self._count(node, parts)
        return self._known[whole.element_hash()]

    def _count(self, node: ca.SX, parts: Sequence[ca.SX]) -> None:
        """Count the temperatures in a sum; whatever else is done with one takes it as a whole."""
        op = node.op() if parts else None
        if op not in (ca.OP_ADD, ca.OP_SUB, ca.OP_NEG):
            for part in parts:
                self.compare_zeros(part)
            return
        signs = {ca.OP_ADD: (1, 1), ca.OP_SUB: (1, -1), ca.OP_NEG: (-1,)}[op]
        counts = Counter[int]()
        for part, sign in zip(parts, signs, strict=True):
            for key, count in self._counts.get(part.element_hash(), {}).items():
                counts[key] += sign * count
        self._counts[node.element_hash()] = counts

    def compare_zeros(self, whole: ca.SX) -> None:
        """Find a sum that is a difference of temperatures of two units, as Ti - T of K and degC.

        A difference of temperatures that is a signal itself, and in K beside degC, is none.
        """
        of_units: dict[str, tuple[int, Term]] = {}
        for key, count in self._counts.get(whole.element_hash(), {}).items():
            (term,) = self._known[key]
            (unit,) = term.unit
            of_units[unit] = of_units.get(unit, (0, term))[0] + count, term
        differing = [one for one in of_units.values() if one[0]]
        if len(differing) == 2 and differing[0][0] == -differing[1][0]:
            self.found.append(Beside(differing[0][1], differing[1][1], 1, rate=False))

    def _of(self, node: ca.SX, parts: list[list[Term]]) -> list[Term]:
        """Those of an operation, from those of what it is applied to."""
        op = node.op() if parts else None
        if op in (ca.OP_ADD, ca.OP_SUB):
            left, right = parts
            self.found += [one for a in left for b in right if (one := _beside(a, b)) is not None]
            return left + [one for one in right if all(one.unit != other.unit for other in left)]
        if op in (ca.OP_NEG, ca.OP_FABS):
            return parts[0]
        if op in (ca.OP_MUL, ca.OP_DIV) and all(len(part) == 1 for part in parts):
            (a,), (b,) = parts
            power = 1 if op == ca.OP_MUL else -1
            return [Term(product(a.unit, b.unit, power), tuple(dict.fromkeys((*a.signals, *b.signals))))]
        if op == ca.OP_SQ and len(parts[0]) == 1:
            (a,) = parts[0]
            return [Term(product(a.unit, a.unit), a.signals)]
        return []
