"""The words of expressions: a text is cut into numbers, names and signs, where most mistakes can be named."""

from __future__ import annotations

import math
import re
import unicodedata
from itertools import pairwise
from keyword import iskeyword

from hgorun.config.separators import misread
from hgorun.errors import named_unseen, printable
from hgorun.patterns import Pattern

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
MEANT = {
    **dict.fromkeys(("step", "heaviside", "Heaviside", "unitstep"), "A step at t = 1 is where(t > 1, 1, 0)"),
    **dict.fromkeys(("ln", "Log"), "The natural logarithm is log(x)"),
    **dict.fromkeys(("pow", "power"), "A power is a**b"),
    **dict.fromkeys(("square", "sqr"), "A square is x**2"),
    **dict.fromkeys(("mod", "rem", "fmod"), "A remainder is a - b*floor(a/b)"),
    **dict.fromkeys(("sat", "clip", "clamp"), "A saturation is max(low, min(x, high))"),
    **dict.fromkeys(
        ("rand", "randn", "random", "normal", "noise"),
        "Noise stands under measurement.noise: {type: gaussian, std: 0.1}",
    ),
}
"""Functions of other languages, with how what they say is written."""
CONSTANTS = {"pi": math.pi, "e": math.e}

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
    ":": "a date or a time of day is a number, of time.unit since data.origin or the first date",
    "#": "a comment stands outside the expression",
}

# Of a function as other packages call it.
_ATTRIBUTE = Pattern(rf"\b[A-Za-z_]\w*\.({'|'.join((*FUNCTIONS, *CONSTANTS))})\b")
_BY_ENTRIES = Pattern(r"\.(\*\*?|/|\^)")  # operators of other languages, for arrays

# Behind a number these are meant as its unit.
_UNITS = {
    *("s", "ms", "us", "ns", "sec", "min", "h", "hr", "hours", "d", "days", "Hz", "kHz", "m", "mm", "cm", "km", "um"),
    *("g", "kg", "mg", "l", "L", "ml", "V", "mV", "kV", "A", "mA", "K", "N", "Nm", "Pa", "kPa", "bar", "W", "kW", "J"),
    *("rad", "mrad", "deg", "degree", "degrees", "degC", "rpm", "mol", "mmol", "ohm", "Ohm", "percent"),
}
_UNIT_OF = "times are in time.unit, the rest as in the model"
DECIMAL_POINT = "a decimal number is written with a point, as in 0.25"


class ExpressionError(ValueError):
    """An expression that is not one, or that has no value. The message says why and what would be right."""


def ends_a_number(key: str) -> bool:
    """Whether a key may be what stands behind a decimal comma, as {u: 0,5*sin(t)} is read."""
    return re.match(r"\d+(?!\w)|\d+[eE]", key) is not None


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
        if ends_a_number(name):
            why += f"; if it is the end of a number, {DECIMAL_POINT}"
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
    _check_unit(text, found)
    level = 0
    for match in found:
        token = match[0]
        level += (token == "(") - (token == ")")
        if match.lastgroup == "other":
            if token == "." and (by_entries := _BY_ENTRIES.match(text, match.start())):
                raise ExpressionError(f"write `{by_entries[1].replace('^', '**')}` for `{by_entries[0]}`")
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


def _check_unit(text: str, found: list[re.Match[str]]) -> None:
    """Refuse a quantity with its unit, whatever signs this unit has: 9.81 m/s^2, or 4 1/s^2."""
    behind = [match for i, match in enumerate(found) if i or match[0] not in "+-"]
    if len(behind) < 2 or behind[0].lastgroup != "number":
        return
    one, over, *rest = [*(match[0] for match in behind[1:4]), "", ""]
    if one == "1" and over == "/" and rest[0] in _UNITS:
        told = short(text[behind[1].start() :].strip())
        raise ExpressionError(f"a number has no unit here, so `{told}` is too much: {_UNIT_OF}")
    if one in _UNITS:
        _check_neighbours(behind[0], behind[1])


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
        meant = f"write {short(a)}*pi/180" if turned else _UNIT_OF
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
