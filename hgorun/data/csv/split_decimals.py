"""Numbers with decimal commas in a file that is separated by commas: each stands in two columns, if the header has a
name more than there are columns.

Such a row has as many cells as the header, and 20,104 is read as 20.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path

import numpy as np

from hgorun.data.cells import Numbers
from hgorun.data.csv.dialect import Dialect
from hgorun.data.csv.units_row import NUMBER
from hgorun.data.table import Table, Texts
from hgorun.errors import ConfigError
from hgorun.patterns import Pattern

_WHOLE = Pattern(r"[-+]?\d+", re.ASCII)
_OF_WORDS = Pattern(r"(?i)notes?|notiz(en)?|(comment|remark|bemerkung|kommentar|anmerkung|hinweis)s?")
_OF_TIME = Pattern(r"(?i).*(ms|milli|msec|µs|us|sec|min|time|date|frac|nano|micro).*|s|ns|hh?|mm?|ss?")
_OTHERS = 20  # numbers with points that show how all are written
_FEWEST = 3  # rows that show how numbers are written
_SPREAD = 4  # first digits that decimals have, and codes of states have not
_PADDED = 0.5  # of whole numbers of one length: so many begin with a zero


def require_no_split_decimals(dialect: Dialect, wanted: Collection[str], path: Path) -> None:
    """Refuse the columns in which numbers seem to be in two parts, if they are read.

    Raises
    ------
    ConfigError
    """
    rows = [(line, [*map(str.strip, row)]) for line, row in dialect.rows]
    texts = {cell for _, row in rows for cell in row}
    whole = all(len(row) == dialect.width for _, row in rows)
    if not whole or dialect.separator != "," or any("." in text and NUMBER.fullmatch(text) for text in texts):
        return
    last = max((k for _, row in rows for k, cell in enumerate(row[: len(dialect.names)]) if cell), default=0)
    if last < 1 or not {dialect.names[last - 1], dialect.names[last]} & set(wanted):
        return
    pairs = [
        (line, row[last - 1], row[last])
        for line, row in rows
        if last < len(row) and not {row[last - 1].lower(), row[last].lower()} & dialect.missing
    ]
    if 2 * len(pairs) < len(rows) or not _are_halves(pairs, dialect.names[last]):
        return
    line, before, behind = pairs[0]
    message = (
        f"{before},{behind} may be one number or two: {before} in the column {dialect.names[last - 1]!r}, and digits "
        f"as decimals have them in the last one; of decimal commas in a file separated by commas: separate by ; or "
        'put such numbers in quotes; if they are two: csv: {decimal: "."}'
    )
    raise ConfigError(message, file=str(path), line=line)


def split_in_a_row(table: Table, dialect: Dialect, near: Callable[[int], Texts]) -> Iterator[tuple[int, str]]:
    """What is told of single rows with two whole numbers side by side, where all others of these columns have points.

    Parameters
    ----------
    table : Table
    dialect : Dialect
    near : callable
        The texts of the rows near a line.
    """
    if dialect.separator != "," or dialect.decimal != "." or dialect.thousands is not None:
        return
    places = {dialect.names.index(cells.column): cells for cells in table.columns if isinstance(cells, Numbers)}
    for place, cells in places.items():
        if place + 1 not in places:
            continue
        pair = cells, places[place + 1]
        whole = np.logical_and(*(table.columns[one] == np.floor(table.columns[one]) for one in pair))
        found = np.flatnonzero(whole)
        for line in table.lines[found[:_FEWEST] if found.size <= _FEWEST else []].tolist():
            above = [dict(near(line)[one.column]) for one in pair]
            texts = [column.pop(line, "") for column in above]
            others = [text for column in above for text in column.values() if text.lower() not in dialect.missing]
            if len(others) >= _OTHERS and all(map(_WHOLE.fullmatch, texts)) and all("." in text for text in others):
                yield (
                    line,
                    (
                        f"{','.join(texts)} in this row may be one number with a decimal comma: all others of "
                        f"{pair[0].column!r} and {pair[1].column!r} near it have points; read as two numbers"
                    ),
                )


def _are_halves(pairs: Sequence[tuple[int, str, str]], name: str) -> bool:
    """Whether whole numbers and what stands in the last column behind them look like numbers with decimals."""
    behind = [text for *_, text in pairs]
    digits = all(text.isascii() and text.isdigit() for text in behind)
    if len(pairs) < _FEWEST or not digits or not all(_WHOLE.fullmatch(text) for _, text, _ in pairs):
        return False
    if not name:
        return len(set(behind)) > 1
    spread = len({text[0] for text in behind}) >= _SPREAD
    if _OF_WORDS.fullmatch(name):
        return spread
    zeros = sum(text[0] == "0" and len(text) > 1 for text in behind)
    if {len(text) for text in behind} == {2}:  # as days, weeks and sums are written
        return False
    return spread and 0 < zeros <= _PADDED * len(behind) and not _OF_TIME.fullmatch(name)
