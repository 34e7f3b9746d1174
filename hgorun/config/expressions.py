"""Expressions in text: a small grammar on Python's ``ast``, evaluated as floats or as CasADi symbols.

Nothing is ever handed to eval. The text is cut into tokens first: there most mistakes can be named, and
there every number becomes a float, so that no power of integers can run for hours.
"""

from __future__ import annotations

import ast
import math
import operator
import re
import unicodedata
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import reduce
from itertools import islice, pairwise
from keyword import iskeyword
from numbers import Real
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    import casadi

MAX_LENGTH = 2_000
MAX_NESTING = 100

FUNCTIONS = {
    "abs": "abs(x): absolute value",
    "acos": "acos(x): arc cosine, in radians",
    "asin": "asin(x): arc sine, in radians",
    "atan": "atan(x): arc tangent, in radians",
    "atan2": "atan2(y, x): angle of the point (x, y), in radians",
    "ceil": "ceil(x): smallest integer >= x",
    "cos": "cos(x): cosine of x in radians",
    "cosh": "cosh(x): hyperbolic cosine",
    "exp": "exp(x): e to the power x",
    "floor": "floor(x): largest integer <= x",
    "log": "log(x): natural logarithm",
    "log10": "log10(x): logarithm to base 10",
    "max": "max(a, b, ...): largest of two or more",
    "min": "min(a, b, ...): smallest of two or more",
    "sign": "sign(x): -1, 0 or 1",
    "sin": "sin(x): sine of x in radians",
    "sinh": "sinh(x): hyperbolic sine",
    "sqrt": "sqrt(x): square root",
    "tan": "tan(x): tangent of x in radians",
    "tanh": "tanh(x): hyperbolic tangent",
    "where": "where(condition, a, b): a where the condition is not 0, else b",
}
CONSTANTS = {"pi": math.pi, "e": math.e}

