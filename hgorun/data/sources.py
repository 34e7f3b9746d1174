"""Which columns of which files are wanted, and the tables that are read of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from hgorun.config.data import Clock, Column, Csv, Data, Judged, Measured
from hgorun.config.nearest import LISTED, listed
from hgorun.config.refusals import Refusals
from hgorun.data.cells import Cells, Flags, Numbers
from hgorun.data.clocks import ClockColumn, beside, clock_column
from hgorun.data.column_meant import column_meant
from hgorun.data.files import open_table
from hgorun.data.lengths import require_one_length
from hgorun.data.recording import Note
from hgorun.data.table import Table, TableFile
from hgorun.errors import ConfigError, KeyPath, Problem

_CSV_ADVICE = "csv: {"
_TIME_ADVICE = "time: {column: "


@dataclass(frozen=True, eq=False, repr=False)
class Part:
    """Where a signal stands in one file."""

    file: LogFile
    value: Numbers
    time: ClockColumn
    available: ClockColumn | None
    quality: Flags | None

    @property
    def cells(self) -> Iterator[Cells]:
        yield self.value
        yield self.time.cells
        if self.available is not None:
            yield self.available.cells
        if self.quality is not None:
            yield self.quality


@dataclass(eq=False, repr=False)
class LogFile:
    """An open file, and which of its columns are wanted: those of one length, where they may have several."""

    path: Path
    table: TableFile
    owner: str  # the key below which csv says how it is written
    wanted: dict[Cells, None] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, repr=False)
class Wanted:
    """A signal whose time stamps are still what they are in the files."""

    name: str
    path: KeyPath
    block: Column
    parts: tuple[Part, ...]

    @property
    def key(self) -> str:
        return ".".join(map(str, self.path[1:]))


class Sources:
    """The files of a block, opened as signals ask for their columns, and read once.

    Parameters
    ----------
    block : Data
    folder : Path
        That names in the block are relative to.
    files : sequence of Path
        In place of those that the block names for all signals.
    reference : str
        How the block would begin that names a file which no key names, as of :func:`hgorun.data.reading.read`.
    """

    def __init__(self, block: Data, folder: Path, files: Sequence[Path], reference: str = "") -> None:
        self._reference = reference
        self._unnamed = f"{reference}, ...}}}}" if reference else ""
        self._block, self._folder = block, folder
        self._key: KeyPath | None = None if files else ("data", "file")  # that names the files of all signals
        self._given = list(files) or [folder / name for name in block.file]
        self._files: dict[tuple[Path, Csv], LogFile] = {}
        self._by_length: dict[tuple[LogFile, int], LogFile] = {}
        self._clocks = _clocks_of(block)

    @property
    def shared(self) -> tuple[list[LogFile], KeyPath]:
        """The files of all signals that name none of their own, as far as they are opened, and the key that does."""
        files = [file for file in self._every if file.path in self._given]
        return files, self._key or ("data",)

    def wanted(self, name: str, column: Column, path: KeyPath) -> Wanted:
        """Where a signal stands.

        Raises
        ------
        Problem
            When a key names what is not there.
        ConfigError
            When a file is none of measurements.
        """
        clock, clock_path = column.time, (*path, "time")
        if clock is None:
            clock, clock_path = self._block.time, ("data", "time")
        if clock is None:
            raise Problem(("data",), "time is missing: the column with the time stamps")
        refusals = Refusals()
        files = self._having(column, path, refusals)
        for file in files:
            self._require_beside(file, column, clock, path, clock_path, refusals)
        refusals.refuse()
        parts = tuple(self._part(file, column, clock, path, clock_path) for file in files)
        return Wanted(name, path, column, parts)

    def _having(self, column: Column, path: KeyPath, refusals: Refusals) -> list[LogFile]:
        """The files in which a column should stand: its own, or those of all signals that have it, or the first."""
        csv = column.csv or self._block.csv
        own = column.csv is not None or column.file is not None
        owner = (self._unnamed or ".".join(map(str, path))) if own else "data"
        place = (*path, "column")
        if column.file is not None:
            file = self._open(self._folder / column.file, csv, (*path, "file"), owner)
            with refusals.of_a_part():
                self._known(file, column.column, place)
            return [file]
        if not self._given:
            raise Problem(("data",), "no file is given: name it as file, such as --set data.file=LOG")
        files, missing = [], Refusals()
        for given in self._given:
            with missing.of_a_part():
                files.append(self._open(given, csv, self._key, owner))
        missing.refuse()
        found = [file for file in files if column.column in file.table.names]
        with refusals.of_a_part():
            if not found:
                self._known(files[0], column.column, place, [n for file in files for n in file.table.names])
            for file in found:
                self._known(file, column.column, place)
        return found or files[:1]

    def _require_beside(
        self, file: LogFile, column: Column, clock: Clock, path: KeyPath, clock_path: KeyPath, refusals: Refusals
    ) -> None:
        """Find what else a signal asks of a file: the columns of its times, and of its quality."""
        names = {(*clock_path, "column"): clock.column}
        if isinstance(column, Measured) and column.available is not None:
            names[*path, "available", "column"] = column.available.column
        if isinstance(column, Judged) and column.quality is not None:
            names[*path, "quality", "column"] = column.quality.column
        for place, name in names.items():
            with refusals.of_a_part():
                self._known(file, name, place)
                require_one_length(file.path, file.table, name, column.column, place)

    def _part(self, file: LogFile, column: Column, clock: Clock, path: KeyPath, clock_path: KeyPath) -> Part:
        available = quality = None
        time = clock_column(clock, file.table, clock_path)
        if isinstance(column, Measured) and column.available is not None:
            known = beside(column.available, clock, file.table)
            available = clock_column(known, file.table, (*path, "available"))
        if isinstance(column, Judged) and column.quality is not None:
            quality = Flags(column.quality.column, column.quality.good)
        file = self._of_length(file, file.table.rows(column.column))
        part = Part(file, Numbers(column.column), time, available, quality)
        file.wanted |= dict.fromkeys(part.cells)
        return part

    def _open(self, path: Path, csv: Csv, key: KeyPath | None, owner: str) -> LogFile:
        known = self._files.get((path, csv))
        if known is None:
            with _told_with_place(owner):
                table = open_table(path, csv, key, self._clocks)
            known = self._files[path, csv] = LogFile(path, table, owner)
        return known

    def _of_length(self, file: LogFile, rows: int) -> LogFile:
        """A file as one whose columns that are wanted have so many rows: arrays of several rates may be in one."""
        if not any(file.table.rows(cells.column) != rows for cells in file.wanted):
            return file
        empty = LogFile(file.path, file.table, file.owner)
        return self._by_length.setdefault((file, rows), empty)

    @property
    def _every(self) -> list[LogFile]:
        return [*self._files.values(), *self._by_length.values()]

    def _known(self, file: LogFile, column: str, path: KeyPath, names: Sequence[str] = ()) -> None:
        """Nothing, if a file has a column once.

        Raises
        ------
        Problem
        """
        known = names or file.table.names
        count = list(file.table.names).count(column)
        if count == 1:
            return
        if count > 1:
            raise Problem(
                path, f"{file.path} has {count} columns called {column!r}: give each a name of its own in the header"
            )
        header = " in its header" if len(known) > LISTED else ""
        shown = f": {listed(map(_visible, known), column)}{header}" if known else " none"
        hint = file.table.hint(column, _columns_of(self._block)) or column_meant(column, known)
        told = f"{file.path} has no column {column!r}.{hint} It has{shown}"
        if self._reference:  # the keys are those of the log, which stay as they are
            of_its_own = f"{self._reference}, column: COLUMN, time: COLUMN}}}}"
            path, told = ("data", "reference"), f"{told}; {of_its_own} reads a file with other names than the log"
        raise Problem(path, told)

    def tables(self) -> dict[LogFile, Table]:
        """What is wanted of every file.

        Raises
        ------
        ConfigError
            For the first thing wrong in one.
        """
        budget, found = self._block.max_memory, {}
        for file in self._every:
            if file.wanted:
                with _told_with_place(file.owner):
                    table = file.table.table(list(file.wanted), budget)
                budget -= table.lines.nbytes + sum(column.nbytes for column in table.columns.values())
                found[file] = table
        return found


def _columns_of(block: Data) -> set[str]:
    """All columns that a block names, but those of qualities."""
    columns = [*block.outputs.values(), *block.inputs.values(), *block.reference.values()]
    clocks = [block.time, *(column.time for column in columns)]
    return {column.column for column in columns} | {clock.column for clock in clocks if clock is not None}


def _clocks_of(block: Data) -> dict[str, set[str | None]]:
    """The formats of all columns of time stamps that a block names."""
    found: dict[str, set[str | None]] = {}
    for column in (*block.outputs.values(), *block.inputs.values(), *block.reference.values()):
        time = column.time or block.time
        known = column.available if isinstance(column, Measured) else None
        for clock in (time, known):
            if clock is not None:
                form = clock.format or (time.format if time is not None else None)
                found.setdefault(clock.column, set()).add(form)
    return found


@contextmanager
def _told_with_place(owner: str) -> Iterator[None]:
    """Readers of files know no keys: where they advise ``csv``, or a clock of a file that only one signal has, it is
    told what that stands below."""
    try:
        yield
    except ConfigError as error:
        said, file, line, key = error.message, error.file, error.line, error.key
        if _CSV_ADVICE in said:
            raise ConfigError(f"{said}; csv goes below {owner}", file=file, line=line, key=key) from None
        if _TIME_ADVICE in said and owner != "data":
            message = f"{said}; {owner} may have such a time of its own"
            raise ConfigError(message, file=file, line=line, key=key) from None
        raise


def given_references(outputs: Sequence[Wanted], references: Sequence[Wanted]) -> Iterator[Note]:
    """What is to be compared with estimates, and observers get it nevertheless."""
    given = {(part.file, one.block.column): one.key for one in outputs for part in one.parts}
    for one in references:
        files = [part.file for part in one.parts if (part.file, one.block.column) in given]
        if files:
            key = given[files[0], one.block.column]
            told = f"observers get this column as {key}: estimates are compared with what they use"
            yield Note(kind="used", signal=one.key, file=str(files[0].path), message=told)


def remarks_on(file: LogFile, table: Table) -> Iterator[Note]:
    """What is told of how a file is written."""
    for line, said in table.remarks:
        told = f"{said}; csv goes below {file.owner}" if _CSV_ADVICE in said else said
        yield Note(kind="format", signal="", file=str(file.path), line=line, message=told)


def _visible(name: str) -> str:
    """A name with escapes for characters that one does not see, such as a mark of the byte order inside a file."""
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in name)
