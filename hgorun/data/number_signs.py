"""Signs in the numbers of a text: between digits and decimals, and between thousands."""

from __future__ import annotations

import re
from collections.abc import Collection

from hgorun.patterns import Pattern

_DIGITS = r"[-+]?(?:[0-9]+(?:{0}[0-9]*)?|{0}[0-9]+)(?:[eE][-+]?[0-9]+)?"
NUMBER = {".": re.compile(_DIGITS.format(r"\.")), ",": re.compile(_DIGITS.format(","))}
"""A number as cells have it, by its decimal sign: no digits of other scripts, and no signs between them."""

_BETWEEN = {  # what may stand between thousands, as typography has it, too
    ".": r"\.",
    ",": ",",
    " ": "[ \u00a0\u2007\u2009\u202f]",
    "'": "['\u00b4\u02bc\u2019]",
}
_WHOLE = Pattern(r"[-+]?[0-9]{4}")
OTHER = {".": ",", ",": "."}
"""The other decimal sign."""


def grouped(thousands: str, decimal: str) -> re.Pattern[str]:
    """A number with signs between its thousands: what stands before the decimals, and these."""
    between, sign = _BETWEEN[thousands], re.escape(decimal)
    return re.compile(rf"([-+]?[0-9]{{1,3}}(?:{between}[0-9]{{3}})+)((?:{sign}[0-9]*)?)")


def _many_groups(sign: str) -> re.Pattern[str]:
    """A number with a sign more than once, between its thousands."""
    return re.compile(rf"[-+]?[0-9]{{1,3}}(?:{re.escape(sign)}[0-9]{{3}}){{2,}}(?:{re.escape(OTHER[sign])}[0-9]*)?")


def sign_hint(said: str, text: str, decimal: str, thousands: str | None, others: Collection[str]) -> str:
    """How a text is read that is a number with other signs than those of the file; empty where it is none.

    Parameters
    ----------
    said : str
        What is said in front.
    text, decimal : str
    thousands : str or None
        As the file is read.
    others : collection of str
        Cells of its column. Signs between thousands are said only where none of them is written without.
    """
    other = OTHER[decimal]
    if NUMBER[other].fullmatch(text):
        taken, found = ("point", "comma") if other == "," else ("comma", "point")
        may_be = thousands is None and grouped(other, decimal).fullmatch(text)
        between = may_be and _are_grouped([*others, text], other, decimal)
        behind = f'; for signs between thousands: csv: {{thousands: "{other}"}}' if between else ""
        return f'{said}; decimals have a {taken} here; where all have a {found}: csv: {{decimal: "{other}"}}{behind}'
    if thousands is None:
        signs = [sign for sign in _BETWEEN if sign != decimal and grouped(sign, decimal).fullmatch(text)]
        signs += [decimal] * (_many_groups(decimal).fullmatch(text) is not None)
        if signs:
            return f'{said}; for signs between thousands: csv: {{thousands: "{signs[0]}"}}'
    for sign in _BETWEEN if thousands is None else (thousands,):
        if sign != other and grouped(sign, other).fullmatch(text):
            both = f'{{thousands: "{sign}", decimal: "{other}"}}'
            return f"{said}; for signs between thousands and of decimals: csv: {both}"
    return ""


def _are_grouped(texts: Collection[str], thousands: str, decimal: str) -> bool:
    """Whether all numbers of a column can have signs between thousands: none of a thousand is without, and either all
    have decimals or none."""
    numbers = [text for text in texts if NUMBER[decimal].fullmatch(text)]
    numbers += [text for text in texts if grouped(thousands, decimal).fullmatch(text)]
    return not any(map(_WHOLE.match, numbers)) and len({decimal in text for text in numbers}) == 1
