"""Which operations of equations are narrow in a state, see :mod:`hgorun.symbolic.features`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import casadi as ca

from hgorun.symbolic.features import Feature
from hgorun.symbolic.functions_of_time import Smooth
from hgorun.symbolic.instructions import read
from hgorun.symbolic.kinks import STEPS, apply_to, levels_of
from hgorun.symbolic.levels import Levels, zero

_SWITCHES = STEPS - {ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR} | {ca.OP_FABS, ca.OP_FMIN, ca.OP_FMAX}
_WRITTEN = {
    ca.OP_SIGN: "sign",
    ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil",
    ca.OP_LT: "a comparison",
    ca.OP_LE: "a comparison",
}
_RAMPS = {ca.OP_TANH, ca.OP_ATAN}
_EXPONENTIALS = {ca.OP_EXP, ca.OP_EXPM1, ca.OP_COSH, ca.OP_SINH}
_QUOTIENTS = {ca.OP_DIV, ca.OP_INV}
_POWERS = {ca.OP_POW, ca.OP_CONSTPOW}
_HIGH_POWER = 16.0
_ZERO = zero(reached=False)


def features_of(functions: Sequence[ca.Function], states: Sequence[int]) -> tuple[Feature, ...]:
    """The features of functions of (t, p, z, w) in given states; those that need w or other states are left out."""
    t, p, z = ca.SX.sym("t"), ca.SX.sym("p", functions[0].size1_in(1)), ca.SX.sym("z", functions[0].size1_in(2))
    known: dict[tuple[str, str], Feature] = {}
    for function in functions:
        for op, parts in _operations(function, t, p, z):
            for kind, argument, levels in _narrow(op, parts):
                argument = ca.cse(argument)
                key = kind, str(argument)
                within = _within(argument, z, states)
                if within and key not in known and not ca.depends_on(argument, ca.SX.sym("w")):
                    known[key] = _feature(op, kind, argument, levels, within, (t, p, z))
    return tuple(known.values())


def _operations(function: ca.Function, t: ca.SX, p: ca.SX, z: ca.SX) -> Iterator[tuple[int, list[ca.SX]]]:
    """The operations that may be narrow, with what they are done with; those that need w are left out."""
    looked_for = _SWITCHES | _RAMPS | _EXPONENTIALS | _QUOTIENTS | _POWERS
    nodes: dict[int, ca.SX | None] = {}
    for i in read(function):
        if i.op == ca.OP_OUTPUT:
            continue
        if i.op == ca.OP_INPUT:
            own = (t, p, z, None)[i.place[0]]
            nodes[i.value] = None if own is None else own[i.place[1]]
        elif i.op == ca.OP_CONST:
            nodes[i.value] = ca.SX(i.number)
        else:
            parts = [nodes[a] for a in i.arguments]
            given = [part for part in parts if part is not None]
            nodes[i.value] = apply_to(i.op, given) if len(given) == len(parts) else None
            if i.op in looked_for and len(given) == len(parts):
                yield i.op, given
            elif i.op in _QUOTIENTS and given and parts[-1] is not None:
                yield ca.OP_INV, given[-1:]


def _narrow(op: int, parts: list[ca.SX]) -> Iterator[tuple[str, ca.SX, Levels | None]]:
    """The kind of an operation, its argument, and the levels that this crosses."""
    if op in _SWITCHES:
        for argument, levels, *_ in levels_of(op, parts):
            yield "jump" if op in STEPS else "kink", argument, levels
    elif op in _RAMPS:
        yield "ramp", parts[0], _ZERO
    elif op in _EXPONENTIALS:
        yield "peak" if op in (ca.OP_EXP, ca.OP_EXPM1) else "even", parts[0], None
    elif op in _QUOTIENTS:
        yield "ratio", parts[-1], None
    elif parts[-1].is_constant() and (float(parts[-1]) < 0 or float(parts[-1]) >= _HIGH_POWER):
        yield "peak", 0.5 * parts[-1] * ca.log(parts[0] ** 2), None  # e to the power of that


def _within(argument: ca.SX, z: ca.SX, states: Sequence[int]) -> tuple[int, ...]:
    """The states on which an argument depends; none where others are among them."""
    own = {e.element_hash() for e in ca.symvar(argument)}
    used = tuple(k for k in range(z.numel()) if z[k].element_hash() in own)
    return used if set(used) <= set(states) else ()


def _feature(
    op: int, kind: str, argument: ca.SX, levels: Levels | None, states: tuple[int, ...], symbols: tuple[ca.SX, ...]
) -> Feature:
    t, p, z = symbols
    s = ca.SX.sym("s", 2 + 4 * len(states))
    r = (t - s[0]) * s[1]
    curves = [s[j] + r * (s[j + 1] + r * (s[j + 2] + r * s[j + 3])) for j in range(2, s.numel(), 4)]
    along = ca.substitute(argument, z[list(states)], ca.vertcat(*curves))
    slope = None if levels is not None else Smooth.of(ca.jacobian(along, t), t, p, s)
    return Feature(
        Smooth.of(along, t, p, s),
        ca.Function("g", [t, p, z[list(states)]], [ca.densify(argument)]),
        slope,
        levels,
        states,
        ratio=kind == "ratio",
        ramp=kind == "ramp",
        jump=kind == "jump",
        even=kind == "even",
        operation=_WRITTEN.get(op, ""),
    )