_ARGUMENTS = {"atan2": (2, 2), "max": (2, MAX_LENGTH), "min": (2, MAX_LENGTH), "where": (3, 3)}
_SIGNS: dict[type[ast.AST], str] = {
    **{ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"},
    **{ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="},
    **{ast.USub: "neg", ast.Not: "not", ast.And: "and", ast.Or: "or"},
}
_OPERATORS: dict[str, Callable[..., Any]] = {  # of floats and of symbols alike
    **{"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "**": operator.pow},
    **{"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge},
    **{"==": operator.eq, "!=": operator.ne, "neg": operator.neg},
}
_OF_FLOATS: dict[str, Callable[..., Any]] = {
    **{name: getattr(math, name) for name in FUNCTIONS if hasattr(math, name)},
    **{"abs": abs, "min": min, "max": max, "not": operator.not_, "sign": lambda x: (x > 0) - (x < 0)},
}
_IN_CASADI = {"abs": "fabs", "min": "fmin", "max": "fmax", "where": "if_else"}
_IN_CASADI |= {"and": "logic_and", "or": "logic_or", "not": "logic_not"}

_NO_VALUES: Mapping[str, Any] = MappingProxyType({})

_TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
    r"|(?P<sign>\*\*|<=|>=|==|!=|(?!//|<<|>>)[-+*/()<>,])|(?P<space>[ \t]+)|(?P<other>//|<<|>>|:=|.)",
    re.DOTALL,
)
_LOOKALIKES = {"−": "-", "–": "-", "×": "*", "·": "*", "÷": "/", "²": "**2", "³": "**3", "≤": "<=", "≥": ">="}
_HINTS = {
    "^": "a power is `**`",
    "//": "write floor(a/b)",
    "%": "a remainder is a - b*floor(a/b)",
    "&": "write `and`",
    "|": "write `or`",
    "!": "write `not`",
    "=": "a comparison is `==`; arguments have no keywords",
    ".": "a `.` belongs to a number; there are no attributes",
    "[": "there are no lists and no subscripts, so write x1 for x[1]",
    "'": "there is no text in an expression",
    '"': "there is no text in an expression",
    "#": "a comment stands outside the expression",
}


class ExpressionError(ValueError):
    """An expression that is not one, or that has no value. The message says why and what would be right."""


@dataclass(frozen=True, slots=True)
class _Name:
    name: str
    constant: float | None


@dataclass(frozen=True, slots=True)
class _Call:
    operation: str
    arguments: tuple[_Node, ...]


@dataclass(frozen=True, slots=True)
class _Chain:
    """first sign operand sign operand ..., from the left: long sums are long, not deep."""

    first: _Node
    rest: tuple[tuple[str, _Node], ...]


class _Comparison(_Chain):
    __slots__ = ()


_Node: TypeAlias = float | _Name | _Call | _Chain


@dataclass(frozen=True)
class Expression:
    """An expression that `parse` has understood.

    Parameters
    ----------
    text : str
        As it was written.
    names : frozenset of str
        The names that need a value; `pi` and `e` only where they were declared as names.
    """

    text: str
    names: frozenset[str]
    _tree: _Node = field(repr=False, compare=False)

    def number(self, values: Mapping[str, float] = _NO_VALUES) -> float:
        """Return the value as a finite float.

        Raises
        ------
        ExpressionError
            A value is missing or not finite, or an operation overflows, divides by zero or has no real value.
        """
        value = self._evaluate(values)
        if not isinstance(value, float):
            raise ExpressionError(f"`{_short(self.text)}`: a value is not a number")
        return value

    def symbol(self, values: Mapping[str, Any] = _NO_VALUES) -> casadi.SX:
        """Return the expression in CasADi; ``values`` are scalar SX or numbers, and numbers are folded."""
        import casadi

        return casadi.SX(self._evaluate(values))

    def _evaluate(self, values: Mapping[str, Any]) -> Any:
        try:
            return _evaluate(self._tree, values)
        except ExpressionError as error:
            raise ExpressionError(f"`{_short(self.text)}`: {error}") from None


def parse(value: str | int | float, *, names: Collection[str] | None = None) -> Expression:
    """Read an expression.

    Parameters
    ----------
    value : str, int or float
        Its text, or a number.
    names : collection of str, optional
        The names that may occur besides `pi` and `e`, which they may shadow; any name by default.

    Raises
    ------
    ExpressionError
        The text is not in the grammar, or uses a name that is not in ``names``.
    """
    if isinstance(value, bool) or not isinstance(value, (str, Real)):
        found = f"the truth value {value}" if isinstance(value, bool) else type(value).__name__
        raise ExpressionError(f"expected a number or an expression, found {found}")
    if not isinstance(value, str):
        number = _finite(value, "the number")
        return Expression(str(value) if isinstance(value, int) else repr(number), frozenset(), number)
    text = value.strip(" \t")
    if not text:
        raise ExpressionError("the expression is empty")
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"the expression has {len(text):,} characters; {MAX_LENGTH:,} are the limit")
    reader = _Reader(names)
    try:
        tree = reader.read(_syntax_tree(_tokens(text)), 0)
    except ExpressionError as error:
        raise ExpressionError(f"`{_short(text)}`: {error}") from None
    return Expression(text, frozenset(reader.used), tree)


def check_name(name: str) -> None:
    """Raise an `ExpressionError` if ``name`` cannot stand for a quantity in expressions."""
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        why = "names are ASCII letters, digits and `_`, and begin with no digit"
    elif iskeyword(name):
        why = f"it is a keyword of the expression grammar; `{name}_` can be one"
    elif name.startswith("__"):
        why = "names do not begin with `__`"
    elif name in FUNCTIONS:
        why = f"it is a function, {FUNCTIONS[name]}"
    else:
        return
    raise ExpressionError(f"`{_short(name)}` cannot be a name: {why}")


def nearest(name: str, candidates: Iterable[str]) -> str:
    """Return " Did you mean `x`?" with the candidate most like ``name``, or "" if none is."""
    import difflib

    known = {candidate.lower(): candidate for candidate in islice(candidates, 1_000) if len(candidate) < 100}
    close = difflib.get_close_matches(name[:100].lower(), known, n=1, cutoff=0.5)
    return f" Did you mean `{known[close[0]]}`?" if close else ""


def _short(text: str) -> str:
    shown = text if len(text) <= 60 else text[:57] + "..."
    return "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in shown)


def _tokens(text: str) -> list[str]:
    """Cut ``text`` into numbers, names and signs, and refuse what is none of these."""
    found = [match for match in _TOKEN.finditer(text) if match.lastgroup != "space"]
    level = 0
    for match in found:
        token = match[0]
        level += (token == "(") - (token == ")")
        if match.lastgroup == "other":
            raise ExpressionError(_foreign(token))
        if match.lastgroup == "name" and token not in ("and", "or", "not", *FUNCTIONS):
            if token in ("if", "else"):
                raise ExpressionError("a choice is written where(condition, a, b)")
            if token in ("True", "False", "None"):
                raise ExpressionError(f"`{token}` is not a number: write 1, 0 or a comparison")
            check_name(token)
        if level > MAX_NESTING:
            raise ExpressionError(f"more than {MAX_NESTING} parentheses inside each other")
        if level < 0:
            raise ExpressionError("a `)` has no `(`")
    if level:
        raise ExpressionError("a `(` is not closed")
    for left, right in pairwise(found):
        _check_neighbours(left, right)
    return [match[0] for match in found]


def _foreign(token: str) -> str:
    if token in "\n\r":
        return "an expression is one line"
    if token.isascii():
        hint = _HINTS.get(token, "operators are + - * / ** < <= > >= == != and or not")
        return f"`{_short(token)}` is not in the grammar: {hint}"
    name = unicodedata.name(token, "no character")
    hint = _LOOKALIKES.get(token) or name.partition("GREEK SMALL LETTER ")[2].lower()
    return f"`{_short(token)}` (U+{ord(token):04X}, {name}) is not ASCII" + (
        f": write `{hint}`" if hint else ""
    )


def _check_neighbours(left: re.Match[str], right: re.Match[str]) -> None:
    a, b = _short(left[0]), _short(right[0])
    if {a, b} & {"and", "or", "not"}:
        return
    if left.lastgroup == "number" and left.end() == right.start():
        if b in ("j", "J"):
            raise ExpressionError("complex numbers are not in the grammar")
        if b.startswith("_") or (a == "0" and b[0] in "xXoObB" and b[1:2].isalnum()) or b[0] == ".":
            raise ExpressionError(f"`{a}{b}` is not a number: digits have one `.`, no prefix and no `_`")
    ends = left.lastgroup == "number" or a == ")" or (left.lastgroup == "name" and b != "(")
    begins = right.lastgroup in ("number", "name") or b == "("
    if ends and begins:
        raise ExpressionError(f"nothing stands between `{a}` and `{b}`: a product is written `{a}*{b}`")


def _syntax_tree(tokens: list[str]) -> ast.expr:
    # Joined by single spaces, with every number a float, the text holds nothing that Python warns about.
    if tokens[-1] in ("not", "and", "or") or not re.match(r"[\w.)]", tokens[-1]):
        raise ExpressionError(f"something is missing after `{_short(tokens[-1])}`")
    parts = [repr(_finite(token, token)) if token[0] in ".0123456789" else token for token in tokens]
    text = " ".join(parts)
    try:
        return ast.parse(text, mode="eval").body
    except SyntaxError as error:
        last = len(text[: max((error.offset or 1) - 1, 0)].split())
        where = f"after `{_short(tokens[min(last, len(tokens)) - 1])}`" if last else "at the beginning"
        raise ExpressionError(f"something is missing or too much {where}") from None
    except (RecursionError, MemoryError):
        raise ExpressionError("the nesting is too deep") from None


class _Reader:
    """Turns Python's tree into ours and notes the names."""

    def __init__(self, names: Collection[str] | None) -> None:
        self.allowed = names
        self.used: set[str] = set()

    def read(self, tree: ast.expr, depth: int) -> _Node:
        if depth > MAX_NESTING:
            raise ExpressionError(f"more than {MAX_NESTING} operations inside each other")
        match tree:
            case ast.Constant(value=float() as number):
                return number
            case ast.Name(id=name):
                return self.name(name)
            case ast.BinOp():
                rest: list[tuple[str, _Node]] = []
                first: ast.expr = tree
                while isinstance(first, ast.BinOp):
                    rest.append((_SIGNS[type(first.op)], self.read(first.right, depth + 1)))
                    first = first.left
                return _Chain(self.read(first, depth + 1), tuple(reversed(rest)))
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.read(operand, depth + 1)
            case ast.UnaryOp(op=sign, operand=operand):
                return _Call(_SIGNS[type(sign)], (self.read(operand, depth + 1),))
            case ast.Compare(left=left, ops=signs, comparators=others):
                links = [
                    (_SIGNS[type(s)], self.read(o, depth + 1)) for s, o in zip(signs, others, strict=True)
                ]
                return _Comparison(self.read(left, depth + 1), tuple(links))
            case ast.BoolOp(op=sign, values=parts):
                return _Call(_SIGNS[type(sign)], tuple(self.read(part, depth + 1) for part in parts))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if not any(
                isinstance(argument, ast.Starred) for argument in arguments
            ):
                self.check_call(name, len(arguments))
                return _Call(name, tuple(self.read(argument, depth + 1) for argument in arguments))
            case ast.Tuple(elts=[]):
                raise ExpressionError("there is nothing between `(` and `)`")
            case ast.Tuple():
                raise ExpressionError("a `,` stands only between the arguments of a function")
        raise ExpressionError("arguments with `*` are not in the grammar")

    def name(self, name: str) -> _Node:
        if name in FUNCTIONS:
            raise ExpressionError(f"`{name}` is a function and needs arguments: {FUNCTIONS[name]}")
        if self.allowed is None or name in self.allowed:
            constant = CONSTANTS.get(name) if self.allowed is None else None
            if constant is None:
                self.used.add(name)
            return _Name(name, constant)
        if name in CONSTANTS:
            return _Name(name, CONSTANTS[name])
        allowed = [*sorted(self.allowed), *CONSTANTS]
        more = f" and {len(allowed) - 20} more" if len(allowed) > 20 else ""
        listed = f"{', '.join(allowed[:20])}{more}"
        raise ExpressionError(f"`{_short(name)}` is not known.{nearest(name, allowed)} Known names: {listed}")

    def check_call(self, name: str, count: int) -> None:
        if name not in FUNCTIONS:
            if name in CONSTANTS or (self.allowed is not None and name in self.allowed):
                raise ExpressionError(f"`{name}` is not a function: a product is written `{name}*(...)`")
            hint = nearest(name, FUNCTIONS) or f" A product is written `{_short(name)}*(...)`."
            raise ExpressionError(
                f"there is no function `{_short(name)}`.{hint} Functions: {', '.join(FUNCTIONS)}"
            )
        low, high = _ARGUMENTS.get(name, (1, 1))
        if not low <= count <= high:
            raise ExpressionError(f"`{name}` was given {count} arguments, but it is {FUNCTIONS[name]}")


def _evaluate(node: _Node, values: Mapping[str, Any]) -> Any:
    """Evaluate on floats as far as they go, and on CasADi symbols from there."""
    match node:
        case _Name(name, constant):
            value = values.get(name, constant)
            if value is None:
                raise ExpressionError(f"`{_short(name)}` has no value")
            return _finite(value, f"the value of `{name}`") if isinstance(value, Real) else value
        case _Comparison(rest=rest):
            links = _links(node, values)
            return next(links) if len(rest) == 1 else _combine("and", links)
        case _Chain(first, rest):
            result = _evaluate(first, values)
            for sign, operand in rest:
                result = _apply(sign, result, _evaluate(operand, values))
            return result
        case _Call("and" | "or" as operation, arguments):
            return _combine(operation, (_evaluate(argument, values) for argument in arguments))
        case _Call("where", (condition, a, b)):
            choice = _evaluate(condition, values)
            if isinstance(choice, float):  # what is not chosen may be 1/0
                return _evaluate(a if choice else b, values)
            return _apply("where", choice, _evaluate(a, values), _evaluate(b, values))
        case _Call(operation, arguments):
            return _apply(operation, *(_evaluate(argument, values) for argument in arguments))
    return node


def _links(node: _Comparison, values: Mapping[str, Any]) -> Iterator[Any]:
    left = _evaluate(node.first, values)
    for sign, operand in node.rest:
        right = _evaluate(operand, values)
        yield _apply(sign, left, right)
        left = right


def _combine(operation: str, parts: Iterable[Any]) -> Any:
    """Join truth values with `and` or `or`, which stop, as Python's do, at the first that decides."""
    symbols = []
    for part in parts:
        if not isinstance(part, float):
            symbols.append(_apply("!=", part, 0.0))
        elif bool(part) == (operation == "or"):
            return float(operation == "or")
    return _apply(operation, *symbols) if symbols else float(operation == "and")


def _apply(operation: str, *values: Any) -> Any:
    if all(isinstance(value, float) for value in values):
        return _on_floats(operation, *values)
    if operation in _OPERATORS:
        return _OPERATORS[operation](*values)
    import casadi

    function = getattr(casadi, _IN_CASADI.get(operation, operation))
    folds = operation in ("min", "max", "and", "or")
    return reduce(function, values) if folds else function(*values)


def _on_floats(operation: str, *values: float) -> float:
    try:
        result = (_OPERATORS.get(operation) or _OF_FLOATS[operation])(*values)
        if not isinstance(result, complex) and math.isfinite(result):
            return float(result)
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


def _finite(value: Any, what: str) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ExpressionError(f"{_short(what)} is not finite")
    return number
