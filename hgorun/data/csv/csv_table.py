"""Columns of a text file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property
from itertools import accumulate, chain, islice
from pathlib import Path

import numpy as np

from hgorun.ahead import ahead
from hgorun.config.data import Csv
from hgorun.data.cells import Cells, Numbers, bare
from hgorun.data.csv import grouped
from hgorun.data.csv.bulk import Bulk
from hgorun.data.csv.cut_off import without_cut
from hgorun.data.csv.dialect import Dialect, dialect_of
from hgorun.data.csv.header_below import header_below
from hgorun.data.csv.kept_lines import KeptLines
from hgorun.data.csv.missing import leave_out
from hgorun.data.csv.rows import Rows
from hgorun.data.csv.split_decimals import require_no_split_decimals, split_in_a_row
from hgorun.data.csv.splitting import cells_of
from hgorun.data.csv.text import Block, blocks
from hgorun.data.table import Columns, Table, Texts
from hgorun.errors import ConfigError

_SEARCHED = 1_000_000  # rows in which the first value of a column is looked for
_SHOWN = 300  # lines that show how a table is written
_NEAR = 100  # lines above and below one that are looked at
_SHOWN_BLOCKS = 8  # or that have them
_ABOVE = 50  # lines in which a header is looked for
_SMALL = 1 << 24  # bytes of a file of which nothing is read ahead
_AHEAD = 8  # blocks that are
_THREADS = 2
_AT_ONCE = 8  # blocks that these get together: each time, one waits for the other
_MANY = 10_000  # lines that are read one by one before plain ones are tried again


class CsvFile:
    """A text file whose columns are known and not yet read.

    Parameters
    ----------
    path : Path
    told : Csv
    clocks : mapping of str to collection of str
        The formats of the columns of time stamps, None for numbers.

    Raises
    ------
    ConfigError
    """

    def __init__(self, path: Path, told: Csv, clocks: Mapping[str, Collection[str | None]]) -> None:
        self._path, self._told = path, told
        self.dialect: Dialect = dialect_of(_beginning(blocks(path, told.encoding), told.skip), path, told, clocks)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the columns."""
        return self.dialect.names

    def sample(self, column: str) -> str:
        """The first value of a column that is not missing; empty where there is none among the first million rows."""
        place = self.dialect.names.index(column)
        rows = _all_cells(_from_line(blocks(self._path, self._told.encoding), self.dialect.first), self.dialect)
        first = chain(self.dialect.rows[:1], rows)
        found = (row[place] for _, row in islice(first, _SEARCHED) if place < len(row))
        return next((text for text in map(bare, found) if text.lower() not in self.dialect.missing), "")

    def unit(self, column: str) -> str:
        """What the row of units says of a column; empty without one."""
        units = self.dialect.units
        place = self.dialect.names.index(column)
        return _without_brackets(units[place]) if place < len(units) else ""

    def counts_from_a_date(self, column: str) -> bool:
        """Text has dates as dates."""
        return False

    def rows(self, column: str) -> int:
        """A line has all columns."""
        return -1

    def hint(self, column: str, names: Collection[str] = ()) -> str:
        """How many lines stand above the header, where a line below that which was taken for it has the column."""
        first = self._told.skip + 1
        text = next(blocks(self._path, self._told.encoding)).text.split(b"\n", _ABOVE)[:_ABOVE]
        lines = [line.decode("utf-8", "replace") for line in text]
        header = list(dict.fromkeys(self.dialect.names))
        again = ["" if all(name in line for name in header) else line for line in lines[first:]]
        place = header_below(again, column, names)
        if place is None:
            return ""
        return f" Line {first + place + 1} has it: if that is the header, csv: {{skip: {first + place}}}."

    def texts(self, *lines: int) -> Texts:
        """The first rows, or those near some lines."""
        return _by_column(self.dialect, chain.from_iterable(map(self._near, lines))) if lines else self._first_texts

    @cached_property
    def _first_texts(self) -> Texts:
        return _by_column(self.dialect, self.dialect.rows)

    def _near(self, line: int) -> Iterator[tuple[int, Sequence[str]]]:
        begin = max(line - _NEAR, self.dialect.first)
        rest = _from_line(blocks(self._path, self._told.encoding), begin)
        return islice(_all_cells(rest, self.dialect), 2 * _NEAR)

    def table(self, wanted: Sequence[Cells], budget: float) -> Table:
        """Columns of it.

        Raises
        ------
        ConfigError
            For the first thing wrong in a row, and when the values take more memory than allowed.
        """
        dialect, size = self.dialect, self._path.stat().st_size
        rest = _from_line(blocks(self._path, self._told.encoding), dialect.first)
        block = next(rest, None)
        if block is None:
            raise ConfigError("no rows", file=str(self._path))
        if self._told.decimal is None and self._told.thousands is None:
            require_no_split_decimals(dialect, {cells.column for cells in wanted}, self._path)
        columns = Columns(wanted, _expected_rows(block, size), budget, self._path)
        rows = Rows(self._path, dialect, wanted)
        reading = _Reading(rows, dialect, Bulk(dialect, wanted), columns)
        if size <= _SMALL:
            reading.read(chain([block], rest))
        else:
            with ahead(rest, _AHEAD) as following:
                reading.read(chain([block], following))
        table = columns.table()
        for cells, values in table.columns.items():
            if isinstance(cells, Numbers):
                leave_out(dialect.missing_numbers, values)
        cut = [*without_cut(table, dialect, self.texts), *split_in_a_row(table, dialect, self.texts)]
        points = {cells: (line, said) for cells, line, said in self._points(table)}
        doubts = {cells: said for cells, (_, said) in points.items()}
        return replace(table, remarks=[*rows.remarks(), *cut, *points.values()], doubts=doubts)

    def _points(self, table: Table) -> Iterator[tuple[Cells, int, str]]:
        """What is told of points that may stand between thousands."""
        told = self._told
        untold = told.decimal is None and told.thousands is None and self.dialect.decimal == "."
        for cells, values in table.columns.items():
            if not isinstance(cells, Numbers) or not untold:
                continue
            sample = self.dialect.grouped.get(cells.column)
            if sample is not None and grouped.still_may_be(values):
                yield cells, 0, grouped.told(cells.column, sample)
            elif sample is None and (found := grouped.first_doubt(values, self._texts(table, cells.column))):
                place, sample, beside = found
                yield cells, int(table.lines[place]), grouped.told(cells.column, sample, beside)

    def _texts(self, table: Table, column: str) -> Callable[[int], str]:
        """Reads a cell of a column once more, as text; empty where its row has several lines."""

        def text_of(row: int) -> str:
            block = next(_from_line(blocks(self._path, self._told.encoding), int(table.lines[row])))
            cells = cells_of(block.text.partition(b"\n")[0].decode(), self.dialect.separator)
            return dict(zip(self.dialect.names, cells, strict=False)).get(column, "").strip()

        return text_of


