"""The grammar of expressions: from text to tokens, to Python's ``ast``, to a tree of our own.

Nothing is ever handed to eval. The text is cut into tokens first: there most mistakes can be named, and
there every number becomes a float, so that no power of integers can run for hours.
"""

from __future__ import annotations

import ast
import math
import re
import unicodedata
from collections.abc import Collection
from dataclasses import dataclass
from itertools import pairwise
from keyword import iskeyword
from typing import SupportsFloat, TypeAlias

from hgorun.config.nearest import nearest
from hgorun.config.separators import misread
from hgorun.errors import named_unseen, printable

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

NUMBER = re.compile(r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_TOKEN = re.compile(
    rf"(?P<number>{NUMBER.pattern})|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
    r"|(?P<sign>\*\*|<=|>=|==|!=|(?!//|<<|>>)[-+*/()<>,])|(?P<space>[ \t]+)|(?P<other>//|<<|>>|:=|.)",
    re.DOTALL,
)
_LOOKALIKES = {
    "−": "-",
    "–": "-",
    "×": "*",
    "·": "*",
    "÷": "/",
    "²": "**2",
    "³": "**3",
    "≤": "<=",
    "≥": ">=",
    "°": "*pi/180",
}
_HINTS = {
    "^": "a power is `**`",
    "//": "write floor(a/b)",
    "%": "a percentage is a fraction, 0.05 for five of a hundred, and a remainder a - b*floor(a/b)",
    "&": "write `and`",
    "|": "an absolute value is abs(x), and between conditions write `or`",
    "!": "write `not`",
    "?": "write a choice as where(condition, a, b)",
    "=": "a comparison is `==`; arguments have no keywords",
    ".": "a `.` belongs to a number; there are no attributes",
    "[": "there are no lists and no subscripts, so write x1 for x[1]",
    "'": "there is no text in an expression, and digits are not grouped",
    '"': "there is no text in an expression",
    "#": "a comment stands outside the expression",
}

# Of a function as other packages call it.
_ATTRIBUTE = re.compile(rf"\b[A-Za-z_]\w*\.({'|'.join((*FUNCTIONS, *CONSTANTS))})\b")

# Behind a number these are meant as its unit.
_UNITS = {
    *("s", "ms", "us", "ns", "sec", "min", "h", "hr", "hours", "d", "days", "Hz", "kHz", "m", "mm", "cm", "km", "um"),
    *("g", "kg", "mg", "l", "L", "ml", "V", "mV", "kV", "A", "mA", "K", "N", "Nm", "Pa", "kPa", "bar", "W", "kW", "J"),
    *("rad", "mrad", "deg", "degree", "degrees", "degC", "rpm", "mol", "mmol", "ohm", "Ohm", "percent"),
}
DECIMAL_POINT = "a decimal number is written with a point, as in 0.25"


class ExpressionError(ValueError):
    """An expression that is not one, or that has no value. The message says why and what would be right."""


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


def check_name(name: str) -> None:
    """Raise an `ExpressionError` if ``name`` cannot stand for a quantity in expressions."""
    if name.isdigit():
        why = DECIMAL_POINT
    elif remedy := misread(name):
        why = remedy
    elif re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*'", name):
        why = f"the right-hand side of {name} stands under {name[:-1]}"
    elif not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        why = "names are ASCII letters, digits and `_`, and begin with no digit"
    elif iskeyword(name):
        why = f"it is a keyword of the expression grammar; `{name}_` can be one"
    elif name.startswith("__"):
        why = "names do not begin with `__`"
    elif name in FUNCTIONS:
        why = f"it is a function, {FUNCTIONS[name]}"
    else:
        return
    raise ExpressionError(f"`{short(name)}` cannot be a name: {why}")


def short(text: str) -> str:
    """``text`` as messages quote it: at most 60 characters, all of them printable."""
    return printable(text if len(text) <= 60 else text[:57] + "...")


def tokens(text: str) -> list[str]:
    """Cut ``text`` into numbers, names and signs, and refuse what is none of these."""
    found = [match for match in _TOKEN.finditer(text) if match.lastgroup != "space"]
    level = 0
    for match in found:
        token = match[0]
        level += (token == "(") - (token == ")")
        if match.lastgroup == "other":
            other = _ATTRIBUTE.search(text) if token == "." else None
            raise ExpressionError(_foreign(token) if other is None else f"write `{other[1]}` for `{short(other[0])}`")
        if match.lastgroup == "name" and token not in ("and", "or", "not", *FUNCTIONS):
            if token in ("if", "else"):
                raise ExpressionError("write a choice as where(condition, a, b)")
            if token in ("True", "False", "None"):
                raise ExpressionError(f"`{token}` is not a number: write 1, 0 or a comparison")
            check_name(token)
        if level > MAX_NESTING:
            raise ExpressionError(f"parentheses nested more than {MAX_NESTING} deep")
        if level < 0:
            raise ExpressionError("a `)` without a `(`")
    if level:
        raise ExpressionError(
            "a `(` is not closed; inside { } or [ ] a comma ends the entry: put the expression in quotes"
        )
    for left, right in pairwise(found):
        _check_neighbours(left, right)
    return [match[0] for match in found]


def _foreign(token: str) -> str:
    if token in "\n\r":
        return "an expression is one line"
    if token.isascii():
        hint = _HINTS.get(token, "operators are + - * / ** < <= > >= == != and or not")
        return f"`{short(token)}` is not in the grammar: {hint}"
    if told := named_unseen(token):
        return told
    name = unicodedata.name(token, "no character")
    hint = _LOOKALIKES.get(token) or name.partition("GREEK SMALL LETTER ")[2].lower()
    return f"`{short(token)}` (U+{ord(token):04X}, {name}) is not ASCII" + (f": write `{hint}`" if hint else "")


def _check_neighbours(left: re.Match[str], right: re.Match[str]) -> None:
    a, b = left[0], right[0]
    if {a, b} & {"and", "or", "not"}:
        return
    if left.lastgroup == "number" and left.end() == right.start():
        if b in ("j", "J"):
            raise ExpressionError("complex numbers are not supported")
        if b.startswith("_") or (a == "0" and b[0] in "xXoObB" and b[1:2].isalnum()) or b[0] == ".":
            raise ExpressionError(
                f"`{short(a)}{short(b)}` is not a number: write digits with at most one `.`, no prefix and no `_`"
            )
    ends = left.lastgroup == "number" or a == ")" or (left.lastgroup == "name" and b != "(")
    begins = right.lastgroup in ("number", "name") or b == "("
    if left.lastgroup == "number" and b in _UNITS:
        turned = b in ("deg", "degree", "degrees")
        meant = f"write {short(a)}*pi/180" if turned else "times are in time.unit, the rest as in the model"
        raise ExpressionError(f"a number has no unit here, so `{short(b)}` is too much: {meant}")
    if left.lastgroup == right.lastgroup == "number":
        raise ExpressionError(
            f"two numbers, `{short(a)}` and `{short(b)}`, stand side by side: digits are not grouped, and a number has "
            "no unit here"
        )
    if ends and begins:
        unit = "; a number has no unit here" if left.lastgroup == "number" and right.lastgroup == "name" else ""
        if a in FUNCTIONS:
            raise ExpressionError(f"a function has parentheses, as in `{a}({short(b)})`")
        a, b = short(a), short(b)
        raise ExpressionError(f"an operator is missing between `{a}` and `{b}`: write a product as `{a}*{b}`{unit}")


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
        more = f" and {len(allowed) - 20} more" if len(allowed) > 20 else ""
        listed = f"{', '.join(allowed[:20])}{more}"
        raise ExpressionError(f"`{short(name)}` is not known.{nearest(name, allowed)} Known names: {listed}")

    def check_call(self, name: str, count: int) -> None:
        if name not in FUNCTIONS:
            if name in CONSTANTS or (self.allowed is not None and name in self.allowed):
                raise ExpressionError(f"`{name}` is not a function: write a product as `{name}*(...)`")
            hint = nearest(name, FUNCTIONS) or f" A product is written `{short(name)}*(...)`."
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
