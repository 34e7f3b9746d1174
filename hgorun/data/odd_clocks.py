"""What is told of clocks whose stamps cannot be meant as they are read, or are rounded."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from hgorun.config.data import has_date
from hgorun.config.time_units import without_length
from hgorun.data.cells import Cells, Numbers, Stamps
from hgorun.data.clocks import ClockColumn
from hgorun.data.table import Table
from hgorun.data.times.date_hints import clock_key
from hgorun.data.times.dates import NAT
from hgorun.data.times.day_counts import (
    DAY,
    OTHER_DAYS,
    WORKBOOKS,
    Span,
    dates_in_digits,
    days_of_workbooks,
    decimals_cut,
    odd_days,
    odd_seconds,
    other_starts,
)
from hgorun.data.times.number_clocks import clock_in_digits
from hgorun.data.times.undeclared_dates import first_day, is_too_long, millionths_of_days, unix_unit
from hgorun.data.units.units import seconds
from hgorun.pieces import median, present

EXACT = "numbers that count from the first one, or dates as text, are exact"
"""What is said of stamps that doubles round."""
IN_DOUBLE = "double precision, or dates as text, are right for stamps"
"""The same of single precision."""
_FIRST = 100_000  # stamps that show whether all are whole numbers
_WHOLE = 2.0**53  # up to which all whole numbers are doubles
_ROUNDED = 1e-3  # of a step: what rounding may move stamps by
_ROUNDED_SINGLE = 1e-2  # the same where a file has few digits, as of logs of 100 Hz and 20 min


def odd_dates(column: ClockColumn, span: Span) -> str | None:
    """What is to be told of dates in numbers that cannot be meant."""
    form = column.clock.format
    if form in WORKBOOKS:
        told = odd_days(form, span, time.time_ns())
    elif form == "unix":
        unit = column.clock.unit
        told = odd_seconds(int(seconds(unit or "s", ()) * 10**9), span, time.time_ns(), said=unit is not None)
    elif form is not None and not has_date(form) and not column.clock.next_day and span[1] - span[0] < DAY:
        told = f"the pattern {form} has no date: all times are taken to be of one day"
    elif form is not None and not has_date(form) and "%H" in form and "%S" not in form and not column.clock.next_day:
        shorter = form.replace("%M", "%S").replace("%H", "%M")
        told = f"the pattern {form} reads hours beyond 24: for minutes and seconds the format is {shorter}"
    else:
        return None
    return told and f"column {column.cells.column!r}: {told}"


def odd_numbers(column: ClockColumn, table: Table, unit: str = "") -> Iterator[str]:
    """What is to be told of numbers that look like dates, or are so large that doubles round their steps.

    Parameters
    ----------
    column : ClockColumn
    table : Table
    unit : str
        Of the run.
    """
    if isinstance(column.cells, Numbers):
        yield from _as_numbers(column, table, unit)
    yield from _rounded(column, table)


def _as_numbers(column: ClockColumn, table: Table, unit: str) -> Iterator[str]:
    """What is to be told of numbers that look like dates."""
    name, values = column.cells.column, present(table.columns[column.cells])
    pattern = dates_in_digits(values, time.time_ns()) if not column.absolute and column.clock.unit is None else None
    if pattern is not None:
        yield (
            f"column {name!r}: its numbers look like dates, and are taken as numbers: if they are dates, "
            f"{clock_key(str(column.path[-1]), name, pattern)}"
        )
    elif not column.absolute and column.clock.unit is None and (found := clock_in_digits(values)) is not None:
        keys = (
            f"{clock_key(str(column.path[-1]), name, form)} if they are {of}" for of, form in found.patterns.items()
        )
        yield (
            f"column {name!r}: its numbers look like times, since {found.before:.10g} is followed by "
            f"{found.behind:.10g}, and are taken as numbers: {', '.join(keys)}"
        )
    elif not column.absolute and column.clock.unit is None and (day := millionths_of_days(values, time.time_ns())):
        yield (
            f"column {name!r}: its numbers look like millionths of days from 1899-12-30 on, as WinCC counts, and would "
            f"begin on {day}: if they are dates, write n / 1000000 in place of each number n into the file, with "
            f"{clock_key(str(column.path[-1]), name, 'excel')}"
        )
    elif not column.absolute:
        yield from _undeclared(column, values, unit)


def _rounded(column: ClockColumn, table: Table) -> Iterator[str]:
    """What is to be told of numbers that are rounded by more than a small part of their step."""
    cells = column.cells
    apart, step = rounding(cells, table)
    if not apart > _ROUNDED * step > 0:
        days = present(table.columns[cells]) if column.clock.format in WORKBOOKS else np.empty(0)
        if (found := decimals_cut(days)) is not None:
            digits, step = found
            yield (
                f"column {cells.column!r}: its days have {digits} decimals, which round times to multiples of "
                f"{86_400 / 10**digits:.3g} s, and a usual step is {86_400 * step:.3g} s: write more decimals, or "
                "dates as text"
            )
        return
    of, rounded = ("numbers of this size", EXACT)
    if cells in table.apart:
        of, rounded = "numbers of this size in single precision", IN_DOUBLE
    in_s = " s" if isinstance(cells, Stamps) else ""
    yield (
        f"column {cells.column!r}: {of} are rounded to multiples of {apart:.3g}{in_s}, and a usual step is "
        f"{step:.3g}{in_s}: {rounded}"
    )


def _undeclared(column: ClockColumn, values: np.ndarray, unit: str) -> Iterator[str]:
    """What is to be told of numbers that are dates by their size, which is not that of times in their unit."""
    name, key, taken = column.cells.column, str(column.path[-1]), column.clock.unit or unit
    if not taken or without_length(taken) or not values.size:
        return
    size = float(seconds(taken, ("time", "unit") if column.clock.unit is None else (*column.path, "unit"))) * 1e9
    first, now = float(values[0]), time.time_ns()
    begins = f"column {name!r}: its numbers are taken in {taken} and begin at {first:.10g}, which would be the date"
    too_long = is_too_long(first, size)
    right = clock_key(key, name, "unix")
    if too_long and (other := next(other_starts(first, now), None)) is not None:
        date, of, how = other
        yield f"{begins} {date}, {of[:-1]}: if they are dates, {how}, with {right}"
    elif too_long and (found := unix_unit(first, now)) is not None:
        since, date = found
        right = right if since == "s" else f"{right[:-1]}, unit: {since}}}"
        yield f"{begins} {date}: if they are dates, {right}"
    elif column.clock.unit is None:
        right = clock_key(key, name, "excel")
        if (day := first_day(values, size, now)) is not None:
            yield f"{begins} {day}: if they are dates, {right}"
        for of, before in OTHER_DAYS.items():
            if (day := first_day(values, size, now, before)) is not None:
                yield f"{begins} {day}, {of}: if they are dates, {days_of_workbooks(before)}, with {right}"


def rounding(cells: Cells, table: Table) -> tuple[float, float]:
    """How far apart doubles are at the end of a column of stamps, and its usual step.

    The first is 0 of whole numbers that all are doubles, and of decimals where that step is much longer. Numbers that
    have single precision in the file are that far apart. Of dates both are in seconds.
    """
    if (apart := table.apart.get(cells)) is not None:
        stamps_ = table.columns[cells][:_FIRST]
        steps = np.diff(stamps_[stamps_ != NAT] * 1e-9 if isinstance(cells, Stamps) else present(stamps_))
        apart *= 1e-9 if isinstance(cells, Stamps) else 1.0
        step = median(steps[steps > 0]) if np.any(steps > 0) else 0.0
        return (apart if not step or apart > _ROUNDED_SINGLE * step else 0.0), step
    if not isinstance(cells, Numbers):
        return 0.0, 0.0
    first, last = table.columns[cells][:_FIRST], np.abs(table.columns[cells][-1:])
    steps = np.diff(first)
    steps = steps[steps > 0]  # of equal stamps nothing is known but that they are
    step = median(steps) if steps.size else 0.0
    whole = bool(np.all((first == np.floor(first)) | np.isnan(first))) and last < _WHOLE
    apart = 0.0 if whole or np.isnan(last).any() else float(np.spacing(last[0]))
    return (apart if last >= _WHOLE or apart > _ROUNDED * step > 0 else 0.0), step
