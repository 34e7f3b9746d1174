"""Rows of a text file, one by one: what is wrong in one of them is told with its line."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import chain, islice
from pathlib import Path

import numpy as np

from hgorun.config.types import describe
from hgorun.data.cells import IF_MISSING, Cells, Flags, Numbers, is_word
from hgorun.data.csv.dialect import Dialect
from hgorun.data.csv.other_headers import OtherHeaders, has_other_names
from hgorun.data.csv.row_lines import RowLines
from hgorun.data.csv.splitting import SPACES, cells_of
from hgorun.data.csv.text import Block
from hgorun.data.csv.units_row import is_value
from hgorun.data.times.date_hints import may_be_date
from hgorun.errors import ConfigError

_AT_ONCE = 20_000  # rows that are held as text
_DECIMAL = re.compile(r"[-+]?[0-9]*([.,])(?![0-9]{3}$)[0-9]+")
_ANOTHER_LOG = "the rows below have other columns or units, and belong into a file of their own"
_OF_WINCC = "$RT_"  # so the names of its own events begin
_MARK = "\ufeff"  # of the order of bytes
_BELOW = 1000  # rows in which dates of a column that is refused are looked at


class Rows:
    """Reads rows with Python's own reader of CSV.

    Parameters
    ----------
    path : Path
    dialect : Dialect
    wanted : sequence of Cells
    """

    def __init__(self, path: Path, dialect: Dialect, wanted: Sequence[Cells]) -> None:
        self._path, self._dialect, self._wanted = path, dialect, wanted
        self._readers = [cells.reader(dialect.decimal, dialect.missing, dialect.thousands) for cells in wanted]
        self._places = [dialect.names.index(cells.column) for cells in wanted]
        self._inside: list[tuple[int, int, int]] = []
        self._tags: list[tuple[int, str]] = []
        times = {cells.column for cells in wanted if not isinstance(cells, Flags) and cells.key}
        self._headers = OtherHeaders(dialect, times)

    def remarks(self) -> Iterator[tuple[int, str]]:
        """What is told of cells that hold lines which look like rows, and of rows that begin as comments do: the line
        of the first one, and a sentence."""
        for begin, end, count in self._inside[:1]:
            many = f", and {len(self._inside) - 1:,} more cells hold such" if len(self._inside) > 1 else ""
            rows = "1 line that looks like a row" if count == 1 else f"{count:,} lines that look like rows"
            yield begin, f"a quote that opens here closes on line {end}: {rows} in it{many}; one too many loses rows"
        for line, tag in self._tags[:1]:
            more = f", and so are {len(self._tags) - 1:,} more such" if len(self._tags) > 1 else ""
            sign = self._dialect.comment
            yield line, f"{tag!r} begins this row, which is read{more}; a comment has a space behind its {sign}"

    def judge_comment(self, line: int, text: str) -> None:
        """Refuse a comment that is the header of other columns, or of other units.

        Raises
        ------
        ConfigError
        """
        if found := self._headers.found(text):
            said = f"this comment is another header, {describe(found)}: {_ANOTHER_LOG}; if it is none, take it out"
            raise self._error(line, said)

    def arrays(self, blocks: Iterator[Block]) -> Iterator[tuple[np.ndarray, list[np.ndarray]]]:
        """Lines and columns of all rows, some thousands at a time.

        Raises
        ------
        ConfigError
            For the first row with more or fewer cells than the header, with a cell that cannot be read, or with
            quotes that do not close.
        """
        rows = self._values(blocks)
        while some := list(islice(rows, _AT_ONCE)):
            lines, *columns = zip(*some, strict=True)
            yield (
                np.array(lines, dtype=np.int32),
                [np.array(c, dtype=cells.dtype) for c, cells in zip(columns, self._wanted, strict=True)],
            )

    def _values(self, blocks: Iterator[Block]) -> Iterator[tuple[float | int, ...]]:
        width, names = self._dialect.width, len(self._dialect.names)
        plan = list(zip(self._places, self._readers, strict=True))
        rows = self._cells(blocks)
        for line, cells in rows:
            if len(cells) != width or (width > names and cells[-1].strip()):
                self._refuse_header(line, cells)
                what = self._commas(cells) or (self._no_sample(cells[0]) if len(cells) < names else "")
                what += self._name_of_row(cells) if line == self._dialect.first else ""
                what += self._without_last(cells)
                raise self._error(line, f"{_cells(len(cells))}, where the header has {names}{what}")
            if cells[0].startswith(_OF_WINCC):
                self._refuse_event(line, cells[0].strip())
            try:
                yield (line, *(read(cells[place]) for place, read in plan))
            except ValueError:
                raise self._first_wrong(line, cells, rows) from None

    def _commas(self, cells: Sequence[str]) -> str:
        """What may be the reason for too many cells, where commas separate them."""
        digits = sum(cell.strip().isdigit() for cell in cells)
        points = any("." in cell and is_value(cell) for cell in cells)
        if self._dialect.separator != "," or len(cells) <= len(self._dialect.names) or digits < 2 or points:
            return ""
        return "; decimal commas in a file separated by commas: separate by ; or put such numbers in quotes"

    def _name_of_row(self, cells: Sequence[str]) -> str:
        """What may be the reason for one cell more than the header has, from the first row on."""
        if len(cells) != len(self._dialect.names) + 1:
            return ""
        return (
            "; where each row begins with its name or number, as write.table of R writes it, the header needs a name "
            "for that column, too (col.names = NA)"
        )

    def _without_last(self, cells: Sequence[str]) -> str:
        """What to do where rows have no cell of the last column, as those of LabVIEW have none of their comments."""
        names, sign = self._dialect.names, self._dialect.separator
        if len(cells) != len(names) - 1 or is_word(cells[0].strip()) or len(names) - 1 in self._places:
            return ""
        fewer = [len(row) == len(cells) for _, row in self._dialect.rows]
        if all(fewer):
            return f"; where no row has a cell of the last column, take its name, {names[-1]!r}, out of the header"
        if 2 * sum(fewer) < len(fewer):  # what is missing here may be any cell
            return ""
        return f"; a row without a value of the last column, {names[-1]!r}, ends with {describe(sign)}"

    def _refuse_header(self, line: int, cells: Sequence[str]) -> None:
        """Refuse a row that is the header once more.

        Raises
        ------
        ConfigError
        """
        names = self._dialect.names
        found = [cell.strip().removeprefix(_MARK).strip('"') for cell in cells[: len(names)]]  # of a file joined to it
        if tuple(found) == names:
            message = (
                "this line repeats the header: cut it out, with what belongs to it, where the log goes on below; where "
                "another one begins, cut the file in two"
            )
            raise self._error(line, message)
        if len(found) == len(names) and has_other_names(found, names):
            raise self._error(line, f"this line is another header: {_ANOTHER_LOG}")

    def _refuse_event(self, line: int, cell: str) -> None:
        """Refuse a row that WinCC writes when it stops, unless the quality leaves it out.

        Raises
        ------
        ConfigError
        """
        column = self._dialect.names[0]
        if not any(isinstance(cells, Flags) and cells.column == column for cells in self._wanted):
            other = next((row[0] for _, row in self._dialect.rows if not row[0].startswith(_OF_WINCC)), "NAME")
            quality = f"quality: {{column: {json.dumps(column)}, good: [{json.dumps(other)}]}}"
            message = f"{cell!r} is no sample, and WinCC writes such a row when it stops: take it out, or {quality}"
            raise self._error(line, message)

    def _no_sample(self, cell: str) -> str:
        """What to do with a line that begins with a word, as one of totals below a table does."""
        if not is_word(cell.strip()):
            return ""
        return f"; a line that is no sample, such as a total, is removed, or begins with {self._dialect.comment}"

    def _first_wrong(self, line: int, row: Sequence[str], rest: Iterator[tuple[int, list[str]]]) -> ConfigError:
        """What is wrong in a row, with the name of its column; other rows show which patterns read their dates."""
        self._refuse_header(line, row)
        columns = [
            (cells.others if isinstance(cells, Numbers) and not cells.key else cells.beside, place)
            for cells, place in zip(self._wanted, self._places, strict=True)
            if not isinstance(cells, Flags)
        ]
        known = [(number, cells) for number, cells in self._dialect.rows if number != line]
        last = known[-1][0] if known else 0
        first = sorted([*known, (line, row)], key=lambda one: one[0])
        below = (one for one in islice(rest, _BELOW) if one[0] > last)  # of rows that are read one by one
        with suppress(ConfigError):  # of one below
            for _, other in chain(first, below):
                for beside, place in columns:
                    if place < len(other) and '"' not in other[place]:
                        beside.append(other[place].strip())
        for cells, place, read in zip(self._wanted, self._places, self._readers, strict=True):
            try:
                read(row[place])
            except ValueError as error:
                when = not isinstance(cells, Flags) and cells.key == "time"
                dated = when and may_be_date(row[place].strip())
                said, hint = str(error), self._no_sample(row[place]) if when and not dated else ""
                if isinstance(cells, Numbers) and not dated and (own := self._own_sign(cells, place)):
                    text = row[place].strip()
                    said = f"expected a number, found {describe(text)}; {own}" if _DECIMAL.fullmatch(text) else said
                if line == self._dialect.first and self._dialect.doubtful:
                    said, hint = said.partition(IF_MISSING)[0], self._of_header()
                return self._error(line, f"{said}{hint}", cells.column)
        raise AssertionError("a row was refused and read")

    def _own_sign(self, cells: Numbers, place: int) -> str:
        """What to do where a column has another decimal sign than others that are read; empty where it has not."""
        sign, own = self._dialect.decimal, self._signs(place)
        others = [
            one
            for one, there in zip(self._wanted, self._places, strict=True)
            if isinstance(one, Numbers) and there != place and self._signs(there) == {sign}
        ]
        if self._dialect.thousands is not None or len(own) != 1 or sign in own or not others:
            return ""
        here, there = ("points", "commas") if sign == "," else ("commas", "points")
        beside = next((one for one in others if one.key), others[0])
        right = f'csv with decimal: "{next(iter(own))}" below its signal reads it'
        if cells.key or beside.key:
            right = "write one sign into all of the file"
        return f"this column has decimal {here}, and {beside.column!r} has {there}: {right}"

    def _signs(self, place: int) -> set[str]:
        """The decimal signs of the first numbers of a column, but for those that may stand between thousands."""
        found = (_DECIMAL.fullmatch(row[place].strip()) for _, row in self._dialect.rows if place < len(row))
        return {match[1] for match in found if match}

    def _of_header(self) -> str:
        """What to do about the first row where it looks like a line of the header."""
        count, sign = self._dialect.doubtful, self._dialect.comment
        if count == 1 and not self._dialect.units:
            return "; if this line belongs to the header, as one of units does: csv: {units_row: true}"
        if count == 1:
            return f"; if this line belongs to the header: begin it with {sign}, as a comment"
        return f"; if this line and the next belong to the header: begin them with {sign}, as comments"

    def _cells(self, blocks: Iterator[Block]) -> Iterator[tuple[int, list[str]]]:
        """The cells of every row, and the line it begins on."""
        lines = RowLines(blocks, self._dialect, self._tags, self.judge_comment)
        if self._dialect.separator == SPACES:
            for text in lines:
                yield lines.taken(), cells_of(text, SPACES)
            return
        reader = csv.reader(lines, delimiter=self._dialect.separator, strict=True, skipinitialspace=True)
        try:
            for row in reader:
                if lines.inside:
                    self._inside.append((lines.begin, lines.end, lines.inside))
                yield lines.taken(), row
        except csv.Error as error:
            raise self._error(lines.begin, _not_csv(str(error), lines)) from None

    def _error(self, line: int, message: str, column: str | None = None) -> ConfigError:
        return ConfigError(message, file=str(self._path), line=line, key=column)


def _not_csv(error: str, lines: RowLines) -> str:
    """What is wrong with the row at which the reader of CSV has stopped."""
    too_long = "field limit" in error
    if too_long and lines.end == lines.begin and lines.text.count('"') % 2 == 0:
        wide = f"a cell of more than {csv.field_size_limit():,} characters: this is no table of numbers separated by "
        return wide + describe(lines.separator)
    # what the reader takes in is a quote that is not closed, if it comes to no end of the row
    return "a quote that is not closed" if too_long or "unexpected end" in error else f"not CSV: {error}"


def _cells(count: int) -> str:
    return "1 cell" if count == 1 else f"{count} cells"
