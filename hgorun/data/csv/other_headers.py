"""Lines below a header that are headers of other columns or units: those of a logger that was restarted.

Rows below such a line that are read by the first header get into columns in which they were not measured.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from hgorun.data.csv.dialect import Dialect
from hgorun.data.csv.splitting import SPACES, cells_of
from hgorun.data.csv.units_row import are_units, is_value
from hgorun.data.units.named_units import without_any_unit

_BRACKETS = "[](){}<> "


def other_header(comment: str, dialect: Dialect, times: Collection[str]) -> str:
    """What a comment says of columns or of their units, if the header says another thing; else empty.

    Parameters
    ----------
    comment : str
    dialect : Dialect
    times : collection of str
        Columns of time stamps: a comment that has one of them and half of all names is a header.
    """
    if dialect.separator != SPACES and comment.count(dialect.separator) < len(dialect.names) - 1:  # most comments
        return ""
    bare = comment.lstrip().removeprefix(dialect.comment).strip()
    cells = [cell.strip() for cell in cells_of(bare, dialect.separator)]
    if len(cells) == len(dialect.names) + 1 and not cells[-1]:
        cells.pop()
    if len(cells) != len(dialect.names) or any(map(is_value, cells)) or tuple(cells) == dialect.names:
        return ""
    is_other = has_other_names(cells, dialect.names) or _has_other_units(cells, dialect.units)
    if not is_other and dialect.separator != SPACES and times and set(times) <= set(cells):  # words: a sentence
        known, plain = set(map(without_any_unit, dialect.names)), [without_any_unit(cell) for cell in cells]
        is_other = not known.issuperset(plain) and 2 * sum(cell in known for cell in plain) >= len(cells)
    return bare if is_other else ""


def has_other_names(cells: Sequence[str], names: Sequence[str]) -> bool:
    """Whether cells are the names of a header in another order, or with other units."""
    if sorted(cells) == sorted(names):
        return tuple(cells) != tuple(names)
    plain, known = [without_any_unit(cell) for cell in cells], [without_any_unit(name) for name in names]
    if plain != known:
        return sorted(plain) == sorted(known)
    stated = (
        (cell, name) for cell, name, bare in zip(cells, names, plain, strict=True) if cell != bare and name != bare
    )
    return any(cell != name for cell, name in stated)


def _has_other_units(cells: Sequence[str], units: Sequence[str]) -> bool:
    """Whether cells are units, and another one than is stated stands in some place."""
    if len(cells) != len(units) or not are_units(cells):
        return False
    pairs = ((one.strip(_BRACKETS), other.strip(_BRACKETS)) for one, other in zip(cells, units, strict=True))
    return any(one != other and _is_said(one) and _is_said(other) for one, other in pairs)


def _is_said(unit: str) -> bool:
    """Whether a text says something: not of a ruler, or of a cell that is left empty."""
    return any(char.isalnum() or char in "%°" for char in unit)
