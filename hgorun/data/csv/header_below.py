"""Where the header of a text file stands below the line that was taken for it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

_SEPARATORS = ",;\t|"
_TWO = 2  # names that a line of words between spaces has by chance only rarely
_UNIT = re.compile(r"\s*[\[({<].*")


def header_below(lines: Sequence[str], column: str, names: Iterable[str]) -> int | None:
    """The line of some that has a column as a whole cell, and most of the other columns that are read.

    Parameters
    ----------
    lines : sequence of str
    column : str
    names : iterable of str
        Of all columns that are read.

    Returns
    -------
    int or None
        Its place; the first one of several.
    """
    wanted = {name.strip() for name in names} - {""}
    counts: dict[int, tuple[int, bool]] = {}
    for place, line in enumerate(lines):
        cells = _cells(line)
        found = wanted & cells
        separated = any(sign in line for sign in _SEPARATORS)
        if column.strip() in cells - {""} and (separated or len(found) >= min(len(wanted), _TWO)):
            counts[place] = len(found), separated
    return max(counts, key=lambda place: counts[place], default=None)


def _cells(line: str) -> set[str]:
    """The texts between separators, or between spaces where there is none, also without a unit in brackets."""
    parts = [part for sign in _SEPARATORS if sign in line for part in line.split(sign)] or line.split()
    cells = {part.strip().strip('"').strip() for part in parts}
    return cells | {_UNIT.sub("", cell) for cell in cells}
