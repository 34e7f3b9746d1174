"""Dates that are counted in days by a workbook, and those that cannot be meant.

Excel counts from 1899-12-30 (so that its days from March 1900 on are right), and from 1904-01-01 where the workbook
says so, as those of old Macs do. A sheet that was saved as text does not say which: the two are 1462 days apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import datetime
from typing import TypeAlias, TypeVar

import numpy as np

from hgorun.data.times.dates import NAT
from hgorun.pieces import median

DAY = 86_400 * 10**9
"""In nanoseconds."""
WORKBOOKS = {"excel": -25_569 * DAY, "excel1904": -24_107 * DAY}
"""Day 0 of each format, in nanoseconds since 1970."""

_IN_DIGITS = {7: "%Y%j", 8: "%Y%m%d", 10: "%Y%m%d%H", 12: "%Y%m%d%H%M", 14: "%Y%m%d%H%M%S", 17: "%Y%m%d%H%M%S%f"}
_OF_SHORT_YEARS = {9: "%y%j%H%M", 10: "%y%m%d%H%M", 11: "%y%j%H%M%S", 12: "%y%m%d%H%M%S"}
_OF_FEW = ("%Y%j", "%y%j%H%M")  # digits, which are no seconds since 1970 of our days
_LOOKED_AT = 1000
_DECIMALS = range(2, 8)  # of days: fewer are hours at the least, and more are parts of a second
_FINE = 100  # parts of which a step is one at the least where decimals are enough
_MOST = 0.8  # of all steps
_FEWEST = 3  # numbers that are dates by more than chance
_OTHER = {"excel": "excel1904", "excel1904": "excel"}
UNITS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1, "min": 60 * 10**9, "h": 3600 * 10**9}
"""That are counted in since 1970."""
_USUAL = np.array(["1980-01-01", "2100-01-01"], dtype="datetime64[ns]").astype(np.int64).tolist()
_RIGHT = np.datetime64("1900-03-01", "ns").astype(np.int64)  # before it Excel's own days are off by one

_SINCE = np.datetime64("2000-01-01", "ns").astype(np.int64)
_STARTS = {
    (10**9, 2_082_844_800): "in s from 1904-01-01, as LabVIEW counts,",
    (100, 11_644_473_600): "in 100 ns from 1601-01-01, as Windows counts,",
    (100, 62_135_596_800): "in 100 ns from 0001-01-01, as .NET counts,",
}
"""By what is counted, in nanoseconds, and the seconds from there to 1970."""
OTHER_DAYS = {"in days of MATLAB (datenum)": 693_960.0, "in Julian days": 2_415_018.5}
"""What is taken from days that no workbook counts to make days of a workbook."""

Span: TypeAlias = tuple[int, int]
"""The first and the last of some dates, in nanoseconds since 1970."""
Place = TypeVar("Place")


def span_of(stamps: np.ndarray) -> Span | None:
    """Of dates of which some may be missing; None where all are."""
    there = stamps[stamps != NAT]
    return (int(there.min()), int(there.max())) if there.size else None


def out_of_range(value: float, form: str | None, now: int) -> str:
    """That a number is no date of a format, and what it would be in another one.

    Parameters
    ----------
    value : float
    form : str or None
    now : int
        In nanoseconds since 1970.
    """
    if form in WORKBOOKS:
        expected, unix = "a day of a workbook, 0 or more, before 2262", "format: unix, "
        moments = ((of, n, (value - n) * DAY + WORKBOOKS["excel"]) for of, n in OTHER_DAYS.items())
        hints = [
            f"{of} it would be {day_of(moment)}: {days_of_workbooks(n)}"
            for of, n, moment in moments
            if _SINCE <= moment <= now + 2 * DAY
        ]
    else:
        expected, unix = "a date between 1678 and 2262", ""
        hints = [f"{of} it would be {day}: {how}" for day, of, how in other_starts(value, now)]
    dates = {unit: value * size for unit, size in UNITS.items()}
    hints += [f"with {unix}unit: {u} it would be {day_of(date)}" for u, date in dates.items() if of_our_days(date)]
    return f"expected {expected}, found {value:g}{''.join(f'; {hint}' for hint in hints[:1])}"


def odd_days(form: str, span: Span, now: int) -> str | None:
    """What is to be told of the dates of a workbook that are before all that it counts rightly, or after today.

    Parameters
    ----------
    form : str
    span : (int, int)
    now : int
        In nanoseconds since 1970.
    """
    first, last = span
    if first < _RIGHT:
        return f"the first date is {day_of(first)}: days as small as that are times of day, durations or wrong"
    if last <= now + 2 * DAY:
        return None
    other = _OTHER[form]
    earlier = last - WORKBOOKS[form] + WORKBOOKS[other]
    hint = f"; with format: {other} it would be {day_of(earlier)}" if earlier < last else ""
    return f"the last date is {day_of(last)}, after today{hint}"


def odd_seconds(unit: int, span: Span, now: int, *, said: bool) -> str | None:
    """What is to be told of dates in numbers since 1970 that are after today, or not of our days but in another unit.

    Parameters
    ----------
    unit : int
        In nanoseconds.
    span : (int, int)
    now : int
        In nanoseconds since 1970.
    said : bool
        Whether the configuration has it: days of a workbook have none.
    """
    first, last = (end / unit for end in span)
    if (
        unit == 1 and (found := next(other_starts(last, now), None)) is not None
    ):  # a year of .NET's is one month of 1990
        return f"the last date is {day_of(span[1])}; {found[1]} it would be {found[0]}: {found[2]}"
    if of_our_days(*span):
        hint = "".join(f"; {of} it would be {day}: {how}" for day, of, how in other_starts(last, now, unit))
        return f"the last date is {day_of(span[1])}, after today{hint}" if span[1] > now + 2 * DAY else None
    rest = " and no unit" if said else ""
    read = {f"unit: {name}": (size, 0) for name, size in UNITS.items()} | {
        f"format: excel{rest}": (DAY, WORKBOOKS["excel"]),
        "unit: d": (DAY, 0),  # behind days of a workbook: these are as large in 2050
    }
    for how, (size, start) in read.items():
        if of_our_days(first * size + start, last * size + start):
            return f"the first date is {day_of(span[0])}; with {how} it would be {day_of(first * size + start)}"
    return None


def four_years_apart(spans: Mapping[Place, tuple[Span, str]]) -> Iterator[tuple[Place, str]]:
    """Clocks of workbooks that share no time with the others, and would with the other day 0; and what is wrong.

    Parameters
    ----------
    spans : mapping of Place to ((int, int), str)
        The dates and the format of every clock.
    """
    for place, ((first, last), form) in spans.items():
        others = [span for span, other in spans.values() if other != form]
        if form not in WORKBOOKS or not others:
            continue
        start, stop = min(span[0] for span in others), max(span[1] for span in others)
        moved = WORKBOOKS[_OTHER[form]] - WORKBOOKS[form]
        if (last < start or first > stop) and last + moved >= start and first + moved <= stop:
            yield (
                place,
                f"the dates begin on {day_of(first)}, those of the other clocks on {day_of(start)}; with "
                f"format: {_OTHER[form]} they would begin on {day_of(first + moved)}. If they are right, write them "
                "as ISO 8601 dates",
            )


def other_starts(number: float, now: int, unit: int | None = None) -> Iterator[tuple[str, str, str]]:
    """What numbers may count from that is neither 1970 nor the day of a workbook, where they are of the last decades.

    Parameters
    ----------
    number : float
    now : int
        In nanoseconds since 1970.
    unit : int, optional
        The nanoseconds in which it is known to count.

    Returns
    -------
    iterator of (str, str, str)
        A date, what it counts and from when, and what makes numbers of Unix time of such.
    """
    for (size, start), of in _STARTS.items():
        moment = number * size - start * UNITS["s"]
        if unit in (None, size) and _SINCE <= moment <= now + 2 * DAY:
            parts = "n" if size == UNITS["s"] else f"n / {UNITS['s'] // size}"
            yield day_of(moment), of, f"write {parts} - {start} in place of each number n into the file"


def days_of_workbooks(before: float) -> str:
    """What makes days of a workbook of days that begin so many before those."""
    return f"write n - {before:.10g} in place of each number n into the file"


def of_our_days(*nanoseconds: float) -> bool:
    """Whether dates, in nanoseconds since 1970, are between 1980 and 2100."""
    return all(_USUAL[0] <= one < _USUAL[1] for one in nanoseconds)


def day_of(nanoseconds: float) -> str:
    """A date, in nanoseconds since 1970, without its time of day."""
    return str(np.datetime64(round(nanoseconds), "ns").astype("datetime64[D]"))


def _stamp(date: datetime) -> int:
    return int(np.datetime64(date, "ns").astype(np.int64))


def dates_in_digits(values: np.ndarray, now: int) -> str | None:
    """The pattern of numbers whose digits are dates, as 20240131 and 240131235959 are; None of others.

    Of long columns, in which none is missing, some are looked at. A counter comes to a number that is no date after a
    few steps. Years of two digits, or of few digits in all, are those from 2000 to now, of numbers that rise and are no
    seconds since 1970.
    """
    some = values[:: max(1, values.size // _LOOKED_AT)]
    if some.size < _FEWEST or not np.all((some > 0) & (some < 1e17)):
        return None
    texts = [f"{value:.0f}" for value in np.floor(some).tolist()]
    short = not all(text[:2] in ("19", "20") for text in texts)
    pattern = (_OF_SHORT_YEARS if short else _IN_DIGITS).get(len(texts[0]))
    fine = bool(np.any(some != np.floor(some)))
    if pattern is None or {*map(len, texts)} != {len(texts[0])} or (fine and not pattern.endswith("%S")):
        return None
    whole = pattern.removesuffix("%f")
    if whole != pattern:  # doubles of 17 digits are rounded, so that the last millisecond may be of the next second
        texts = [text[:12] + min(text[12:14], "59") for text in texts]
    try:
        dates = [datetime.strptime(text, whole) for text in texts]
    except ValueError:
        return None
    if (short or pattern in _OF_FEW) and not (
        _stamp(dates[0]) >= _SINCE + (366 * DAY if pattern == "%Y%j" else 0)  # two million of something are usual
        and _stamp(dates[-1]) <= now + 2 * DAY
        and np.all(np.diff(some) > 0)
        and (some[0] * UNITS["s"] > now or pattern in _OF_FEW)
    ):
        return None
    return f"{pattern}.%f" if fine else pattern


def decimals_cut(days: np.ndarray) -> tuple[int, float] | None:
    """Days of a workbook that have too few decimals for their steps, as a sheet shows them.

    Their steps are few of the last decimal, and most are one more or less than others; or they are one or two.

    Parameters
    ----------
    days : ndarray
        None is missing.

    Returns
    -------
    (int, float) or None
        How many decimals they have, and their usual step.
    """
    some = days[:_LOOKED_AT]
    if some.size < _FEWEST:
        return None
    for digits in _DECIMALS:
        parts = some * 10.0**digits
        if np.all(np.abs(parts - np.rint(parts)) < 1e-3):
            steps = np.diff(np.rint(parts))
            usual = median(steps)
            beside = np.abs(steps - usual) == 1
            uneven = beside.any() and np.mean(beside | (steps == usual)) > _MOST
            return (digits, usual / 10.0**digits) if 0 < usual < _FINE and (usual <= 2 or uneven) else None
    return None