class _Reading:
    """Takes plain rows in bulk, and the others one by one."""

    def __init__(self, rows: Rows, dialect: Dialect, bulk: Bulk, columns: Columns) -> None:
        self._rows, self._dialect, self._bulk, self._columns = rows, dialect, bulk, columns
        self._lines = 1  # that are read one by one when a row is not plain: more and more, as long as none is

    def read(self, parts: Iterator[Block]) -> None:
        """All rows, of several blocks at once where these are plain."""
        if not self._bulk.suits:
            return self._one_by_one(parts)
        with ThreadPoolExecutor(_THREADS) as pool:
            count = _AT_ONCE
            while some := list(islice(parts, count)):
                taken = self._taken(some, pool) if len(some) > 1 else 0
                count = min(2 * count, _AT_ONCE) if taken == len(some) or len(some) == 1 else 1
                left = chain(some[taken:], parts)
                for block in islice(left, len(some) - taken):
                    if quoted := self._quoted_from(block):
                        # quotes may hold ends of lines: from here on only who reads quotes knows where a row ends
                        return self._one_by_one(chain([quoted], left))
        return None

    def _taken(self, some: Sequence[Block], pool: Executor) -> int:
        """How many of some blocks have been taken, up to the first that has a row that is not plain."""
        ends = list(accumulate(block.lines for block in some))
        room = self._columns.room(ends[-1], some[0].line)
        own = [[column[end - block.lines : end] for column in room] for block, end in zip(some, ends, strict=True)]
        scanned = list(pool.map(self._bulk.scanned, some, [0] * len(some), own))
        for number, (block, columns, found) in enumerate(zip(some, own, scanned, strict=True)):
            if found[0] < block.lines or self._bulk.dated(block, columns, *found)[0] < block.lines:
                return number
            self._columns.fill(np.arange(block.line, block.line + block.lines, dtype=np.int32))
            self._lines = 1
        return len(some)

    def _quoted_from(self, block: Block) -> Block | None:
        """Take the rows of a block; the rest of it from a row on that is not plain and has a quote near."""
        lines = KeptLines(block, self._dialect)
        for number, comment in lines.comments:
            self._rows.judge_comment(number, comment)
        row, count = 0, lines.numbers.size
        while row < count:
            room = self._columns.room(count - row, int(lines.numbers[row]))
            taken, _ = self._bulk.rows(lines.block, lines.place(row), room)
            self._columns.fill(lines.numbers[row : row + taken])
            row, self._lines = row + taken, 1 if taken > self._lines else min(4 * self._lines, _MANY)
            if row == count:
                break
            stop = min(row + self._lines, count)
            some = lines.original(row, stop)
            if b'"' in some.text:
                return lines.original(row, count)
            self._one_by_one(iter([some]))
            row = stop
        return None

    def _one_by_one(self, parts: Iterator[Block]) -> None:
        for lines, values in self._rows.arrays(parts):
            self._columns.add(lines, values)


