"""Symbolic expressions as texts in the grammar of configurations."""

from __future__ import annotations

import math
from collections.abc import Sequence

import casadi as ca

from hgorun.config.tokens import MAX_LENGTH
from hgorun.symbolic.instructions import read

_INFIX = {
    ca.OP_ADD: "{} + {}",
    ca.OP_SUB: "{} - {}",
    ca.OP_MUL: "{}*{}",
    ca.OP_DIV: "{}/{}",
    ca.OP_POW: "{}**{}",
    ca.OP_CONSTPOW: "{}**{}",
    ca.OP_NEG: "-{}",
    ca.OP_SQ: "{}**2",
    ca.OP_TWICE: "2*{}",
    ca.OP_INV: "1/{}",
    ca.OP_LT: "{} < {}",
    ca.OP_LE: "{} <= {}",
    ca.OP_EQ: "{} == {}",
    ca.OP_NE: "{} != {}",
    ca.OP_AND: "{} and {}",
    ca.OP_OR: "{} or {}",
    ca.OP_NOT: "not {}",
}
_CALLS = {
    ca.OP_SQRT: "sqrt",
    ca.OP_EXP: "exp",
    ca.OP_LOG: "log",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_ATAN2: "atan2",
    ca.OP_SINH: "sinh",
    ca.OP_COSH: "cosh",
    ca.OP_TANH: "tanh",
    ca.OP_FABS: "abs",
    ca.OP_SIGN: "sign",
    ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil",
    ca.OP_FMIN: "min",
    ca.OP_FMAX: "max",
}


def texts(function: ca.Function, names: Sequence[Sequence[str]]) -> list[str]:
    """The entries of a function's one result.

    Parameters
    ----------
    function : casadi.Function
        Of SX, with one result.
    names : sequence of sequences of str
        What stands for the entries of each of its arguments.

    Raises
    ------
    ValueError
        Where the grammar has no word for an operation, a number is not finite, or a text would be too long.
    """
    size = function.numel_out(0)
    places = function.sparsity_out(0).find()  # of entries that are not zero by structure
    found, values = ["0"] * size, dict[int, str]()
    for one in read(function):
        arguments = [values[a] for a in one.arguments]
        if one.op == ca.OP_OUTPUT:
            found[places[one.place[1]]] = _outside(arguments[0])
        elif one.op == ca.OP_INPUT:
            values[one.value] = names[one.place[0]][one.place[1]]
        elif one.op == ca.OP_CONST:
            values[one.value] = _number(one.number)
        else:
            values[one.value] = _operation(one.op, arguments)
    return found


def _number(value: float) -> str:
    if not math.isfinite(value):
        raise ValueError(f"{value} is not a number that an expression can hold")
    text = str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)
    return f"({text})" if value < 0 else text


def _operation(op: int, arguments: Sequence[str]) -> str:
    if op in _INFIX:
        text = f"({_INFIX[op].format(*arguments)})"
    elif op in _CALLS:
        text = f"{_CALLS[op]}({', '.join(map(_outside, arguments))})"
    elif op == ca.OP_IF_ELSE_ZERO:
        text = f"where({arguments[0]}, {arguments[1]}, 0)"
    else:
        raise ValueError(f"expressions have no word for CasADi's operation {op}")
    if len(text) > MAX_LENGTH:
        raise ValueError(f"the right-hand side would have more than {MAX_LENGTH:,} characters as an expression")
    return text


def _outside(text: str) -> str:
    """Without brackets around the whole."""
    if not text.startswith("("):
        return text
    depth = 0
    for place, sign in enumerate(text):
        depth += (sign == "(") - (sign == ")")
        if depth == 0:
            return text[1:-1] if place == len(text) - 1 else text
    return text
