"""The files that a block ``data`` names, as a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from hgorun.config.data import Beside, Column, Data, Judged, Measured, Recorded
from hgorun.data.cells import NAT, Stamps
from hgorun.data.clocks import ClockColumn, origin, origin_stamp, stamps, times_since
from hgorun.data.named_units import another_unit, convertible_in_name, time_in_name
from hgorun.data.recording import InputSignal, Note, Origin, Recording, Signal
from hgorun.data.samples import Samples
from hgorun.data.sorting import Sorting
from hgorun.data.sources import LogFile, Sources, Wanted, given_references
from hgorun.data.units import alike, alike_times, converted
from hgorun.errors import ConfigError, Problem

_LONG = 1 << 18  # samples from which threads pay


def read(
    block: Data,
    folder: Path,
    *,
    time_unit: str = "s",
    units: Mapping[str, str] | None = None,
    files: Sequence[Path] = (),
    beside: Origin | None = None,
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
    beside : Origin, optional
        That of another recording, from which the times of this one are counted, too.

    Raises
    ------
    ConfigError
        For the first fault in the data that is to be refused, with its file and line.
    Problem
        When a key names what is not there.
    """
    return Reader(block, folder, files).recording(time_unit, units or {}, beside)


class Reader:
    """Reads what a block names, and then puts its signals on one clock and in the units of the model.

    Arguments as of :func:`read`; a file is read when a reader is made.
    """

    def __init__(self, block: Data, folder: Path, files: Sequence[Path] = ()) -> None:
        self._block, sources = block, Sources(block, folder, files)
        groups: dict[str, Mapping[str, Column]] = {
            "outputs": block.outputs,
            "inputs": block.inputs,
            "reference": block.reference,
        }
        self._wanted = {
            group: [sources.wanted(name, column, ("data", group, name)) for name, column in columns.items()]
            for group, columns in groups.items()
        }
        self._tables = sources.tables()
        self._stamps: dict[tuple[LogFile, ClockColumn], np.ndarray] = {}
        self._times: dict[tuple[LogFile, ClockColumn], np.ndarray] = {}
        self._notes: list[Note] = []

    def recording(self, unit: str, units: Mapping[str, str], beside: Origin | None = None) -> Recording:
        """All signals; arguments as of :func:`read`."""
        self._unit, self._units, self._beside = unit, units, beside
        signals = [signal for some in self._wanted.values() for signal in some]
        epoch, zoned = self._epoch(signals)
        self._to_times(signals, epoch)
        self._origin = origin(self._unit, epoch, zoned)
        sorted_out = self._all_sorted(signals)
        outputs = {one.name: self._signal(one, sorted_out[one]) for one in self._wanted["outputs"]}
        inputs = {one.name: self._input(one, sorted_out[one]) for one in self._wanted["inputs"]}
        reference = {one.name: self._signal(one, sorted_out[one]) for one in self._wanted["reference"]}
        self._notes += given_references(self._wanted["outputs"], self._wanted["reference"])
        return Recording(
            outputs=outputs,
            inputs=inputs,
            reference=reference,
            notes=tuple(dict.fromkeys(self._notes)),
            origin=self._origin,
            first_samples=self._block.first_samples,
        )

    def _clocks(self, signals: Sequence[Wanted]) -> Iterator[tuple[LogFile, ClockColumn]]:
        for signal in signals:
            for part in signal.parts:
                yield part.file, part.time
                if part.available is not None:
                    yield part.file, part.available

    def _epoch(self, signals: Sequence[Wanted]) -> tuple[int | None, bool]:
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
            self._stamps[file, clock] = stamps(clock, self._tables[file], self._unit)
        if self._beside is not None and bool(absolute) != (self._beside.epoch is not None):
            return self._other_clock(self._beside, clocks[0][1])
        if not absolute:
            return self._no_epoch()
        number = next(((file, clock) for file, clock in clocks if not clock.absolute), None)
        if number is not None and self._block.origin is None:
            message = "numbers here and dates elsewhere: data.origin has to say from which date the numbers count"
            raise Problem(number[1].path, message)
        of_zones = {zone: place for place in reversed(absolute) for zone in _zones(place[1])}
        zones = set(of_zones)
        if len(zones) > 1:
            with_one, without = (self._first_stamp(*of_zones[zone]) for zone in (True, False))
            message = f"some dates have a time zone and others have none: {with_one} has one, {without} has none"
            raise Problem(of_zones[False][1].path, message)
        if self._beside is not None and self._beside.epoch is not None:
            if zones != {bool(self._beside.zone)}:
                here, there = ("have a", "have none") if True in zones else ("have no", "have one")
                raise Problem(absolute[0][1].path, f"the dates {here} time zone, and those of the log {there}")
            return int(self._beside.epoch.astype(np.int64)), zones == {True}
        if self._block.origin is not None:
            return origin_stamp(self._block.origin, absolute[0][1]), zones == {True}
        found = [self._stamps[file, clock] for file, clock in absolute]
        firsts = [int(some[some != NAT].min()) for some in found if np.any(some != NAT)]
        if not firsts:
            raise ConfigError("no time stamps", file=str(absolute[0][0].path))
        return min(firsts), zones == {True}

    def _first_stamp(self, file: LogFile, clock: ClockColumn) -> str:
        """Where the first date of a column stands."""
        there = self._stamps[file, clock] != NAT
        return f"{clock.cells.column} in {file.path}, line {self._tables[file].lines[int(there.argmax())]},"

    def _unit_of_clock(self, file: LogFile, clock: ClockColumn) -> Iterator[Note]:
        """What a file says of the unit of its stamps, where it is another one than the run's."""
        column = clock.cells.column
        said, source = file.table.unit(column).partition(" since ")[0], "the file"
        if not said:
            said, source = time_in_name(column), "its name"
        taken = clock.clock.unit or self._unit
        if not said or clock.absolute or alike_times(said, taken):
            return
        told = another_unit(column, source, said, f"the run counts in {taken}", clock.clock.unit)
        yield Note(kind="clock", signal=".".join(map(str, clock.path)), file=str(file.path), message=told)

    def _other_clock(self, beside: Origin, clock: ClockColumn) -> tuple[int | None, bool]:
        """Numbers beside a log with dates count from the origin that is stated; else nothing relates the clocks."""
        if beside.epoch is None:
            raise Problem(clock.path, "dates here and numbers in the log: nothing says how they belong together")
        if self._block.origin is None:
            message = "numbers here and dates in the log: data.origin has to say from which date the numbers count"
            raise Problem(clock.path, message)
        return int(beside.epoch.astype(np.int64)), bool(beside.zone)

    def _no_epoch(self) -> tuple[None, bool]:
        if self._block.origin is not None:
            raise Problem(("data", "origin"), "the stamps are numbers, which have their own origin")
        return None, False

    def _to_times(self, signals: Sequence[Wanted], epoch: int | None) -> None:
        """Dates become times since the origin; numbers count from there already."""
        for file, clock in dict.fromkeys(self._clocks(signals)):
            found = self._stamps[file, clock]
            if clock.absolute:
                assert epoch is not None
                found = times_since(found, epoch, self._unit)
            self._times[file, clock] = found

    def _samples(self, signal: Wanted) -> Samples:
        tables = [self._tables[part.file] for part in signal.parts]
        parts = signal.parts
        taken = _joined([self._times[part.file, part.time] for part in parts])
        known = [self._times[part.file, part.available] for part in parts if part.available is not None]
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

    def _converted(self, signal: Wanted, values: np.ndarray) -> np.ndarray:
        """Values in the unit of the model."""
        said, wanted = signal.block.unit, self._units.get(signal.name, "")
        file = signal.parts[0].file
        column = signal.block.column
        in_file, source = file.table.unit(column), "the file"
        taken = said or wanted
        if not in_file and taken:
            in_file, source = convertible_in_name(column, taken), "its name"
        if in_file and taken and not alike(in_file, taken):
            told = another_unit(column, source, in_file, f"the model has {taken}", said)
            self._notes.append(Note(kind="units", signal=signal.key, file=str(file.path), message=told))
        if said is None:
            return values
        if not wanted:
            message = f"the model has no unit for {signal.name}: taken in {said} as they are"
            self._notes.append(Note(kind="units", signal=signal.key, file=str(file.path), message=message))
            return values
        return converted(values, said, wanted, (*signal.path, "unit"))

    def _all_sorted(self, signals: Sequence[Wanted]) -> Mapping[Wanted, Samples]:
        """The samples of all signals, those of long logs looked through side by side."""
        with ThreadPoolExecutor(2) as pool:
            found = {one: self._samples(one) for one in signals}
            long = any(samples.values.size > _LONG for samples in found.values())
            done = (pool.map if long else map)(self._sorted, signals, found.values())
            for signal, (samples, notes) in zip(signals, done, strict=True):
                found[signal] = samples
                self._notes += notes
        return found

    def _sorted(self, signal: Wanted, samples: Samples) -> tuple[Samples, list[Note]]:
        """The samples that are used, and what was found in them."""
        block = signal.block
        sorting = Sorting(block.faults.over(self._block.faults), isinstance(block, Judged), self._origin)
        plausible = block.plausible if isinstance(block, Judged) else None
        return sorting.sorted_out(samples, plausible), sorting.notes

    def _unit_of(self, signal: Wanted) -> str:
        return (
            self._units.get(signal.name, "")
            or signal.block.unit
            or signal.parts[0].file.table.unit(signal.block.column)
        )

    def _signal(self, signal: Wanted, samples: Samples) -> Signal:
        block = signal.block
        assert isinstance(block, Judged)
        found = Signal(
            name=signal.name,
            unit=self._unit_of(signal),
            taken=samples.taken,
            available=samples.available,
            values=samples.values,
            lines=samples.lines,
            source=samples.sources[0],
            column=block.column,
            plausible=block.plausible,
            sources=samples.sources,
            part=samples.part,
        )
        if isinstance(block, Measured):
            return replace(found, std=block.std, gate=block.gate)
        return replace(found, lag=block.lag) if isinstance(block, Beside) else found

    def _input(self, signal: Wanted, samples: Samples) -> InputSignal:
        assert isinstance(signal.block, Recorded)
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


def _zones(clock: ClockColumn) -> set[bool]:
    """Whether its dates have a time zone: numbers since 1970 count in UTC."""
    of_dates = clock.cells.zoned if isinstance(clock.cells, Stamps) else set()
    return of_dates | ({True} if clock.clock.format == "unix" else set())
