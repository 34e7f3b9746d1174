"""The files that a block ``data`` names, as a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hgorun.config.data import Clock, Column, Csv, Data, Measured, Recorded
from hgorun.config.expressions import nearest
from hgorun.data.cells import NAT, Cells, Flags, Numbers, Stamps
from hgorun.data.clocks import ClockColumn, clock_column, origin, origin_stamp, stamps, times_since
from hgorun.data.files import open_table
from hgorun.data.recording import InputSignal, Note, Recording, Signal
from hgorun.data.samples import Samples, Sorting
from hgorun.data.table import Table, TableFile
from hgorun.data.units import converted
from hgorun.errors import ConfigError, KeyPath, Problem


def read(
    block: Data,
    folder: Path,
    *,
    time_unit: str = "s",
    units: Mapping[str, str] | None = None,
    files: Sequence[Path] = (),
) -> Recording:
    """Measurements in the units of a model.

    Parameters
    ----------
    block : Data
    folder : Path
        That of the configuration: names of files in the block are relative to it.
    time_unit : str
        Of the run.
    units : mapping of str to str, optional
        Of the model's outputs, states and inputs; columns with a unit of their own are converted to these.
    files : sequence of Path
        In place of those that the block names for all signals.

    Raises
    ------
    ConfigError
        For the first fault in the data that is to be refused, with its file and line.
    Problem
        When a key names what is not there.
    """
    return _Reader(block, folder, time_unit, units or {}, files).recording()


@dataclass(frozen=True, eq=False, repr=False)
class _Part:
    """Where a signal stands in one file."""

    file: _File
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
class _File:
    """An open file, and which of its columns are wanted."""

    path: Path
    table: TableFile
    wanted: dict[Cells, None] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, repr=False)
class _Raw:
    """A signal whose time stamps are still what they are in the files."""

    name: str
    path: KeyPath
    block: Column
    parts: tuple[_Part, ...]

    @property
    def key(self) -> str:
        return ".".join(map(str, self.path[1:]))


class _Reader:
    def __init__(self, block: Data, folder: Path, unit: str, units: Mapping[str, str], files: Sequence[Path]) -> None:
        self._block, self._folder, self._unit, self._units = block, folder, unit, units
        self._given = list(files) or [folder / name for name in block.file]
        self._files: dict[tuple[Path, Csv], _File] = {}
        self._tables: dict[int, Table] = {}
        self._stamps: dict[tuple[int, ClockColumn], np.ndarray] = {}
        self._times: dict[tuple[int, ClockColumn], np.ndarray] = {}
        self._notes: list[Note] = []

    def recording(self) -> Recording:
        block = self._block
        groups: dict[str, Mapping[str, Column]] = {
            "outputs": block.outputs,
            "inputs": block.inputs,
            "reference": block.reference,
        }
        raw = {
            group: [self._raw(name, column, ("data", group, name)) for name, column in columns.items()]
            for group, columns in groups.items()
        }
        signals = [signal for some in raw.values() for signal in some]
        self._read_tables()
        epoch, zoned = self._epoch(signals)
        self._to_times(signals, epoch)
        outputs = {signal.name: self._signal(signal) for signal in raw["outputs"]}
        inputs = {signal.name: self._input(signal) for signal in raw["inputs"]}
        reference = {signal.name: self._signal(signal) for signal in raw["reference"]}
        return Recording(
            outputs=outputs,
            inputs=inputs,
            reference=reference,
            notes=tuple(dict.fromkeys(self._notes)),
            origin=origin(self._unit, epoch, zoned),
        )

    # which columns of which files

    def _raw(self, name: str, column: Column, path: KeyPath) -> _Raw:
        clock, clock_path = column.time, (*path, "time")
        if clock is None:
            clock, clock_path = self._block.time, ("data", "time")
        if clock is None:
            raise Problem(("data",), "time is missing: the column with the time stamps")
        files = self._having(column, path)
        parts = tuple(self._part(file, column, clock, path, clock_path) for file in files)
        return _Raw(name, path, column, parts)

    def _having(self, column: Column, path: KeyPath) -> list[_File]:
        """The files in which a column stands: its own, or those of all signals that have it."""
        csv = column.csv or self._block.csv
        if column.file is not None:
            file = self._open(self._folder / column.file, csv, (*path, "file"))
            self._known(file, column.column, (*path, "column"))
            return [file]
        if not self._given:
            raise Problem(("data",), "no file is given: name one as file, or behind the configuration")
        files = [self._open(given, csv, ("data", "file")) for given in self._given]
        found = [file for file in files if column.column in file.table.names]
        if not found:
            self._known(files[0], column.column, (*path, "column"), [n for file in files for n in file.table.names])
        for file in found:
            self._known(file, column.column, (*path, "column"))
        return found

    def _part(self, file: _File, column: Column, clock: Clock, path: KeyPath, clock_path: KeyPath) -> _Part:
        available = quality = None
        time = self._clock(file, clock, clock_path)
        if isinstance(column, Measured):
            if column.available is not None:
                available = self._clock(file, column.available, (*path, "available"))
            if column.quality is not None:
                self._known(file, column.quality.column, (*path, "quality", "column"))
                quality = Flags(column.quality.column, column.quality.good)
        part = _Part(file, Numbers(column.column), time, available, quality)
        file.wanted |= dict.fromkeys(part.cells)
        return part

    def _clock(self, file: _File, clock: Clock, path: KeyPath) -> ClockColumn:
        self._known(file, clock.column, (*path, "column"))
        return clock_column(clock, file.table, path)

    def _open(self, path: Path, csv: Csv, key: KeyPath) -> _File:
        known = self._files.get((path, csv))
        if known is None:
            known = self._files[path, csv] = _File(path, open_table(path, csv, key))
        return known

    def _known(self, file: _File, column: str, path: KeyPath, names: Sequence[str] = ()) -> None:
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
            raise Problem(path, f"{file.path} has {count} columns called {column!r}")
        shown = ", ".join(known[:20]) + (", ..." if len(known) > 20 else "")
        raise Problem(path, f"{file.path} has no column {column!r}.{nearest(column, known)} It has: {shown}")

    # their times

    def _read_tables(self) -> None:
        budget = self._block.max_memory
        for file in self._files.values():
            if file.wanted:
                table = file.table.table(list(file.wanted), budget)
                budget -= table.lines.nbytes + sum(column.nbytes for column in table.columns.values())
                self._tables[id(file)] = table

    def _clocks(self, signals: Sequence[_Raw]) -> Iterator[tuple[_File, ClockColumn]]:
        for signal in signals:
            for part in signal.parts:
                yield part.file, part.time
                if part.available is not None:
                    yield part.file, part.available

    def _epoch(self, signals: Sequence[_Raw]) -> tuple[int | None, bool]:
        """The date that is time 0, and whether it is in UTC; None where stamps are numbers.

        Raises
        ------
        Problem
            When stamps do not belong to one clock.
        """
        clocks = list(self._clocks(signals))
        absolute = [(file, clock) for file, clock in clocks if clock.absolute]
        for file, clock in dict.fromkeys(clocks):
            self._notes += self._unit_of_clock(file, clock)
            self._stamps[id(file), clock] = stamps(clock, self._tables[id(file)], self._unit)
        if not absolute:
            return self._no_epoch()
        number = next(((file, clock) for file, clock in clocks if not clock.absolute), None)
        if number is not None:
            raise Problem(number[1].path, "numbers here and dates elsewhere: the two clocks cannot be compared")
        zones = {zone for _, clock in absolute if isinstance(clock.cells, Stamps) for zone in clock.cells.zoned}
        zones |= {True for _, clock in absolute if clock.clock.format == "unix"}
        if len(zones) > 1:
            raise Problem(absolute[0][1].path, "some dates have a time zone and others have none")
        if self._block.origin is not None:
            return origin_stamp(self._block.origin, absolute[0][1]), zones == {True}
        found = [self._stamps[id(file), clock] for file, clock in absolute]
        firsts = [int(some[some != NAT].min()) for some in found if np.any(some != NAT)]
        if not firsts:
            raise ConfigError("no time stamps", file=str(absolute[0][0].path))
        return min(firsts), zones == {True}

    def _unit_of_clock(self, file: _File, clock: ClockColumn) -> Iterator[Note]:
        """What a file says of the unit of its stamps, where it is another one than the run's."""
        said = file.table.unit(clock.cells.column).partition(" since ")[0]
        if said and not clock.absolute and clock.clock.unit is None and said != self._unit:
            message = f"the file says {said}, the run counts in {self._unit}: taken as they are; unit: {said} converts"
            yield Note(kind="clock", signal=clock.cells.column, file=str(file.path), message=message)

    def _no_epoch(self) -> tuple[None, bool]:
        if self._block.origin is not None:
            raise Problem(("data", "origin"), "the stamps are numbers, which have their own origin")
        return None, False

    def _to_times(self, signals: Sequence[_Raw], epoch: int | None) -> None:
        for file, clock in self._clocks(signals):
            found = self._stamps[id(file), clock]
            self._times[id(file), clock] = found if epoch is None else times_since(found, epoch, self._unit)

    # the signals

    def _samples(self, signal: _Raw) -> Samples:
        tables = [self._tables[id(part.file)] for part in signal.parts]
        parts = signal.parts
        taken = _joined([self._times[id(part.file), part.time] for part in parts])
        known = [self._times[id(part.file), part.available] for part in parts if part.available is not None]
        values = _joined([table.columns[part.value] for table, part in zip(tables, parts, strict=True)])
        good = [
            table.columns[part.quality] for table, part in zip(tables, parts, strict=True) if part.quality is not None
        ]
        counts = [table.lines.size for table in tables]
        return Samples(
            key=signal.key,
            taken=taken,
            available=_joined(known) if known else taken,
            values=self._converted(signal, values),
            lines=_joined([table.lines for table in tables]),
            part=np.repeat(np.arange(len(tables), dtype=np.int16), counts)
            if len(tables) > 1
            else np.empty(0, np.int16),
            good=_joined(good) if good else None,
            sources=tuple(part.file.path for part in parts),
        )

    def _converted(self, signal: _Raw, values: np.ndarray) -> np.ndarray:
        """Values in the unit of the model."""
        said, wanted = signal.block.unit, self._units.get(signal.name, "")
        file = signal.parts[0].file
        in_file = file.table.unit(signal.block.column)
        if said is None:
            if in_file and wanted and in_file != wanted:
                message = f"the file says {in_file}, the model {wanted}: taken as they are; unit: {in_file} converts"
                self._notes.append(Note(kind="units", signal=signal.key, file=str(file.path), message=message))
            return values
        if not wanted:
            message = f"the model has no unit for {signal.name}: taken in {said} as they are"
            self._notes.append(Note(kind="units", signal=signal.key, file=str(file.path), message=message))
            return values
        return converted(values, said, wanted, (*signal.path, "unit"))

    def _sorted(self, signal: _Raw, plausible: tuple[float, float] | None, *, measured: bool) -> Samples:
        told = signal.block.faults.over(self._block.faults)
        sorting = Sorting(told, measured)
        samples = sorting.sorted_out(self._samples(signal), plausible)
        self._notes += sorting.notes
        return samples

    def _unit_of(self, signal: _Raw) -> str:
        return (
            self._units.get(signal.name, "")
            or signal.block.unit
            or signal.parts[0].file.table.unit(signal.block.column)
        )

    def _signal(self, signal: _Raw) -> Signal:
        block = signal.block
        assert isinstance(block, Measured)
        samples = self._sorted(signal, block.plausible, measured=True)
        return Signal(
            name=signal.name,
            unit=self._unit_of(signal),
            taken=samples.taken,
            available=samples.available,
            values=samples.values,
            lines=samples.lines,
            source=samples.sources[0],
            column=block.column,
            std=block.std,
            plausible=block.plausible,
            gate=block.gate,
        )

    def _input(self, signal: _Raw) -> InputSignal:
        assert isinstance(signal.block, Recorded)
        samples = self._sorted(signal, None, measured=False)
        return InputSignal(
            name=signal.name,
            unit=self._unit_of(signal),
            times=samples.taken,
            values=samples.values,
            hold=signal.block.hold,
            lines=samples.lines,
            source=samples.sources[0],
        )


def _joined(parts: Sequence[np.ndarray]) -> np.ndarray:
    """One after the other; of a single one the array itself, which signals then share."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
