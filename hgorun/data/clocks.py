"""Time stamps of any form as times in the unit of the run."""

from __future__ import annotations

import time
from collections.abc import Set
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hgorun.config.data import Clock
from hgorun.data.cells import Cells, Numbers, Stamps
from hgorun.data.recording import Origin
from hgorun.data.table import Table, TableFile
from hgorun.data.times.date_texts import iso_stamp, looks_like_iso
from hgorun.data.times.dates import NAT, counted
from hgorun.data.times.day_counts import (
    DAY,
    WORKBOOKS,
    out_of_range,
)
from hgorun.data.units.units import scaled, seconds
from hgorun.errors import ConfigError, KeyPath, Problem

_COUNTED = ("unix", *WORKBOOKS)  # formats of numbers that are dates


@dataclass(frozen=True)
class ClockColumn:
    """A column of time stamps in a file.

    Attributes
    ----------
    cells : Cells
    clock : Clock
    path : tuple
        Its key.
    """

    cells: Cells
    clock: Clock
    path: KeyPath

    @property
    def absolute(self) -> bool:
        """Whether its stamps are dates."""
        return isinstance(self.cells, Stamps) or self.clock.format in _COUNTED

    @property
    def zones(self) -> set[bool]:
        """Whether its dates have a time zone: numbers since 1970 count in UTC, days of workbooks in none."""
        return self.cells.zoned if isinstance(self.cells, Stamps) else {self.clock.format == "unix"}


def clock_column(clock: Clock, file: TableFile, path: KeyPath) -> ClockColumn:
    """How a column of time stamps is read: a column of dates is known by its first one."""
    form, key = clock.format, str(path[-1])
    cells: Cells
    if form in _COUNTED:
        cells = Numbers(clock.column, key)
    elif form is not None:
        cells = Stamps(clock.column, None if form == "iso" else form, key)
    elif looks_like_iso(file.sample(clock.column)) or (clock.unit is None and file.counts_from_a_date(clock.column)):
        cells = Stamps(clock.column, key=key)
    else:
        cells = Numbers(clock.column, key)
    return ClockColumn(cells, clock, path)


def beside(clock: Clock, time: Clock, file: TableFile) -> Clock:
    """A clock in the same file as another: written as that one is, where neither its key nor its column says else."""
    if clock.format is not None or clock.unit is not None or looks_like_iso(file.sample(clock.column)):
        return clock
    return clock.model_copy(update={"format": time.format, "unit": time.unit, "next_day": time.next_day})


def stamps(column: ClockColumn, table: Table, unit: str) -> np.ndarray:
    """Times of a table: floats in the unit of the run, or, of dates, integers in nanoseconds since 1970.

    Missing ones are NaN or ``NAT``.

    Raises
    ------
    Problem
        When a unit is not a unit of time.
    ConfigError
        For the first date out of range.
    """
    values = table.columns[column.cells]
    if isinstance(column.cells, Stamps):
        return values
    said = column.clock.unit
    if column.clock.format in WORKBOOKS:
        return _nanoseconds(values, DAY, WORKBOOKS[column.clock.format], table, column)
    if column.clock.format == "unix":
        return _nanoseconds(values, int(seconds(said or "s", (*column.path, "unit")) * 10**9), 0, table, column)
    if said is None or said == unit:
        return values
    return scaled(values, seconds(said, (*column.path, "unit")) / seconds(unit, ("time", "unit")))


def _nanoseconds(values: np.ndarray, unit: int, start: int, table: Table, column: ClockColumn) -> np.ndarray:
    """Dates from numbers of units since some start."""
    found, wrong = counted(values, unit, start)
    if wrong is None and column.clock.format in WORKBOOKS and np.any(before := values < 0):
        wrong = int(before.argmax())
    if wrong is not None:
        message = out_of_range(float(values[wrong]), column.clock.format, time.time_ns())
        raise ConfigError(message, file=str(table.path), line=int(table.lines[wrong]), key=column.cells.column)
    return found


def origin_stamp(said: str | float, clock: ClockColumn, zones: Set[bool]) -> int:
    """The date that is stated as the origin: as text, or as stamps of a clock are written.

    Parameters
    ----------
    said : str or float
    clock : ClockColumn
    zones : set of bool
        Whether the stamps have a time zone.

    Raises
    ------
    Problem
        Also where the stamps have a time zone and the origin has none, or the reverse.
    """
    path = ("data", "origin")
    if isinstance(said, str):
        text = said.strip()
        try:
            found, zoned = iso_stamp(text, lambda _: "; write the year first, then the month")
        except ValueError as error:
            raise Problem(path, str(error)) from None
        if zones and zoned not in zones:
            raise Problem(path, _of_another_clock(text, zoned=zoned))
        return found
    if clock.clock.format not in _COUNTED:
        raise Problem(path, f"expected a date such as 2024-05-31T13:45, found {said:g}")
    table = Table(Path(), np.zeros(1, dtype=np.int32), {clock.cells: np.array([said])})
    try:
        return int(stamps(clock, table, "s")[0])
    except ConfigError as error:
        raise Problem(path, error.message) from None


def _of_another_clock(text: str, *, zoned: bool) -> str:
    """What is wrong with an origin that alone has a time zone, or alone has none, and what to write."""
    if not zoned:
        right = f"{text}Z" if len(text) > len("2024-05-31") else f"{text}T00:00Z"
        return (
            f"the stamps have a time zone, and the origin has none: {right} is one in UTC, and with +02:00 in place of "
            "Z on a clock two hours ahead"
        )
    return (
        "the origin has a time zone, and the stamps have none: write it without, as the time that clocks showed where "
        "the log was made"
    )


def shown(time: float, origin: Origin, unit: str = "") -> str:
    """A time as a message says it, with its unit, and the date that stands in the file where times are dates.

    Parameters
    ----------
    time : float
        In the unit of the run.
    origin : Origin
    unit : str
        In which it is said, as it stands in a file of numbers; that of the run if empty.
    """
    text = duration_shown(time, origin, unit)
    if origin.epoch is None:
        return text
    date = origin.epoch + np.timedelta64(round(time * float(seconds(origin.unit, ("time", "unit"))) * 1e6), "us")
    return f"{text} ({str(date.astype('datetime64[us]')).removesuffix('.000000')}{'Z' if origin.zone else ''})"


def duration_shown(time: float, origin: Origin, unit: str = "", digits: int = 9) -> str:
    """How long something takes, with its unit; arguments as of :func:`shown`."""
    said = unit or origin.unit
    if said != origin.unit:
        time *= float(seconds(origin.unit, ("time", "unit")) / seconds(said, ("time", "unit")))
    return f"{time:.{digits}g} {said}"


def times_since(found: np.ndarray, epoch: int, unit: str) -> np.ndarray:
    """Times from dates; missing ones are NaN."""
    since = scaled((found - epoch).astype(float), 1 / (seconds(unit, ("time", "unit")) * 10**9))
    return np.where(found == NAT, np.nan, since)


def origin(unit: str, epoch: int | None, zoned: bool) -> Origin:
    """What times are counted from."""
    if epoch is None:
        return Origin(unit=unit)
    return Origin(unit=unit, epoch=np.datetime64(epoch, "ns"), zone="UTC" if zoned else "")
