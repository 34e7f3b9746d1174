"""Columns of a text file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

from hgorun.config.data import Csv
from hgorun.data.cells import Cells
from hgorun.data.dialect import Dialect, dialect_of
from hgorun.data.rows import Rows
from hgorun.data.table import Columns, Table
from hgorun.data.text import Block, blocks
from hgorun.errors import ConfigError


class CsvFile:
    """A text file whose columns are known and not yet read.

    Parameters
    ----------
    path : Path
    told : Csv

    Raises
    ------
    ConfigError
    """

    def __init__(self, path: Path, told: Csv) -> None:
        self._path, self._told = path, told
        self.dialect: Dialect = dialect_of(next(blocks(path, told.encoding)), path, told)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the columns."""
        return self.dialect.names

    def sample(self, column: str) -> str:
        """The first value of a column."""
        place = self.dialect.names.index(column)
        return self.dialect.sample[place] if place < len(self.dialect.sample) else ""

    def unit(self, column: str) -> str:
        """What the row of units says of a column; empty without one."""
        units = self.dialect.units
        place = self.dialect.names.index(column)
        return units[place].strip("[]() ") if place < len(units) else ""

    def table(self, wanted: Sequence[Cells], budget: float) -> Table:
        """Columns of it.

        Raises
        ------
        ConfigError
            For the first thing wrong in a row, and when the values take more memory than allowed.
        """
        dialect, size = self.dialect, self._path.stat().st_size
        rows = Rows(self._path, dialect, wanted)
        columns = None
        rest = _from_line(blocks(self._path, self._told.encoding), dialect.first)
        for block in rest:
            if columns is None:
                columns = Columns(wanted, _expected_rows(block, size), budget, self._path)
            # quotes may hold ends of lines: from here on only who reads quotes knows where a row ends
            onwards = chain([block], rest) if b'"' in block.text else iter([block])
            for lines, parts in rows.arrays(onwards):
                columns.add(lines, parts)
        if columns is None:
            raise ConfigError("no rows", file=str(self._path))
        return columns.table()


def _from_line(parts: Iterator[Block], first: int) -> Iterator[Block]:
    """Blocks without the lines above the first row."""
    for block in parts:
        if block.line + block.lines <= first:
            continue
        place = 0
        for _ in range(first - block.line):
            place = block.text.index(b"\n", place) + 1
        yield Block(block.text[place:], max(first, block.line))


def _expected_rows(block: Block, size: int) -> int:
    """How many rows a file has whose rows are as long as those of a block, and a few more."""
    return int(size / len(block.text) * block.lines * 1.02) + 100
