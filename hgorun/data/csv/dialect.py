"""How a text file writes its table: separator, decimal sign, names of columns, where the numbers begin."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path

from hgorun.config.data import Csv
from hgorun.data.csv.comments import is_comment
from hgorun.data.csv.decimal_sign import decimal_sign
from hgorun.data.csv.grouped import may_be_grouped
from hgorun.data.csv.header import Line, header_of, require_no_row_inside
from hgorun.data.csv.marked_rows import is_marked_row, words_in
from hgorun.data.csv.missing import missing_numbers, missing_texts
from hgorun.data.csv.splitting import SPACES, cells_of
from hgorun.data.csv.text import Block
from hgorun.data.csv.units_row import may_state_units
from hgorun.data.csv.whole_header import whole_header
from hgorun.errors import ConfigError

_SEPARATORS = ("\t", ";", "|", ",")
_LOOKED_AT = 200  # rows that decide how numbers are written

_STATED = re.compile(r'"?sep=(.)"?\r?', re.IGNORECASE)  # a first line by which Excel knows the separator
_QUOTED = re.compile(r'"[^"]*"')

_OTHER = {".": ",", ",": "."}  # what a sign between thousands leaves for decimals


@dataclass(frozen=True)
class Dialect:
    """How a table is written.

    Attributes
    ----------
    separator : str
        A character, or ``SPACES``.
    decimal : str
    comment : str
    names : tuple of str
        Of the columns, as the header has them.
    width : int
        Cells of a row: one more than names where every row ends with a separator.
    first : int
        The line on which the numbers begin.
    missing : frozenset of str
        Texts for a missing value, in small letters.
    missing_numbers : tuple of float
        Numbers for a missing value.
    thousands : str or None
        What stands between thousands; None where nothing does.
    units : tuple of str
        The row of units; empty without one.
    rows : sequence of (int, sequence of str)
        The first rows of values, with their lines.
    doubtful : int
        How many rows, from that one on, have neither numbers nor dates, as lines of a header have; 0 where it is told
        that no row of units follows the header.
    grouped : mapping of str to str
        Columns whose points may stand between thousands, and a cell of each.
    words : frozenset of str
        The first cells of the first rows where these are words, and no times; a tag may be among such.
    """

    separator: str
    decimal: str
    comment: str
    names: tuple[str, ...]
    width: int
    first: int
    missing: frozenset[str]
    units: tuple[str, ...]
    rows: Sequence[tuple[int, Sequence[str]]]
    missing_numbers: tuple[float, ...] = ()
    thousands: str | None = None
    doubtful: int = 0
    grouped: Mapping[str, str] = field(default_factory=dict)
    words: frozenset[str] = frozenset()

    def is_comment(self, line: str) -> bool:
        """Whether a line below the first row is a comment."""
        return is_comment(line, self.comment, self.missing, self.separator) and not is_marked_row(
            line, self.comment, self.separator, len(self.names), self.words
        )


def dialect_of(block: Block, path: Path, told: Csv, clocks: Mapping[str, Collection[str | None]]) -> Dialect:
    """How the file is written that begins with a block.

    Parameters
    ----------
    block : Block
    path : Path
    told : Csv
    clocks : mapping of str to collection of str
        The formats of the columns of time stamps, see :func:`hgorun.data.csv.units_row.states_units`.

    Raises
    ------
    ConfigError
        When there is no header or no row below it, or when it cannot be told what a comma in a number means.
    """
    comments: list[Line] = []
    stated = told.separator or _stated(block, told)
    lines = list(_lines(block, told, comments))
    if not lines:
        raise ConfigError("no lines but comments: nothing was measured", file=str(path), line=1)
    count, whole = whole_header([one.text for one in lines], (stated,) if stated else (*_SEPARATORS, SPACES))
    inside = lines[1:count]
    lines[:count] = [Line(lines[0].number, whole)]
    separator = stated or _separator(lines)
    rows = [(line, cells_of(line.text, separator)) for line in lines]
    require_no_row_inside(inside, rows[0], separator, path)
    if told.separator and len(rows[0][1]) == 1:
        _require_separator(rows[0][0], told.separator, _separator(lines), path)
    names, units, body = header_of(rows, comments, separator, told, path, clocks)
    words = words_in(row[0] for _, row in body if row) if names[0].strip() not in clocks else frozenset()
    marked = [
        (one, cells_of(one.text, separator))
        for one in comments
        if one.number > lines[0].number and is_marked_row(one.text, told.comment, separator, len(names), words)
    ]
    body = sorted([*body, *marked], key=lambda row: row[0].number)
    missing = missing_texts(told)

    def of_header(row: tuple[Line, list[str]]) -> bool:
        return may_state_units(row[1], names, missing, clocks)

    first, sample = body[0]
    ends = len(sample) == len(names) + 1 and not sample[-1].strip()
    shown = [  # cells beyond those of the header are refused where rows are read
        (line.number, ["" if text.strip().lower() in missing else text for text in row[: len(names) + 1]])
        for line, row in body
    ]
    decimal = told.decimal or _OTHER.get(told.thousands or "") or decimal_sign(shown, path)
    untold = told.decimal is None and told.thousands is None and decimal == "."
    grouped = may_be_grouped([row for _, row in shown], separator) if untold else ()
    return Dialect(
        separator=separator,
        decimal=decimal,
        comment=told.comment,
        names=tuple(name.strip() for name in names),
        width=len(names) + ends,
        first=first.number,
        missing=missing,
        units=tuple(text.strip() for text in units),
        rows=[(line.number, row) for line, row in body],
        missing_numbers=missing_numbers(told, decimal),
        thousands=told.thousands,
        doubtful=0 if told.units_row is False else sum(1 for _ in takewhile(of_header, body)),
        words=words,
        grouped={name: _pointed(shown, k) for k, name in enumerate(map(str.strip, names)) if k in grouped},
    )


def _pointed(rows: Sequence[tuple[int, Sequence[str]]], place: int) -> str:
    """The first cell of a column with a point."""
    return next(row[place].strip() for _, row in rows if place < len(row) and "." in row[place])


def _stated(block: Block, told: Csv) -> str | None:
    """The separator that the first line of a file states, where it is not skipped: such a line is no header."""
    first = block.text.partition(b"\n")[0].decode("utf-8", "replace")
    found = None if told.skip else _STATED.fullmatch(first)
    return found[1] if found else None


def _lines(block: Block, told: Csv, comments: list[Line]) -> Iterator[Line]:
    """The first lines of a file that are neither empty nor comments."""
    found, missing = 0, missing_texts(told)
    for number, raw in enumerate(block.text.split(b"\n", told.skip + 50 * _LOOKED_AT), start=block.line):
        text = raw.decode("utf-8", "replace")
        if number - block.line < told.skip or not text.strip() or (number == block.line and _stated(block, told)):
            continue
        if is_comment(text, told.comment, missing, told.separator):
            comments.append(Line(number, text))
            continue
        yield Line(number, text)
        found += 1
        if found > _LOOKED_AT:
            return


def _separator(lines: Sequence[Line]) -> str:
    """The one that divides the header and the line below it in the same way."""
    header, below = lines[0].text, lines[min(len(lines) - 1, 2)].text
    for separator in _SEPARATORS:
        width = len(cells_of(header, separator))
        if width > 1 and len(cells_of(below, separator)) in (width, width + 1):
            return separator
    bare = _QUOTED.sub("", header)
    found = [separator for separator in _SEPARATORS if separator in bare]
    if found:
        return max(found, key=bare.count)
    width = len(cells_of(header, SPACES))
    return SPACES if width > 1 and len(cells_of(below, SPACES)) in (width, width + 1) else ","


def _require_separator(header: Line, told: str, found: str, path: Path) -> None:
    """Refuse a separator that the names of columns do not have, where they have another one.

    Raises
    ------
    ConfigError
    """
    count = len(cells_of(header.text, found))
    if found != told and count > 1:
        message = f"csv.separator is {told!r}, which is not between the names of columns: {found!r} makes {count}"
        raise ConfigError(message, file=str(path), line=header.number)
