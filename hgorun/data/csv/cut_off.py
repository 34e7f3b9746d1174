"""A file that ends inside its last number: what is left of 22.424 is read as 2 or as 22.4."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from hgorun.data.cells import Numbers
from hgorun.data.csv.dialect import Dialect
from hgorun.data.table import Table, Texts
from hgorun.errors import ConfigError
from hgorun.patterns import Pattern

_END = "\x1a"  # which programs of DOS write behind a text
_TAIL = 1 << 12  # bytes at the end of a file that are looked at
_FEWEST = 10  # cells that show how all of a column are written
_MANY = 30  # of which one would end with a zero, which a short form leaves out
_TWO, _THREE = 2, 3  # decimals that are zeros rarely; where as few as can be are written
_FORM = Pattern(r"[-+]?\d*([.,]\d*(?:[eE][-+]?\d*)?)?", re.ASCII)


def unfinished_line(path: Path) -> str:
    """What stands behind the last end of a line, as far as it is ASCII in any encoding; empty where that is whole."""
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(size - _TAIL, 0))
        tail = stream.read().replace(b"\0", b"")  # of two or four bytes a character
    last = re.split(rb"[\r\n]", tail)[-1].decode("utf-8", "replace").strip()
    return "" if last.endswith((_END, '"')) else last


def without_cut(table: Table, dialect: Dialect, near: Callable[[int], Texts]) -> Iterator[tuple[int, str]]:
    """Leave a last number out of a table that is cut off, and tell it with its line.

    Parameters
    ----------
    table : Table
        Changed.
    dialect : Dialect
    near : callable
        The texts of the rows near a line.

    Raises
    ------
    ConfigError
        Where it is a time stamp.
    """
    column = dialect.names[-1]
    last = [cells for cells in table.columns if isinstance(cells, Numbers) and cells.column == column]
    if not last or not table.lines.size or dialect.width > len(dialect.names):
        return
    line, unfinished = int(table.lines[-1]), unfinished_line(table.path)
    if not unfinished or dialect.is_comment(unfinished):
        return
    cells_above = dict(near(line)[column])
    cell = cells_above.pop(line, "")
    if not is_cut(cell, [other for other in cells_above.values() if other.lower() not in dialect.missing]):
        return
    said = f"the file ends in this line, and {cell!r} has fewer decimals than all others of {column!r}"
    if any(cells.key for cells in last):
        raise ConfigError(f"{said}: it is cut off; take this line out", file=str(table.path), line=line)
    for one in last:
        table.columns[one][-1] = np.nan
    yield line, f"{said}: it is taken as cut off, and left out; an end of the line behind it says that it is not"


def is_cut(cell: str, others: Sequence[str]) -> bool:
    """Whether a number seems to be the beginning of one: all others have as many decimals, and it has fewer.

    Numbers that are written as short as they can be have any number of decimals; without any, these have none only
    if the digits that are left out are all zeros.
    """
    forms, found = [_form(other) for other in others], _form(cell)
    if len(others) < _FEWEST or found is None or not all(form and len(form) > 1 for form in forms):
        return False
    longest = max(len(form) for form in forms if form)
    zeros = any(other.endswith("0") for other in others)
    if len(set(forms)) == 1 and str(forms[0]).startswith(found) and len(found) < longest:
        return zeros or len(others) >= _MANY
    short = len(set(forms)) > 1
    if short and not found and float(cell) == 0:  # what is off
        return False
    return found in (".", ",") or (not found and (zeros or longest > (_THREE if short else _TWO)))


def _form(cell: str) -> str | None:
    """What stands behind the whole part of a number, with one digit for all; None of what is no number."""
    match = _FORM.fullmatch(cell)
    if match is None or not any(map(str.isdigit, cell)):
        return None
    return re.sub(r"[-+]", "+", re.sub(r"\d", "0", match[1] or ""))
