"""Lines below a header that are headers of other columns or units: those of a logger that was restarted.

Rows below such a line that are read by the first header get into columns in which they were not measured.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

from hgorun.data.csv.dialect import Dialect
from hgorun.data.csv.splitting import SPACES, cells_of
from hgorun.data.csv.units_row import are_units, is_value
from hgorun.data.units.named_units import without_any_unit
from hgorun.patterns import Pattern

_BRACKETS = "[](){}<> "
_LONGEST = 30  # characters of a unit
_KNOWN = 2  # names of a header beside a new one: with that of the times alone, a note may begin
_IN_BRACKETS = Pattern(r"[(\[{<].*?[)\]}>]")


class OtherHeaders:
    """Finds such lines among comments, of which there may be as many as rows.

    Parameters
    ----------
    dialect : Dialect
    times : collection of str
        Columns of time stamps: a comment that has one of them and half of all names is a header.
    """

    def __init__(self, dialect: Dialect, times: Collection[str]) -> None:
        self._dialect, self._times = dialect, set(times)
        self._plain = tuple(map(without_any_unit, dialect.names))
        ends = r"\s" if dialect.separator == SPACES else re.escape(dialect.separator)
        names = "|".join(map(re.escape, self._plain))
        self._has_a_name = Pattern(rf'(?:^\s*{re.escape(dialect.comment)}|{ends})\s*"?(?:{names})')

    def found(self, comment: str) -> str:
        """What a comment says of columns or of their units, if the header says another thing; else empty."""
        names, separator = self._dialect.names, self._dialect.separator
        if not self._dialect.units and not self._has_a_name.search(comment):  # most comments
            return ""
        if separator != SPACES and comment.count(separator) < len(names) - 1:
            return ""
        bare = comment.lstrip().removeprefix(self._dialect.comment).strip()
        cells = [cell.strip() for cell in cells_of(bare, separator)]
        if len(cells) == len(names) + 1 and not cells[-1]:
            cells.pop()
        if len(cells) != len(names) or tuple(cells) == names:
            return ""
        is_other = all(map(self._is_a_name, cells)) and has_other_names(cells, names)
        is_other = is_other or (self._times.issubset(cells) and self._has_a_new_name(cells))
        is_other = is_other or has_other_units(cells, self._dialect.units)
        return bare if is_other else ""

    def _is_a_name(self, cell: str) -> bool:
        """Whether a cell is that of a column, with a unit or without, and no words about it."""
        bare = _IN_BRACKETS.sub("", cell).strip()
        return cell.startswith(self._plain) and len(bare.split()) <= max(len(name.split()) for name in self._plain)

    def _has_a_new_name(self, cells: Sequence[str]) -> bool:
        """Whether a header has a column that is new, as far as cells with two that are known are one."""
        if self._dialect.separator == SPACES or not self._times or any(map(is_value, cells)):
            return False  # words may be a sentence
        plain = [without_any_unit(cell) for cell in cells]
        places = [self._plain.index(cell) for cell in plain if cell in self._plain]
        new = [cell for cell in plain if cell not in self._plain]
        if not new or len(places) < max(_KNOWN, len(new)) or places != sorted(places):
            return False
        return all(len(cell.split()) == 1 for cell in new)


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


def has_other_units(cells: Sequence[str], units: Sequence[str]) -> bool:
    """Whether cells are units, and another one than is stated stands in some place."""
    if len(cells) != len(units) or any(len(cell) > _LONGEST or cell[:1].isdigit() for cell in cells):
        return False
    if not are_units(cells):
        return False
    pairs = ((one.strip(_BRACKETS), other.strip(_BRACKETS)) for one, other in zip(cells, units, strict=True))
    said = [one == other for one, other in pairs if _is_said(one) and _is_said(other)]
    return any(said) and not all(said)  # none that is the same: a note that looks like units


def _is_said(unit: str) -> bool:
    """Whether a text says something: not of a ruler, or of a cell that is left empty."""
    return any(char.isalnum() or char in "%°" for char in unit)
