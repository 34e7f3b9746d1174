"""A header whose names hold ends of lines, as spreadsheets write cells of several lines: in quotes."""

from __future__ import annotations

import csv
from collections.abc import Sequence

_MOST = 20  # lines of a header
_QUOTE = '"'


def whole_header(lines: Sequence[str], separators: Sequence[str]) -> tuple[int, str]:
    """Of how many lines a header consists, and all of it as one: a space stands where a line ended.

    It is the first line alone unless a cell in quotes, which begins there, ends on a later one.

    Parameters
    ----------
    lines : sequence of str
        The first lines, one at least.
    separators : sequence of str
        Those that may divide it.
    """
    for count in range(2, min(_MOST, len(lines)) + 1) if lines[0].count(_QUOTE) % 2 else ():
        whole = " ".join(line.strip() for line in lines[:count])
        if whole.count(_QUOTE) % 2:
            continue
        closed = any(not _is_closed(lines[0], one) and _is_closed(whole, one) for one in separators)
        return (count, whole) if closed else (1, lines[0])
    return 1, lines[0]


def _is_closed(line: str, separator: str) -> bool:
    """Whether all quotes that open cells close before a separator or the end."""
    try:
        next(csv.reader([line], delimiter=separator, strict=True, skipinitialspace=True))
    except csv.Error:
        return False
    return True
