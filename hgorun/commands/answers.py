"""What the answer to a question says: names, numbers, expressions.

Every function raises a ``ValueError`` that says what was expected.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from hgorun.config.expressions import ExpressionError, check_name, parse

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
# with which lists are written elsewhere
_SEPARATORS = (re.compile(r"[;|&\n]+|\band\b"), re.compile(r"\s+"))


def names(text: str) -> list[str]:
    """Different names with commas between."""
    given = [part.strip() for part in text.split(",")]
    if not all(map(_NAME.fullmatch, given)) or len(set(given)) < len(given):
        raise ValueError(f"expected different names with commas between, such as x1, x2; found {text!r}")
    for name in given:
        check_name(name)
    return given


def outputs(text: str) -> list[str]:
    """Expressions with commas between, also in the brackets of a list, and without the quotes that YAML may need."""
    whole = text[1:-1] if text.startswith("[") and text.endswith("]") else text
    given = [_unquoted(part.strip()) for part in _parts(whole)]
    apart = [piece for part in given for piece in _apart(part)]
    if len(apart) > len(given):
        raise ValueError(f"outputs are separated by commas: {', '.join(apart)}")
    for output in given:
        found = parse(expression(output))
        if not found.names:
            raise ValueError(f"{output} is a number; an output is a state or an expression of states")
        if found.is_condition:
            raise ValueError(f"{output} is true or false; an output is a state or an expression of states")
    if len(set(given)) < len(given):
        raise ValueError(f"outputs must differ, found {', '.join(given)}")
    return given


def _unquoted(text: str) -> str:
    quoted = len(text) > 1 and text[0] == text[-1] in "'\"" and text.count(text[0]) == 2
    return text[1:-1] if quoted else text


def _apart(text: str) -> list[str]:
    """What stands between other signs than commas, where each piece alone can be an output; else the whole text."""
    for separator in _SEPARATORS:
        pieces = [_unquoted(piece.strip()) for piece in separator.split(text)]
        if len(pieces) > 1 and all(map(_may_be_output, pieces)):
            return pieces
    return [text]


def _may_be_output(text: str) -> bool:
    try:
        found = parse(text)
    except ExpressionError:
        return False
    return bool(found.names) and not found.is_condition


def _parts(text: str) -> list[str]:
    """What stands between commas, but for those between the arguments of a function."""
    parts, depth = [""], 0
    for char in text:
        depth += (char == "(") - (char == ")")
        if char == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += char
    return parts


def names_in(texts: Iterable[str]) -> set[str]:
    """All names that occur in expressions."""
    return {name for text in texts for name in parse(text).names}


def assignments(text: str) -> dict[str, float]:
    """Names and their numbers, ``a = 1, b = 2``."""
    found: dict[str, float] = {}
    for part in text.split(",") if text else ():
        name, sign, value = part.partition("=")
        if not sign or not _NAME.fullmatch(name.strip()):
            raise ValueError(f"expected name = number, found {part.strip()!r}")
        check_name(name.strip())
        found[name.strip()] = number(value)
    return found


def expression(text: str, known: set[str] | None = None) -> str:
    """An expression, of certain names alone where these are given."""
    if not text:
        raise ValueError("expected an expression, such as -x1 + sin(t)")
    parse(text, names=known)
    return text


def number(text: str) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"expected a number, found {text.strip()!r}")
    return value


def positive(text: str) -> float:
    """A number above 0."""
    value = number(text)
    if value <= 0:
        raise ValueError(f"expected a number > 0, found {text}")
    return value


def not_negative(text: str) -> float:
    """A number that is 0 or above."""
    value = number(text)
    if value < 0:
        raise ValueError(f"expected a number >= 0, found {text}")
    return value
