"""The grammar of expressions: from tokens to Python's ``ast``, to a tree of our own.

Nothing is ever handed to eval. The text is cut into tokens first: there every number becomes a float, so that no power
of integers can run for hours.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Collection
from dataclasses import dataclass
from typing import SupportsFloat, TypeAlias

from hgorun.config.nearest import listed, nearest
from hgorun.config.tokens import (
    CONSTANTS,
    DECIMAL_POINT,
    FUNCTIONS,
    MAX_LENGTH,
    MAX_NESTING,
    MEANT,
    ExpressionError,
    short,
)

_ARGUMENTS = {"atan2": (2, 2), "max": (2, MAX_LENGTH), "min": (2, MAX_LENGTH), "where": (3, 3)}
_SIGNS: dict[type[ast.AST], str] = {
    **{ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"},
    **{ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="},
    **{ast.USub: "neg", ast.Not: "not", ast.And: "and", ast.Or: "or"},
}


@dataclass(frozen=True, slots=True)
class Name:
    name: str
    constant: float | None


@dataclass(frozen=True, slots=True)
class Call:
    operation: str
    arguments: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Chain:
    """first sign operand sign operand ..., from the left: long sums are long, not deep."""

    first: Node
    rest: tuple[tuple[str, Node], ...]


class Comparison(Chain):
    __slots__ = ()


Node: TypeAlias = float | Name | Call | Chain


def syntax_tree(tokens: list[str]) -> ast.expr:
    """Hand the tokens to Python's parser."""
    # Joined by single spaces, with every number a float, the text holds nothing that Python warns about.
    if tokens[-1] in ("not", "and", "or") or not re.match(r"[\w.)]", tokens[-1]):
        raise ExpressionError(f"something is missing after `{short(tokens[-1])}`")
    parts = [repr(finite(token, token)) if token[0] in ".0123456789" else token for token in tokens]
    text = " ".join(parts)
    try:
        return ast.parse(text, mode="eval").body
    except SyntaxError as error:
        last = len(text[: max((error.offset or 1) - 1, 0)].split())
        where = f"after `{short(tokens[min(last, len(tokens)) - 1])}`" if last else "at the beginning"
        raise ExpressionError(f"something is missing or superfluous {where}") from None
    except (RecursionError, MemoryError):
        raise ExpressionError("the nesting is too deep") from None


class Reader:
    """Turns Python's tree into ours and notes the names."""

    def __init__(self, names: Collection[str] | None) -> None:
        self.allowed = names
        self.used: set[str] = set()

    def read(self, tree: ast.expr, depth: int) -> Node:
        if depth > MAX_NESTING:
            raise ExpressionError(f"operations nested more than {MAX_NESTING} deep")
        match tree:
            case ast.Constant(value=float() as number):
                return number
            case ast.Name(id=name):
                return self.name(name)
            case ast.BinOp():
                rest: list[tuple[str, Node]] = []
                first: ast.expr = tree
                while isinstance(first, ast.BinOp):
                    rest.append((_SIGNS[type(first.op)], self.read(first.right, depth + 1)))
                    first = first.left
                return Chain(self.read(first, depth + 1), tuple(reversed(rest)))
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.read(operand, depth + 1)
            case ast.UnaryOp(op=sign, operand=operand):
                return Call(_SIGNS[type(sign)], (self.read(operand, depth + 1),))
            case ast.Compare(left=left, ops=signs, comparators=others):
                links = [(_SIGNS[type(s)], self.read(o, depth + 1)) for s, o in zip(signs, others, strict=True)]
                return Comparison(self.read(left, depth + 1), tuple(links))
            case ast.BoolOp(op=sign, values=parts):
                return Call(_SIGNS[type(sign)], tuple(self.read(part, depth + 1) for part in parts))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if not any(
                isinstance(argument, ast.Starred) for argument in arguments
            ):
                self.check_call(name, len(arguments))
                return Call(name, tuple(self.read(argument, depth + 1) for argument in arguments))
            case ast.Tuple(elts=[]):
                raise ExpressionError("there is nothing between `(` and `)`")
            case ast.Tuple():
                raise ExpressionError(f"a `,` is allowed only between the arguments of a function; {DECIMAL_POINT}")
        raise ExpressionError("arguments with `*` are not supported")

    def name(self, name: str) -> Node:
        if name in FUNCTIONS:
            raise ExpressionError(f"`{name}` is a function and needs arguments: {FUNCTIONS[name]}")
        if self.allowed is None or name in self.allowed:
            constant = CONSTANTS.get(name) if self.allowed is None else None
            if constant is None:
                self.used.add(name)
            return Name(name, constant)
        if name in CONSTANTS:
            return Name(name, CONSTANTS[name])
        if not self.allowed:
            near = nearest(name, CONSTANTS)
            raise ExpressionError(f"`{short(name)}` is not a number.{near} A number may be an expression with pi and e")
        allowed = [*sorted(self.allowed), *CONSTANTS]
        near, known = nearest(name, allowed), listed(allowed, name)
        raise ExpressionError(f"`{short(name)}` is not known.{near} Known names: {known}")

    def check_call(self, name: str, count: int) -> None:
        if name not in FUNCTIONS:
            if name in CONSTANTS or (self.allowed is not None and name in self.allowed):
                raise ExpressionError(f"`{name}` is not a function: write a product as `{name}*(...)`")
            meant = MEANT.get(name)
            hint = (
                f" {meant}." if meant else nearest(name, FUNCTIONS) or f" A product is written `{short(name)}*(...)`."
            )
            raise ExpressionError(f"there is no function `{short(name)}`.{hint} Functions: {', '.join(FUNCTIONS)}")
        low, high = _ARGUMENTS.get(name, (1, 1))
        if not low <= count <= high:
            raise ExpressionError(f"`{name}` was given {count} arguments, but it is {FUNCTIONS[name]}")


def finite(value: SupportsFloat | str, what: str) -> float:
    """``value`` as a float; an `ExpressionError` about ``what`` if it is infinite or NaN."""
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if math.isinf(number) and not isinstance(value, float):
        raise ExpressionError(f"{short(what)} is larger than any number (1.8e308)")
    if not math.isfinite(number):
        raise ExpressionError(f"{short(what)} is not finite")
    return number
