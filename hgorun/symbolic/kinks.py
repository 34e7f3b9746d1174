"""Where functions of time are not smooth, from their expressions.

A kink, a jump or a pole of an expression is where an argument crosses a value: that of abs, sign or a comparison 0,
that of floor a whole number, a denominator 0. Between the kinks that an argument itself has, it is smooth: what
floor, sign and comparisons give is constant there. So kinks are found from the inside of an expression outwards,
each on the pieces that those inside it leave.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.symbolic.functions_of_time import Smooth
from hgorun.symbolic.instructions import read
from hgorun.symbolic.levels import Levels, integers, zero

_ABOVE, _FROM = zero(reached=False), zero(reached=True)
_DIFFERENCE = {
    **{ca.OP_FMIN: _ABOVE, ca.OP_FMAX: _ABOVE, ca.OP_LT: _FROM, ca.OP_LE: _ABOVE},
    **{ca.OP_EQ: _FROM, ca.OP_NE: _FROM},
}
_ITSELF = {
    **{ca.OP_FABS: _ABOVE, ca.OP_SIGN: _ABOVE, ca.OP_FLOOR: integers(reached=True)},
    **{ca.OP_CEIL: integers(reached=False)},
}
STEPS = {ca.OP_SIGN, ca.OP_FLOOR, ca.OP_CEIL, ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE}
STEPS |= {ca.OP_NOT, ca.OP_AND, ca.OP_OR}  # constant between kinks
_POWERS = {ca.OP_POW, ca.OP_CONSTPOW}


@dataclass(frozen=True, eq=False, repr=False)
class Kink:
    """A place where an expression is not smooth: where an argument crosses a level.

    Attributes
    ----------
    argument : Smooth
        Smooth between the kinks inside it; its s are entries of :attr:`Pieces.states`.
    levels : Levels
    touches : bool
        Whether it is one as well where the level is touched: |x| written as a root has its kink there.
    singular : bool
        Whether the expression may have no finite value there.
    inside : tuple of int
        The kinks on which the argument depends.
    held : list of int
        Which states its s are.
    """

    argument: Smooth
    levels: Levels
    touches: bool
    singular: bool
    inside: tuple[int, ...]
    held: list[int]


@dataclass(frozen=True, eq=False, repr=False)
class Pieces:
    """Expressions of (t, p) in pieces.

    Attributes
    ----------
    kinks : tuple of Kink
        Those inside before those around them.
    states : casadi.Function
        Of (t, p): what is constant on each piece.
    watched : casadi.Function
        Of (t, p): the expressions, or of those that depend on something else the parts that do not.
    deciding, shown : ndarray of int
        The entries of p on which the times of the kinks depend, and those on which watched values do.
    """

    kinks: tuple[Kink, ...]
    states: ca.Function
    watched: ca.Function
    deciding: np.ndarray
    shown: np.ndarray

    @classmethod
    def of(cls, expressions: Iterable[ca.SX], t: ca.SX, p: ca.SX) -> Pieces:
        """Take expressions apart; where they depend on other symbols than t and p, only parts that do not count."""
        return _Reader(t, p).read(ca.cse(ca.vertcat(*[ca.vec(ca.densify(e)) for e in expressions])))


@dataclass(frozen=True, eq=False, repr=False)
class _Node:
    """A value: the expression, the same with constants in the place of steps, and the kinks inside it."""

    whole: ca.SX
    smooth: ca.SX
    inside: frozenset[int] = frozenset()
    timed: bool = False


class _Reader:
    """Goes through the instructions of a function, innermost first."""

    def __init__(self, t: ca.SX, p: ca.SX) -> None:
        self.t, self.p = t, p
        self.kinks: list[tuple[ca.SX, Levels, bool, bool, frozenset[int]]] = []
        self.symbols: list[ca.SX] = []
        self.steps: list[ca.SX] = []
        self.watched: list[ca.SX] = []

    def read(self, expression: ca.SX) -> Pieces:
        known = {e.element_hash() for e in [self.t, *ca.vertsplit(self.p)]}
        others = [e for e in ca.symvar(expression) if e.element_hash() not in known]
        function = ca.Function("f", [self.t, self.p, ca.vertcat(ca.SX(0, 1), *others)], [expression])
        nodes: dict[int, _Node | None] = {}  # None: depends on something else
        for i in read(function):
            arguments = [nodes[a] for a in i.arguments]
            if i.op == ca.OP_OUTPUT:
                self._watch(arguments)
            elif i.op == ca.OP_CONST:
                nodes[i.value] = _Node(ca.SX(i.number), ca.SX(i.number))
            elif i.op == ca.OP_INPUT:
                own = (self.t, self.p, None)[i.place[0]]
                entry = None if own is None else own[i.place[1]]
                nodes[i.value] = None if entry is None else _Node(entry, entry, timed=i.place[0] == 0)
            else:
                own_parts = [a for a in arguments if a is not None]
                if len(own_parts) == len(arguments):
                    nodes[i.value] = self._node(i.op, own_parts)
                else:
                    nodes[i.value] = None
                    self._watch(self._factors(i.op, arguments))
        return self._pieces()

    def _factors(self, op: int, parts: list[_Node | None]) -> list[_Node | None]:
        """What must be finite of the arguments of an operation of which one depends on something else."""
        if op == ca.OP_IF_ELSE_ZERO:
            return parts[:1]  # what is not chosen need not be
        divisor = parts[-1]
        if op == ca.OP_DIV and divisor is not None and divisor.timed:
            return [self._node(ca.OP_INV, [divisor])]
        return parts

    def _watch(self, nodes: Iterable[_Node | None]) -> None:
        self.watched += [node.whole for node in nodes if node is not None and node.timed]

    def _node(self, op: int, parts: list[_Node]) -> _Node:
        whole = apply_to(op, [part.whole for part in parts])
        smooth = [part.smooth for part in parts]
        if not any(part.timed for part in parts):
            return _Node(whole, apply_to(op, smooth))
        inside = frozenset().union(*(part.inside for part in parts))
        for argument, levels, touches, singular in levels_of(op, [part.smooth for part in parts], parts[-1].timed):
            self.kinks.append((argument, levels, touches, singular, inside))
            inside |= {len(self.kinks) - 1}
        if op in STEPS:
            return _Node(whole, self._step(whole), inside, True)
        if op == ca.OP_FABS:
            return _Node(whole, self._step(ca.sign(parts[0].whole)) * smooth[0], inside, True)
        if op in (ca.OP_FMIN, ca.OP_FMAX):
            a, b = (part.whole for part in parts)
            first = self._step(a < b if op == ca.OP_FMIN else a > b)
            return _Node(whole, ca.if_else(first, smooth[0], smooth[1]), inside, True)
        if op == ca.OP_IF_ELSE_ZERO and parts[0].timed:
            smooth[0] = self._step(parts[0].whole != 0)
        if op == ca.OP_FMOD:
            turns = self._step((parts[0].whole - whole) / parts[1].whole)
            return _Node(whole, smooth[0] - turns * smooth[1], inside, True)
        return _Node(whole, apply_to(op, smooth), inside, True)

    def _step(self, whole: ca.SX) -> ca.SX:
        """A symbol for what is constant on each piece."""
        self.steps.append(whole)
        self.symbols.append(ca.SX.sym(f"s{len(self.symbols)}"))
        return self.symbols[-1]

    def _pieces(self) -> Pieces:
        places = {symbol.element_hash(): k for k, symbol in enumerate(self.symbols)}
        kinks = []
        for argument, levels, touches, singular, inside in self.kinks:
            held = [places[e.element_hash()] for e in ca.symvar(argument) if e.element_hash() in places]
            s = ca.vertcat(ca.SX(0, 1), *[self.symbols[k] for k in held])
            smooth = Smooth.of(argument, self.t, self.p, s)
            kinks.append(Kink(smooth, levels, touches, singular, tuple(sorted(inside)), held))
        watched, states = (ca.vertcat(ca.SX(0, 1), *parts) for parts in (self.watched, self.steps))
        arguments = ca.vertcat(states, *[argument for argument, *_ in self.kinks])
        return Pieces(
            tuple(kinks),
            ca.Function("s", [self.t, self.p], [ca.densify(states)]),
            ca.Function("v", [self.t, self.p], [ca.densify(watched)]),
            _entries_in(arguments, self.p),
            _entries_in(watched, self.p),
        )


def _entries_in(expression: ca.SX, p: ca.SX) -> np.ndarray:
    """Which entries of p an expression depends on."""
    depends = ca.which_depends(expression, p, 1, False) if p.numel() and expression.numel() else []
    return np.flatnonzero(np.array(depends, dtype=bool))


def apply_to(op: int, parts: list[ca.SX]) -> ca.SX:
    return ca.SX.unary(op, *parts) if len(parts) == 1 else ca.SX.binary(op, *parts)


def levels_of(op: int, parts: list[ca.SX], varies: bool = True) -> Iterable[tuple[ca.SX, Levels, bool, bool]]:
    """The arguments and levels of an operation: whether touching counts, and whether it may be infinite there.

    Parameters
    ----------
    parts : list of casadi.SX
        What it is done with.
    varies : bool
        Whether the last of them does.
    """
    first, last = parts[0], parts[-1]
    if op in _ITSELF:
        yield first, _ITSELF[op], False, False
    elif op in _DIFFERENCE:
        yield first - last, _DIFFERENCE[op], False, False
    elif op == ca.OP_FMOD:
        yield first / last, integers(reached=True), False, False
        yield first / last, integers(reached=False), False, False
    elif op in (ca.OP_DIV, ca.OP_INV) and varies:
        yield last, _ABOVE, True, True
    elif op in _POWERS and not _is_natural(last):
        yield first, _ABOVE, True, True
    elif op in (ca.OP_SQRT, ca.OP_LOG):
        yield first, _ABOVE, True, op == ca.OP_LOG
    elif op == ca.OP_TAN:
        yield ca.cos(first), _ABOVE, False, True
    elif op in (ca.OP_ASIN, ca.OP_ACOS):
        yield first - 1, _ABOVE, True, False
        yield first + 1, _ABOVE, True, False
    elif op == ca.OP_ATAN2:
        yield first, _FROM, True, False


def _is_natural(exponent: ca.SX) -> bool:
    if not exponent.is_constant():
        return False
    value = float(exponent)
    return value >= 0 and value == round(value)
