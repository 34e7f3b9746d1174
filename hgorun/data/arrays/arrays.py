"""Files that hold arrays, column by column: what they have in common."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np

from hgorun.config.data import Csv
from hgorun.data.cells import Cells, Flags, Numbers, Stamps
from hgorun.data.csv.missing import leave_out, missing_numbers, missing_texts
from hgorun.data.table import Table, Texts, too_large
from hgorun.data.times.date_hints import as_yaml
from hgorun.data.times.dates import NAT, counted
from hgorun.data.times.since import counts_from_a_date, own_unit, since
from hgorun.errors import ConfigError, printable
from hgorun.result.hdf5.guarded import Failed, guarded

T = TypeVar("T")

_SECONDS = 120.0  # that reading may take
_ROOM = 2**29  # bytes for libraries
_SHORT = (np.float16, np.float32)


@dataclass(frozen=True)
class ArrayColumn:
    """What is known of a column before it is read.

    Attributes
    ----------
    rows : int
    unit : str
        As the file states it; empty where it does not.
    sample : str
        Its first value that is not missing; a date in ISO 8601.
    calendar : str
        Of numbers whose unit is such as ``minutes since 2024-01-01``; empty where the file names none.
    texts : sequence of str
        Its first values, where a few columns stand beside each other and one of them holds texts; missing ones are
        empty.
    """

    rows: int
    unit: str
    sample: str
    calendar: str = ""
    texts: Sequence[str] = ()


class ArrayFormat(Protocol):
    """How files of one kind are read, in a process of their own."""

    def catalogue(self, path: Path) -> Mapping[str, ArrayColumn]:
        """The columns."""

    def columns(self, path: Path, names: Sequence[str]) -> Mapping[str, np.ndarray]:
        """Numbers, dates in nanoseconds (datetime64), or texts."""

    def passed_over(self, path: Path, name: str) -> str:
        """Why something with this name is not among the columns; empty where there is none."""

    def zoned(self, path: Path, name: str) -> bool:
        """Whether dates are in UTC."""


class ArrayFile:
    """A file whose columns are known and not yet read; rows are counted from 1 where text files have lines.

    Parameters
    ----------
    path : Path
    form : ArrayFormat
    told : Csv
        How texts are written, and what stands for a missing value.

    Raises
    ------
    ConfigError
        When it is damaged.
    """

    def __init__(self, path: Path, form: ArrayFormat, told: Csv) -> None:
        self._path, self._form, self._told = path, form, told
        self._decimal = told.decimal or ("," if told.thousands == "." else ".")
        self._missing_numbers = missing_numbers(told, self._decimal)
        self._columns = _aside(path, lambda: dict(form.catalogue(path)), 2**28)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the columns."""
        return tuple(self._columns)

    def sample(self, column: str) -> str:
        """The first value of a column."""
        return self._columns[column].sample

    def unit(self, column: str) -> str:
        """The unit that the file states."""
        return printable(self._columns[column].unit)

    def counts_from_a_date(self, column: str) -> bool:
        """Whether its unit is such as ``minutes since 2024-01-01``."""
        return counts_from_a_date(self._columns[column].unit)

    def rows(self, column: str) -> int:
        """How many a column has."""
        return self._columns[column].rows

    def hint(self, column: str, names: Collection[str] = ()) -> str:
        """What the file has under that name."""
        why = _aside(self._path, lambda: self._form.passed_over(self._path, column), 2**26)
        return f" {column} is there, but {why}." if why else ""

    def texts(self, *lines: int) -> Texts:
        """The first rows of a table with texts."""
        return {name: dict(enumerate(column.texts, 1)) for name, column in self._columns.items() if column.texts}

    def table(self, wanted: Sequence[Cells], budget: float) -> Table:
        """Columns of it, all of one length.

        Raises
        ------
        ConfigError
            When a cell is not what was expected, or when they take more memory than allowed.
        """
        names = list(dict.fromkeys(cells.column for cells in wanted))
        rows = self._columns[names[0]].rows
        if not rows:
            raise self._error("no rows")
        if rows * (4 + 8 * len(wanted)) > budget:
            raise too_large(self._path, budget)
        room = 3 * rows * 8 * len(names)
        arrays = _aside(self._path, lambda: dict(self._form.columns(self._path, names)), room)
        for cells in wanted:
            if isinstance(cells, Stamps) and arrays[cells.column].dtype.kind == "M":
                cells.zoned.add(self._form.zoned(self._path, cells.column))
        columns = {cells: self._values(cells, arrays[cells.column]) for cells in wanted}
        clocks = [cells for cells in wanted if not isinstance(cells, Flags) and cells.key]
        single = {cells: arrays[cells.column] for cells in clocks if arrays[cells.column].dtype in _SHORT}
        apart: dict[Cells, float] = {cells: _apart(array) * self._counts(cells) for cells, array in single.items()}
        return Table(self._path, np.arange(1, rows + 1, dtype=np.int32), columns, apart=apart)

    def _counts(self, cells: Cells) -> int:
        """How many nanoseconds its numbers count where they become dates; else 1."""
        column = self._columns[cells.column]
        return since(column.unit, column.calendar).unit if isinstance(cells, Stamps) and not cells.pattern else 1

    def _values(self, cells: Cells, array: np.ndarray) -> np.ndarray:
        kind = array.dtype.kind
        if isinstance(cells, Numbers) and kind in "fiu":
            values = np.array(array, dtype=float)
            with np.errstate(over="ignore"):  # -999.9 is another number in single precision
                absent = np.array(self._missing_numbers).astype(array.dtype if kind == "f" else float)
            leave_out(absent.astype(float).tolist(), values)
            if (wrong := np.flatnonzero(np.isinf(values))).size:
                raise self._error("expected a number, found an infinite one", int(wrong[0]), cells.column)
            return values
        if isinstance(cells, Stamps) and kind == "M":
            return np.asarray(array).astype("datetime64[ns]").astype(np.int64)
        if isinstance(cells, Flags) and kind in "fiu":
            return np.isin(array, [good for good in cells.good if not isinstance(good, str)]).astype(float)
        if isinstance(cells, Stamps) and kind in "fiu" and self.counts_from_a_date(cells.column):
            return self._counted(cells, array)
        if isinstance(cells, Stamps) and kind in "fiu" and cells.pattern is not None:
            return self._read(cells, _in_digits(array))
        if kind == "M" or (isinstance(cells, Stamps) and kind not in "Ob"):
            raise self._error(f"expected {'dates' if isinstance(cells, Stamps) else 'numbers'}", 0, cells.column)
        return self._read(cells, array)

    def _counted(self, cells: Stamps, array: np.ndarray) -> np.ndarray:
        """Dates of numbers that count from one."""
        column = self._columns[cells.column]
        try:
            told = since(column.unit, column.calendar)
        except ValueError as error:
            keys = own_unit(column.unit)
            key = f": {cells.key}: {{column: {as_yaml(cells.column)}, {keys}}}" if keys else ""
            hint = f"with unit or format the numbers are read as these say{key}"
            raise self._error(f"{error}; {hint}", None, cells.column) from None
        found, wrong = counted(array, told.unit, told.start)
        if wrong is not None:
            message = f"expected a date between 1678 and 2262, found {array[wrong]:g} {column.unit}"
            raise self._error(message, wrong, cells.column)
        cells.zoned.add(told.zoned)
        return found

    def _read(self, cells: Cells, texts: np.ndarray) -> np.ndarray:
        """Texts, cell by cell."""
        read = cells.reader(self._decimal, missing_texts(self._told), self._told.thousands)
        values = np.full(texts.size, NAT if isinstance(cells, Stamps) else np.nan, dtype=cells.dtype)
        for row, text in enumerate(texts.tolist()):
            try:
                values[row] = read("" if text is None else str(text))
            except ValueError as error:
                raise self._error(str(error), row, cells.column) from None
        if isinstance(cells, Numbers):
            leave_out(self._missing_numbers, values)
        return values

    def _error(self, message: str, row: int | None = None, column: str | None = None) -> ConfigError:
        return ConfigError(message, file=str(self._path), line=None if row is None else row + 1, key=column)


