"""The clocks of all signals as one: times in the unit of the run, from one origin."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from hgorun.config.data import Data, has_date
from hgorun.data.clock_texts import odd_texts
from hgorun.data.clocks import ClockColumn, origin, origin_stamp, stamps, times_since
from hgorun.data.far_dates import require_near
from hgorun.data.odd_clocks import odd_dates, odd_numbers
from hgorun.data.parts import require_one_time_unit
from hgorun.data.recording import Note, Origin
from hgorun.data.sources import LogFile, Wanted
from hgorun.data.table import Table
from hgorun.data.times.date_hints import clock_key, with_exchanged
from hgorun.data.times.date_order import (
    a_day_too_early,
    days_counted,
    exchanged,
    known_after,
    passes_midnight,
    unlike_others,
)
from hgorun.data.times.dates import NAT
from hgorun.data.times.day_counts import four_years_apart, span_of
from hgorun.data.times.zones import BOTH
from hgorun.data.units.factored_units import has_factor
from hgorun.data.units.named_units import AnotherUnit, note_of, time_in_name
from hgorun.data.units.units import alike_times
from hgorun.errors import ConfigError, Problem
from hgorun.progress import duration


class OneClock:
    """The times of some signals.

    Parameters
    ----------
    block : Data
    signals : sequence of Wanted
    tables : mapping of LogFile to Table
    unit : str
        Of the run.
    beside : Origin, optional
        That of another recording, from which these times are counted, too.
    reference : str
        As of :func:`hgorun.data.reading.read`.

    Attributes
    ----------
    times : dict of (LogFile, ClockColumn) to ndarray
    origin : Origin
    notes : list of Note
        What was found.

    Raises
    ------
    ConfigError, Problem
        When stamps do not belong to one clock.
    """

    def __init__(
        self,
        block: Data,
        signals: Sequence[Wanted],
        tables: Mapping[LogFile, Table],
        unit: str,
        beside: Origin | None,
        reference: str = "",
    ) -> None:
        column = json.dumps(signals[0].block.column, ensure_ascii=False) if signals else ""
        self._around = (f"{reference}, column: {column}, time: {{", "}}}") if reference else None
        self._block, self._tables, self._unit, self._beside = block, tables, unit, beside
        self._stamps: dict[tuple[LogFile, ClockColumn], np.ndarray] = {}
        self.notes: list[Note] = []
        epoch, zoned = self._epoch(signals)
        self.times = dict(self._to_times(signals, epoch))
        self.origin = origin(unit, epoch, zoned)

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
        require_one_time_unit((file, clock) for file, clock in clocks if not clock.absolute)
        for file, clock in dict.fromkeys(clocks):
            self.notes += self._unit_of_clock(file, clock)
            self._stamps[file, clock] = stamps(clock, self._tables[file], self._unit)
        require_near({place: self._stamps[place] for place in absolute}, self._tables)
        self._require_one_day_0(dict.fromkeys(absolute))
        for file, clock in dict.fromkeys(absolute):
            for told in odd_texts(clock, self._tables[file]):
                key = ".".join(map(str, clock.path))
                self.notes.append(Note(kind="clock", signal=key, file=str(file.path), message=told))
            self._require_order(file, clock, signals)
        self._count_days(signals)
        if self._beside is not None and bool(absolute) != (self._beside.epoch is not None):
            return self._other_clock(self._beside, clocks[0][1])
        if not absolute:
            return self._no_epoch()
        number = next(((file, clock) for file, clock in clocks if not clock.absolute), None)
        if number is not None and self._block.origin is None:
            message = "numbers here and dates elsewhere: data.origin has to say from which date the numbers count"
            raise Problem(number[1].path, message)
        of_zones = {zone: place for place in reversed(absolute) for zone in place[1].zones}
        zones = set(of_zones)
        if len(zones) > 1:
            with_one, without = (self._first_stamp(*of_zones[zone]) for zone in (True, False))
            message = f"some dates have a time zone, others none: {with_one} has one, {without} has none; {BOTH}"
            raise Problem(of_zones[False][1].path, message)
        if self._beside is not None and self._beside.epoch is not None:
            if zones != {bool(self._beside.zone)}:
                here, there = ("have a", "have none") if True in zones else ("have no", "have one")
                raise Problem(absolute[0][1].path, f"the dates {here} time zone, and those of the log {there}")
            return int(self._beside.epoch.astype(np.int64)), zones == {True}
        if self._block.origin is not None:
            return origin_stamp(self._block.origin, absolute[0][1], zones), zones == {True}
        found = [self._stamps[file, clock] for file, clock in absolute]
        firsts = [int(some[some != NAT].min()) for some in found if np.any(some != NAT)]
        if not firsts:
            raise ConfigError("no time stamps", file=str(absolute[0][0].path))
        return min(firsts), zones == {True}

    def _require_one_day_0(self, clocks: Iterable[tuple[LogFile, ClockColumn]]) -> None:
        """Tell dates that cannot be meant, and refuse those of workbooks that count from another day than is told."""
        spans = {}
        for file, clock in clocks:
            span = span_of(self._stamps[file, clock])
            if span is None:
                continue
            spans[file, clock] = span, clock.clock.format or "iso"
            if (told := odd_dates(clock, span)) is not None:
                key = ".".join(map(str, clock.path))
                self.notes.append(Note(kind="clock", signal=key, file=str(file.path), message=told))
        for (file, clock), message in four_years_apart(spans):
            table, there = self._tables[file], self._stamps[file, clock] != NAT
            line = int(table.lines[int(there.argmax())])
            raise ConfigError(message, file=str(file.path), line=line, key=clock.cells.column)

    def _count_days(self, signals: Sequence[Wanted]) -> None:
        """Times of day without dates, where midnight is told to pass; what is known later is so within a day.

        Parts of a signal follow each other, and all signals the first time of the log.
        """
        epoch = None if self._beside is None else self._beside.epoch
        start = None if epoch is None else int(epoch.astype(np.int64))
        counted = set()
        for signal in signals:
            before = start
            for place in ((part.file, part.time) for part in signal.parts if part.time.clock.next_day):
                if place not in counted:
                    self._stamps[place] = days_counted(self._stamps[place], before)
                    counted.add(place)
                there = self._stamps[place][self._stamps[place] != NAT]
                if there.size:
                    before = int(there[-1])
                    start = int(there[0]) if start is None else start
        self.notes += [note for place in self._stamps if place in counted for note in self._days_lost(*place)]
        known = {}
        for part in (part for signal in signals for part in signal.parts):
            if part.available is not None and part.available.clock.next_day:
                place = part.file, part.available
                taken = self._stamps[part.file, part.time]
                self._stamps[place] = known_after(self._stamps[place], taken)
                known[place] = taken
        self.notes += [note for place, taken in known.items() for note in self._known_earlier(*place, taken)]

    def _days_lost(self, file: LogFile, clock: ClockColumn) -> Iterator[Note]:
        """What is told of the longest gap between times of day, where whole days may have passed."""
        found = unlike_others(self._stamps[file, clock])
        if found is None:
            return
        place, gap = found
        column, line = clock.cells.column, int(self._tables[file].lines[place])
        told = (
            f"column {column!r}: next_day counts the times that pass midnight: the gap of {duration(gap / 1e9)} before "
            "this line, the longest, may be of a day or more, whose days are lost; such logs need dates"
        )
        key = ".".join(map(str, clock.path))
        yield Note(kind="clock", signal=key, file=str(file.path), line=line, message=told)

    def _known_earlier(self, file: LogFile, clock: ClockColumn, taken: np.ndarray) -> Iterator[Note]:
        """What is told of the first sample that may have become known a day later than times of day say."""
        place = a_day_too_early(self._stamps[file, clock], taken)
        if place is None:
            return
        late = float(self._stamps[file, clock][place] - taken[place])
        told = (
            f"column {clock.cells.column!r}: the sample of this line is taken to be known {duration(late / 1e9)} after "
            "it was taken, and before the one above it: next_day counts no more than 23 h, so that one that is known "
            "a day later needs dates"
        )
        key, line = ".".join(map(str, clock.path)), int(self._tables[file].lines[place])
        yield Note(kind="clock", signal=key, file=str(file.path), line=line, message=told)

    def _require_order(self, file: LogFile, clock: ClockColumn, signals: Sequence[Wanted]) -> None:
        """Refuse dates that run backwards as they are read, and not as they may be meant.

        Where all signals say what is done about times that run backwards, it is only told.

        Raises
        ------
        Problem
        """
        found, form = self._stamps[file, clock], clock.clock.format or "iso"
        dated = has_date(form)
        wrong = exchanged(found) if dated else passes_midnight(found)
        if wrong is None or clock.clock.next_day:
            return
        column = clock.cells.column
        where = f"{file.path}, line {self._tables[file].lines[wrong]}, column {column!r}"
        stand = "if they are right as they stand, faults: {backwards: sort} below data is right"
        if not dated:
            right = f"{clock_key(str(clock.path[-1]), column, form)[:-1]}, next_day: true}}"
            message = (
                f"midnight seems to pass ({where}), and the pattern {form} has no date: {right} counts days; {stand}"
            )
        else:
            swapped = clock_key(str(clock.path[-1]), column, with_exchanged(form))
            message = (
                f"dates run backwards ({where}), and with day and month exchanged they are in order: {swapped}; {stand}"
            )
        told = {
            signal.block.faults.over(self._block.faults).backwards
            for signal in signals
            if any(part.file == file and clock in (part.time, part.available) for part in signal.parts)
        }
        if not told <= {"sort", "drop"}:
            raise Problem(clock.path, message)
        key = ".".join(map(str, clock.path))
        self.notes.append(Note(kind="clock", signal=key, file=str(file.path), message=message))

    def _first_stamp(self, file: LogFile, clock: ClockColumn) -> str:
        """Where the first date of a column stands."""
        there = self._stamps[file, clock] != NAT
        return f"{clock.cells.column} in {file.path}, line {self._tables[file].lines[int(there.argmax())]},"

    def _unit_of_clock(self, file: LogFile, clock: ClockColumn) -> Iterator[Note]:
        """What a file says of the unit of its stamps, where it is another one than the run's.

        Raises
        ------
        Problem
            When the configuration does not say which of the two is right.
        """
        column, key = clock.cells.column, ".".join(map(str, clock.path))
        for told in odd_numbers(clock, self._tables[file], self._unit):
            yield Note(kind="clock", signal=key, file=str(file.path), message=told)
        said, source = file.table.unit(column).partition(" since ")[0], "the file"
        if not said:
            said, source = time_in_name(column), "its name"
        taken = clock.clock.unit or self._unit
        if not said or clock.absolute or alike_times(said, taken):
            return
        another = AnotherUnit(
            column=column,
            file=str(file.path),
            source=source,
            found=said,
            wanted=taken,
            said=clock.clock.unit,
            who="the run counts in",
            beside=self._around,
        )
        of_run = f", and time.unit: {said} is right for a model in {said}" if not has_factor(said) else ""
        yield note_of(another, "clock", key, clock.path, of_run)

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

    def _to_times(
        self, signals: Sequence[Wanted], epoch: int | None
    ) -> Iterator[tuple[tuple[LogFile, ClockColumn], np.ndarray]]:
        """Dates become times since the origin; numbers count from there already."""
        for file, clock in dict.fromkeys(self._clocks(signals)):
            found = self._stamps[file, clock]
            if clock.absolute:
                assert epoch is not None
                require_near({(file, clock): found}, self._tables, epoch)
                found = times_since(found, epoch, self._unit)
            yield (file, clock), found
