"""CasADi's instructions carried out on arrays, with elementary functions of our own.

Sums, products, quotients and roots are rounded alike by every processor, NumPy's too; all else is computed by
:mod:`hgorun.native.elementary`. So the numbers have the same bits on every machine, and those of the compiled code.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from hgorun.native import elementary
from hgorun.native.elementary import Floats
from hgorun.symbolic.instructions import Instruction, read

CALLS = {
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_ATAN2: "atan2",
    ca.OP_EXP: "exp",
    ca.OP_EXPM1: "expm1",
    ca.OP_SINH: "sinh",
    ca.OP_COSH: "cosh",
    ca.OP_TANH: "tanh",
    ca.OP_LOG: "log",
    ca.OP_LOG1P: "log1p",
    ca.OP_ASINH: "asinh",
    ca.OP_ACOSH: "acosh",
    ca.OP_ATANH: "atanh",
    ca.OP_POW: "pow",
    ca.OP_CONSTPOW: "pow",
    ca.OP_HYPOT: "hypot",
    ca.OP_FMOD: "fmod",
}
"""CasADi's operations that are elementary functions, by their names."""

_OPERATIONS: dict[int, Callable[..., Any]] = {
    ca.OP_ASSIGN: lambda x: x,
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_NEG: np.negative,
    ca.OP_SQ: lambda x: x * x,
    ca.OP_TWICE: lambda x: x + x,
    ca.OP_INV: lambda x: 1.0 / x,
    ca.OP_SQRT: np.sqrt,
    ca.OP_FABS: np.abs,
    ca.OP_SIGN: lambda x: np.where(x > 0, 1.0, np.where(x < 0, -1.0, x)),
    ca.OP_FLOOR: np.floor,
    ca.OP_CEIL: np.ceil,
    ca.OP_COPYSIGN: np.copysign,
    # of two that are not ordered the second, as in the compiled code
    ca.OP_FMIN: lambda x, y: np.where(x < y, x, y),
    ca.OP_FMAX: lambda x, y: np.where(x > y, x, y),
    ca.OP_LT: lambda x, y: np.where(x < y, 1.0, 0.0),
    ca.OP_LE: lambda x, y: np.where(x <= y, 1.0, 0.0),
    ca.OP_EQ: lambda x, y: np.where(x == y, 1.0, 0.0),
    ca.OP_NE: lambda x, y: np.where(x != y, 1.0, 0.0),
    ca.OP_NOT: lambda x: np.where(x == 0, 1.0, 0.0),
    ca.OP_AND: lambda x, y: np.where((x != 0) & (y != 0), 1.0, 0.0),
    ca.OP_OR: lambda x, y: np.where((x != 0) | (y != 0), 1.0, 0.0),
    ca.OP_IF_ELSE_ZERO: lambda x, y: np.where(x != 0, y, 0.0),
    **{op: partial(elementary.apply, name) for op, name in CALLS.items()},
}


def value_of(op: int, *arguments: float) -> float:
    """What one operation makes of numbers."""
    with np.errstate(all="ignore"):
        return float(_OPERATIONS[op](*map(np.float64, arguments)))


_NUMBERS = 1 << 22  # that are kept at the same time
_PIECE = 8192  # points at the same time: what the processor's cache holds of the few values that are needed at once


@dataclass(frozen=True, eq=False, repr=False)
class Step:
    """An instruction, with the values that nothing needs after it."""

    instruction: Instruction
    done: tuple[int, ...]


_KNOWN = {*_OPERATIONS, ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT}
_NOT_ALIKE = {*CALLS, ca.OP_FMIN, ca.OP_FMAX}  # of these CasADi's last bits, or numbers that are not ordered
_MOST_EXACT = 8192  # instructions: of more, few points are carried out at the same time


def arithmetic(function: ca.Function) -> list[Step]:
    """The steps of a function that CasADi and NumPy compute alike, to the last bit; none for others."""
    if not function.is_a("SXFunction") or function.n_instructions() > _MOST_EXACT:
        return []
    operations = _operations(function)
    return steps_of(read(function)) if operations <= _KNOWN - _NOT_ALIKE else []


def interpreted(function: ca.Function) -> list[Step]:
    """The steps of a function that calls an elementary function; none for others, which CasADi computes."""
    if not function.is_a("SXFunction"):
        return []
    operations = _operations(function)
    return steps_of(read(function)) if operations & CALLS.keys() and operations <= _KNOWN else []


def _operations(function: ca.Function) -> set[int]:
    return {function.instruction_id(k) for k in range(function.n_instructions())}


def steps_of(instructions: Sequence[Instruction]) -> list[Step]:
    """Instructions, each with the values that are needed for the last time."""
    last = {a: k for k, i in enumerate(instructions) for a in i.arguments}
    return [Step(i, tuple(a for a in set(i.arguments) if last[a] == k)) for k, i in enumerate(instructions)]


def carry_out(steps: Sequence[Step], arguments: Sequence[Floats], results: Sequence[Floats]) -> None:
    """Fill the results.

    Parameters
    ----------
    steps : sequence of Step
    arguments : sequence of ndarray, shapes (N, nonzeros), or what is the same at all points
    results : sequence of ndarray, shape (N, nonzeros)
    """
    points = len(results[0])
    length = min(_PIECE, max(_NUMBERS // len(steps), 64))
    with np.errstate(all="ignore"):
        for start in range(0, points, length):
            part = slice(start, start + length)
            _piece(steps, [a[part] if a.ndim == 2 else a.ravel() for a in arguments], [r[part] for r in results])


def _piece(steps: Sequence[Step], arguments: Sequence[Floats], results: Sequence[Floats]) -> None:
    values: dict[int, Any] = {}
    for step in steps:
        i = step.instruction
        if i.op == ca.OP_OUTPUT:
            results[i.place[0]][:, i.place[1]] = values[i.arguments[0]]
        elif i.op == ca.OP_INPUT:
            values[i.value] = arguments[i.place[0]][..., i.place[1]]
        elif i.op == ca.OP_CONST:
            values[i.value] = np.float64(i.number)
        else:
            values[i.value] = _OPERATIONS[i.op](*[values[a] for a in i.arguments])
        for value in step.done:  # what is kept no longer leaves its place in the cache to what comes
            del values[value]
