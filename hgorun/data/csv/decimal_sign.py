"""Which sign stands between the digits of the numbers of a table: a point, or a comma that does not group thousands."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

from hgorun.data.csv.units_row import NUMBER
from hgorun.errors import ConfigError

_COMMA = re.compile(r"[-+]?\d*,\d*(?:[eE][-+]?\d+)?", re.ASCII)
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(?:,\d{3})+", re.ASCII)


def decimal_sign(numbered: Sequence[tuple[int, Sequence[str]]], path: Path) -> str:
    """The sign between the digits of numbers, of rows with their lines.

    Raises
    ------
    ConfigError
        When a comma may stand between digits or between thousands.
    """
    rows = [row for _, row in numbered]
    texts = {text.strip() for row in rows for text in row}
    commas = {text for text in texts if _has_comma(text)}
    if not commas:
        return "."
    if any(map(_has_point, texts)):
        return "," if _mostly_commas(rows) else "."
    if all(_THOUSANDS.fullmatch(text) for text in commas):
        line, found = next((line, text.strip()) for line, row in numbered for text in row if text.strip() in commas)
        message = (
            f'{found!r} may be a number with thousands or with decimals: say which, csv: {{thousands: ","}} '
            'or {decimal: ","}'
        )
        raise ConfigError(message, file=str(path), line=line)
    return ","


def _has_comma(text: str) -> bool:
    return "," in text and bool(_COMMA.fullmatch(text))


def _has_point(text: str) -> bool:
    return "." in text and bool(NUMBER.fullmatch(text))


def _mostly_commas(rows: Sequence[Sequence[str]]) -> bool:
    """Whether points are slips among decimal commas: most numbers have a comma, and no column has points alone.

    With points alone a column may be one that is wanted, beside remarks with commas that nobody wants. A column such as
    9,005 leaves open what its commas mean: another one, such as 0,15, has to show it.
    """
    total, shown = 0, False
    for column in zip_longest(*rows, fillvalue=""):
        texts = [text.strip() for text in column]
        commas = [text for text in texts if _has_comma(text)]
        points = sum(map(_has_point, texts))
        if points and not commas:
            return False
        shown = shown or not all(map(_THOUSANDS.fullmatch, commas))
        total += len(commas) - points
    return shown and total > 0
