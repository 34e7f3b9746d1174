"""Where an expression is not a number: operations that are not defined for what they are applied to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.symbolic.evaluate import Floats, at
from hgorun.symbolic.graph import arguments, operations

_LARGEST = 1e100  # an argument that is larger is the trouble itself


@dataclass(frozen=True, eq=False, repr=False)
class _Domain:
    """Of a function: what is said outside of it, and which of its arguments decides."""

    what: str
    decisive: int
    outside: Callable[..., bool]


_SQRT = _Domain("sqrt of a negative number", 0, lambda x: x < 0)
_LOG = _Domain("log of a number that is not positive", 0, lambda x: x <= 0)
_POWER = _Domain("power of a negative number", 0, lambda x, k: x < 0 and k != round(k))
_POLE = _Domain("division by zero", 0, lambda x, k: x == 0 and k < 0)
_ARC = _Domain("asin or acos of a number beyond 1", 0, lambda x: abs(x) > 1)
_DOMAINS: dict[int, tuple[_Domain, ...]] = {
    **{ca.OP_SQRT: (_SQRT,), ca.OP_LOG: (_LOG,), ca.OP_ASIN: (_ARC,), ca.OP_ACOS: (_ARC,)},
    ca.OP_DIV: (_Domain("division by zero", 1, lambda x, y: y == 0),),
    ca.OP_INV: (_Domain("division by zero", 0, lambda x: x == 0),),
    **{ca.OP_POW: (_POWER, _POLE), ca.OP_CONSTPOW: (_POWER, _POLE)},
}


def first_undefined(
    expression: ca.SX, symbols: Sequence[ca.SX], numbers: Sequence[Floats], names: Sequence[tuple[ca.SX, str]]
) -> str | None:
    """What is not defined in an expression that is not a number, in words.

    Parameters
    ----------
    expression : casadi.SX
    symbols, numbers : sequence
        What it is an expression of, vectors, and where it is evaluated.
    names : sequence of (casadi.SX, str)
        Symbols that have a name: ``sqrt of a negative number (h1 = -0.013)`` where the argument depends on one alone.

    Returns
    -------
    str or None
        None where every operation is defined for its arguments.
    """
    known = [node for node in operations([expression]) if node.op() in _DOMAINS]
    if not known:
        return None
    flat = ca.vertcat(*[argument for node in known for argument in arguments(node)])
    (values,) = at(ca.Function("arguments", list(symbols), [ca.densify(flat)]), *numbers)
    place = 0
    found = None
    for node in known:  # from the last one back: the first in the order of computing stays
        given = values[place : place + node.n_dep()]
        place += node.n_dep()
        if np.all(np.abs(given) < _LARGEST):
            for domain in _DOMAINS[node.op()]:
                if domain.outside(*given):
                    found = domain.what + _argument(arguments(node)[domain.decisive], symbols, numbers, names)
    return found


# What is told of operations whose result may be too large.
_GROWING = {
    ca.OP_EXP: "exp", ca.OP_SINH: "sinh", ca.OP_COSH: "cosh", ca.OP_MUL: "a product", ca.OP_SQ: "a square",
    ca.OP_TWICE: "a product", ca.OP_DIV: "a quotient", ca.OP_INV: "a quotient", ca.OP_ADD: "a sum",
    ca.OP_SUB: "a difference", ca.OP_POW: "a power", ca.OP_CONSTPOW: "a power",
}  # fmt: skip


def too_large(expression: ca.SX, symbols: Sequence[ca.SX], numbers: Sequence[Floats]) -> str | None:
    """The first operation of an expression whose result overflows, in words: ``exp of 1000 is larger than ...``.

    Parameters
    ----------
    expression, symbols, numbers
        As of :func:`first_undefined`.

    Returns
    -------
    str or None
        None where none does.
    """
    nodes = list(operations([expression]))
    if not nodes:
        return None
    flat = ca.vertcat(*[part for node in nodes for part in (node, *arguments(node))])
    with np.errstate(over="ignore", invalid="ignore"):
        (values,) = at(ca.Function("values", list(symbols), [ca.densify(flat)]), *numbers)
    place, found = 0, None
    for node in nodes:  # from the last one back: the first in the order of computing stays
        result, *given = values[place : place + 1 + node.n_dep()]
        place += 1 + node.n_dep()
        if np.isinf(result) and np.all(np.isfinite(given)) and node.op() in _GROWING:
            of = " and ".join(f"{value:.6g}" for value in given)
            found = f"{_GROWING[node.op()]} of {of} is larger than numbers can be"
    return found


def _argument(
    expression: ca.SX, symbols: Sequence[ca.SX], numbers: Sequence[Floats], names: Sequence[tuple[ca.SX, str]]
) -> str:
    """The one state with a name, if an argument depends on that state alone, with its number, or the argument's own."""
    whole = ca.Function("named", list(symbols), [expression, *[symbol for symbol, _ in names]])
    value, *own = at(whole, *numbers)
    involved = [i for i, (symbol, _) in enumerate(names) if ca.depends_on(expression, symbol)]
    if len(involved) == 1 and not _depends_on_others(expression, symbols, names[involved[0]][0]):
        return f" ({names[involved[0]][1]} = {own[involved[0]][0]:.4g})"
    return f" ({value[0]:.4g})" if value[0] != 0 else ""


def _depends_on_others(expression: ca.SX, symbols: Sequence[ca.SX], named: ca.SX) -> bool:
    """Whether an argument depends on other entries of the vector of a named state, such as a filter's P."""
    vector = next(one for one in symbols if ca.depends_on(one, named))
    return any(ca.depends_on(expression, one) for one in ca.vertsplit(vector) if not ca.is_equal(one, named))
