"""Columns of a file with the line of every row, whatever kind of file it is."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, TypeAlias

import numpy as np

from hgorun.data.cells import Cells
from hgorun.errors import ConfigError

Texts: TypeAlias = Mapping[str, Mapping[int, str]]
"""The cells of some rows, by the name of their column and by their line."""


@dataclass(frozen=True, eq=False, repr=False)
class Table:
    """Columns of a file.

    Attributes
    ----------
    path : Path
    lines : ndarray of integers, shape (n,)
        The line of every row.
    columns : mapping of Cells to ndarray, shape (n,)
        Numbers as floats, dates as nanoseconds since 1970, whether a flag is good as 1 or 0.
    remarks : sequence of (int, str)
        What is to be told of the file: a line, 0 where it is about none, and a sentence.
    doubts : mapping of Cells to str
        Those of the remarks that say that the numbers of a column may be others than were read.
    apart : mapping of Cells to float
        Of stamps that have single precision in the file, how far apart the largest of them are at the least: as the
        columns have them; 0 where all are whole numbers that it holds.
    """

    path: Path
    lines: np.ndarray
    columns: Mapping[Cells, np.ndarray]
    remarks: Sequence[tuple[int, str]] = ()
    doubts: Mapping[Cells, str] = field(default_factory=dict)
    apart: Mapping[Cells, float] = field(default_factory=dict)


class TableFile(Protocol):
    """A file whose columns are known and not yet read."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the columns."""

    def sample(self, column: str) -> str:
        """The first value of a column, as text."""

    def unit(self, column: str) -> str:
        """The unit that the file states; empty where it does not."""

    def counts_from_a_date(self, column: str) -> bool:
        """Whether its numbers count from a date that the file states."""

    def rows(self, column: str) -> int:
        """How many rows a column has where those of a file may differ in it; -1 where all have one length."""

    def hint(self, column: str, names: Collection[str] = ()) -> str:
        """Why a column may not be among the names, as a sentence; empty where nothing is known.

        Parameters
        ----------
        column : str
        names : collection of str
            All columns that are read.
        """

    def texts(self, *lines: int) -> Texts:
        """The first rows, or those near some lines, as texts; none of files that have none, or of many columns."""

    def table(self, wanted: Sequence[Cells], budget: float) -> Table:
        """Columns of it, within some bytes of memory."""


def too_large(path: Path, budget: float, line: int | None = None) -> ConfigError:
    """That the values of a file take more than some bytes, as a line shows."""
    message = f"the values take more than {budget / 2**30:.3g} GiB, the limit of data.max_memory"
    return ConfigError(message, file=str(path), line=line)


class Columns:
    """Arrays that grow as a file is read.

    Parameters
    ----------
    wanted : sequence of Cells
    rows : int
        How many there may be: memory is reserved for so many, and taken as it is filled.
    budget : float
        Bytes that they may take.
    path : Path
        For the message when they take more.
    """

    def __init__(self, wanted: Sequence[Cells], rows: int, budget: float, path: Path) -> None:
        self._wanted, self._budget, self._path = wanted, budget, path
        self._row = 4 + sum(cells.dtype.itemsize for cells in wanted)
        self._filled = 0
        rows = int(min(rows, budget / self._row))
        self._lines = np.empty(rows, dtype=np.int32)
        self._values = [np.empty(rows, dtype=cells.dtype) for cells in wanted]

    def room(self, rows: int, line: int) -> list[np.ndarray]:
        """Places for the next rows, a part of every column, to be written to.

        Raises
        ------
        ConfigError
            At a line, when they take more memory than allowed.
        """
        end = self._filled + rows
        if end * self._row > self._budget:
            raise too_large(self._path, self._budget, line)
        if end > self._lines.size:
            self._resize(max(end, self._lines.size * 5 // 4))
        return [column[self._filled : end] for column in self._values]

    def fill(self, lines: np.ndarray) -> None:
        """The next rows, which have been written, stand on these lines."""
        end = self._filled + len(lines)
        self._lines[self._filled : end] = lines
        self._filled = end

    def add(self, lines: np.ndarray, values: Sequence[np.ndarray]) -> None:
        """The next rows.

        Raises
        ------
        ConfigError
            When they take more memory than allowed.
        """
        for column, part in zip(self.room(lines.size, int(lines[0])), values, strict=True):
            column[:] = part
        self.fill(lines)

    def _resize(self, rows: int) -> None:
        # in place: a copy of all would double the memory for a moment
        for column in (self._lines, *self._values):
            column.resize(rows, refcheck=False)

    def table(self) -> Table:
        """All rows."""
        self._resize(self._filled)
        return Table(self._path, self._lines, dict(zip(self._wanted, self._values, strict=True)))