def _apart(array: np.ndarray) -> float:
    """How far apart the largest numbers of single precision are; 0 where all are whole and it holds all such."""
    there = array[np.isfinite(array)]
    largest = np.abs(there).max(initial=array.dtype.type(0))
    whole = largest <= 2.0 ** (np.finfo(array.dtype).nmant + 1) and bool(np.all(there == np.floor(there)))
    return 0.0 if whole else float(np.spacing(largest))


def _in_digits(numbers: np.ndarray) -> np.ndarray:
    """Numbers as texts, since 20240131 may be a date; missing ones are None."""
    return np.array([None if math.isnan(number) else f"{number:.15g}" for number in numbers.tolist()], dtype=object)


def _aside(path: Path, work: Callable[[], T], room: int) -> T:
    """What is done in a process of its own: libraries can hang or crash on a damaged file."""
    try:
        return guarded(lambda: _told(path, work), seconds=_SECONDS, memory=2 * room + _ROOM)
    except Failed as error:
        raise ConfigError(f"not an intact file: {error}", file=str(path)) from None


def _told(path: Path, work: Callable[[], T]) -> T:
    try:
        return work()
    except MemoryError:
        raise ConfigError("reading it takes too much memory", file=str(path)) from None
    except (OSError, KeyError, ValueError, TypeError, AttributeError, RuntimeError, OverflowError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ConfigError(f"damaged: {reason}", file=str(path)) from None
