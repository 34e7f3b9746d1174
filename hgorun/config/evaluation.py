"""The value of an expression: on floats as far as they go, and on CasADi symbols from there."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping
from decimal import Decimal
from functools import reduce
from numbers import Real
from typing import TYPE_CHECKING, TypeAlias

from hgorun.config.grammar import Call, Chain, Comparison, Name, Node, finite
from hgorun.config.tokens import FUNCTIONS, ExpressionError, short

if TYPE_CHECKING:
    import casadi

Value: TypeAlias = "float | casadi.SX"

_OPERATORS: dict[str, Callable[..., Value]] = {  # of floats and of symbols alike
    **{"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "**": operator.pow},
    **{"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge},
    **{"==": operator.eq, "!=": operator.ne, "neg": operator.neg},
}
_EXACT = {"sqrt", "floor", "ceil"}  # one right result, which every machine gives
_OF_FLOATS: dict[str, Callable[..., float]] = {
    **{name: getattr(math, name) for name in FUNCTIONS if hasattr(math, name)},
    **{"abs": abs, "min": min, "max": max, "not": operator.not_, "sign": lambda x: (x > 0) - (x < 0)},
}
_ELEMENTARY = {"**": "pow"} | {name: name for name in FUNCTIONS if name not in _EXACT and hasattr(math, name)}
_IN_CASADI = {"abs": "fabs", "min": "fmin", "max": "fmax", "where": "if_else"}
_IN_CASADI |= {"and": "logic_and", "or": "logic_or", "not": "logic_not"}


def evaluate(node: Node, values: Mapping[str, Value]) -> Value:
    """Evaluate on floats as far as they go, and on CasADi symbols from there."""
    match node:
        case Name(name, constant):
            value = values.get(name, constant)
            if value is None:
                raise ExpressionError(f"`{short(name)}` has no value")
            return finite(value, f"the value of `{name}`") if isinstance(value, Real) else value
        case Comparison(rest=rest):
            links = _links(node, values)
            return next(links) if len(rest) == 1 else _combine("and", links)
        case Chain(first, rest):
            result = evaluate(first, values)
            for sign, operand in rest:
                result = _apply(sign, result, evaluate(operand, values))
            return result
        case Call("and" | "or" as operation, arguments):
            return _combine(operation, (evaluate(argument, values) for argument in arguments))
        case Call("where", (condition, a, b)):
            choice = evaluate(condition, values)
            if isinstance(choice, float):  # what is not chosen may be 1/0
                return evaluate(a if choice else b, values)
            return _apply("where", choice, evaluate(a, values), evaluate(b, values))
        case Call(operation, arguments):
            return _apply(operation, *(evaluate(argument, values) for argument in arguments))
    return node


def _links(node: Comparison, values: Mapping[str, Value]) -> Iterator[Value]:
    left = evaluate(node.first, values)
    for sign, operand in node.rest:
        right = evaluate(operand, values)
        yield _apply(sign, left, right)
        left = right


def _combine(operation: str, parts: Iterable[Value]) -> Value:
    """Join truth values with `and` or `or`, which stop, as Python's do, at the first that decides."""
    symbols = []
    for part in parts:
        if not isinstance(part, float):
            symbols.append(_apply("!=", part, 0.0))
        elif bool(part) == (operation == "or"):
            return float(operation == "or")
    return _apply(operation, *symbols) if symbols else float(operation == "and")


def _apply(operation: str, *values: Value) -> Value:
    if all(isinstance(value, float) for value in values):
        return _on_floats(operation, *values)
    if operation in _OPERATORS:
        return _OPERATORS[operation](*values)
    import casadi

    function = getattr(casadi, _IN_CASADI.get(operation, operation))
    folds = operation in ("min", "max", "and", "or")
    return reduce(function, values) if folds else function(*values)


def _own(operation: str, *values: float) -> float:
    """An elementary function as the compiled equations have it: the C library's last bits depend on the machine."""
    if operation == "log10":
        return float(Decimal(values[0]).log10())  # rounded correctly: 3 for 1000
    from hgorun.native.elementary import apply

    return float(apply(_ELEMENTARY[operation], *values))


def _on_floats(operation: str, *values: float) -> float:
    try:
        result = (_OPERATORS.get(operation) or _OF_FLOATS[operation])(*values)
        if not isinstance(result, complex) and math.isfinite(result):
            return _own(operation, *values) if operation in _ELEMENTARY else float(result)
        trouble = "is not a real number" if isinstance(result, complex) else "is too large for a number"
    except ZeroDivisionError:
        trouble = "divides by zero"
    except OverflowError:
        trouble = "is too large for a number"
    except ValueError:
        trouble = "is not a real number"
    if operation in _OPERATORS:
        shown = f" {operation} ".join(f"{value:.6g}" if value >= 0 else f"({value:.6g})" for value in values)
    else:
        shown = f"{operation}({', '.join(f'{value:.6g}' for value in values)})"
    raise ExpressionError(f"{shown} {trouble}")


def zero_divisor(node: Node, values: Mapping[str, float]) -> str | None:
    """The name of a value that is 0 and that something is divided by; None where there is none."""
    match node:
        case Chain(first, rest):
            for sign, operand in rest:
                if sign == "/" and isinstance(operand, Name) and values.get(operand.name) == 0:
                    return operand.name
            parts: tuple[Node, ...] = (first, *(operand for _, operand in rest))
        case Call(arguments=parts):
            pass
        case _:
            return None
    return next(filter(None, (zero_divisor(part, values) for part in parts)), None)