def _all_cells(parts: Iterator[Block], dialect: Dialect) -> Iterator[tuple[int, Sequence[str]]]:
    """The line and the cells of every row, as far as quotes do not hold ends of lines."""
    for block in parts:
        for number, raw in enumerate(block.text.split(b"\n"), block.line):
            line = raw.decode("utf-8", "replace")
            if line.strip() and not dialect.is_comment(line):
                yield number, cells_of(line, dialect.separator)


def _by_column(dialect: Dialect, rows: Iterable[tuple[int, Sequence[str]]]) -> Texts:
    columns: list[dict[int, str]] = [{} for _ in dialect.names]
    for line, cells in rows:
        for column, cell in zip(columns, cells, strict=False):
            column[line] = cell.strip()
    return dict(zip(dialect.names, columns, strict=True))


def _without_brackets(unit: str) -> str:
    """A unit without brackets around all of it: of mbar(a) they are a part."""
    unit = unit.strip(" -")
    return unit[1:-1].strip(" -") if unit[:1] + unit[-1:] in ("[]", "()", "{}", "<>") else unit


def _beginning(parts: Iterator[Block], skip: int) -> Block:
    """Enough lines to tell how a table is written: the first block, and more where lines are long."""
    first = next(parts)
    text, lines = [first.text], first.lines
    while lines <= skip + _SHOWN and len(text) < _SHOWN_BLOCKS and (block := next(parts, None)):
        text.append(block.text)
        lines += block.lines
    return first if len(text) == 1 else Block(b"".join(text), first.line)


def _from_line(parts: Iterator[Block], first: int) -> Iterator[Block]:
    """Blocks without the lines above the first row."""
    for block in parts:
        if block.line + block.lines <= first:
            continue
        if block.line >= first:
            yield block
            continue
        place = 0
        for _ in range(first - block.line):
            place = block.text.index(b"\n", place) + 1
        yield Block(block.text[place:], first)


def _expected_rows(block: Block, size: int) -> int:
    """How many rows a file has whose rows are as long as those of a block, and a few more."""
    return int(size / len(block.text) * block.lines * 1.02) + 100
