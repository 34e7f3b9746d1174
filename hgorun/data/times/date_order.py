"""Whether dates that run backwards are in order when read otherwise: day and month exchanged, or days counted."""

from __future__ import annotations

import numpy as np

from hgorun.data.times.dates import NAT
from hgorun.data.times.day_counts import DAY
from hgorun.data.times.time_steps import unevenness
from hgorun.pieces import distinct, median

_HOUR = 3600 * 10**9  # nanoseconds
_MONTHS = 12
_TIMES = 3  # what is usual
_MOST = 2  # steps backwards that one time can make
_CLEARLY = 2.0  # times as evenly
_FEWEST = 3  # different dates that are in order by more than chance


def days_counted(found: np.ndarray, before: int | None = None) -> np.ndarray:
    """Times of day of which each that lies more than half a day before the one above it is of the next day.

    One within an hour before midnight, after it has passed, is of the day before: clocks jitter.

    Parameters
    ----------
    found : ndarray
        Nanoseconds, ``NAT`` where one is missing.
    before : int, optional
        The time with its day that stands above the first one.
    """
    there = found != NAT
    if not there.any():
        return found
    stamps = found[there]
    before = int(stamps[0]) if before is None else before
    of_day = stamps % DAY
    steps = np.diff(of_day, prepend=before % DAY)
    days = before // DAY + np.cumsum((steps < -DAY // 2).astype(int) - (steps > DAY - _HOUR))
    counted = found.copy()
    counted[there] = days * DAY + of_day
    return counted


def unlike_others(counted: np.ndarray) -> tuple[int, int] | None:
    """The longest time between two, where it may be longer by whole days: what ends it, and how long it is.

    Times of day say nothing of whole days, so that any gap may be longer. That is likely of none in a log without
    holes, whose times are no more than an hour apart and no further than three times as far as usual: None there.
    A gap that passes midnight and ends more than an hour before the time of day at which it began is as long as that,
    too, though its day is not counted where it is of half a day or more.
    """
    there = np.flatnonzero(counted != NAT)
    if there.size < _FEWEST - 1:
        return None
    gaps = np.diff(counted[there])
    gaps = np.where(gaps < -_HOUR, gaps + DAY, np.maximum(gaps, 0))
    k = int(gaps.argmax())
    longest, usual = int(gaps[k]), median(gaps)
    alone = gaps.size > 1 and longest > _TIMES * usual
    return (int(there[k + 1]), longest) if alone or longest > _HOUR else None


def known_after(known: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """Times of day within a day after other times, whose days are counted; those within an hour before are wrong."""
    there = (known != NAT) & (taken != NAT)
    counted = known.copy()
    later = (known[there] - taken[there]) % DAY
    counted[there] = taken[there] + later - DAY * (later > DAY - _HOUR)
    return counted


def a_day_too_early(known: np.ndarray, taken: np.ndarray) -> int | None:
    """The first sample that may be known a day later than :func:`known_after` has it; None where none looks so.

    It is known before the sample above it, and a day later its delay would be more like the delay of that one.
    Delays of more than a day throughout look like shorter ones.
    """
    there = np.flatnonzero((known != NAT) & (taken != NAT))
    late = known[there] - taken[there]
    fewer = (np.diff(known[there]) < 0) & (np.diff(late) < -DAY // 2)
    return int(there[fewer.argmax() + 1]) if fewer.any() else None


def passes_midnight(found: np.ndarray) -> int | None:
    """The first time of day that lies more than half a day before the one above it; None where none does."""
    there = np.flatnonzero(found != NAT)
    back = np.flatnonzero(np.diff(found[there]) < -DAY // 2)
    return int(there[back[0] + 1]) if back.size else None


def exchanged(found: np.ndarray) -> int | None:
    """Of dates that are in order only with day and month exchanged, the first that lies before the one above it.

    None where they are in order as they are, cannot be read otherwise, or are not in order then either; also where one
    alone is out of order, and the others are more evenly spaced as they are.
    """
    there = np.flatnonzero(found != NAT)
    stamps = found[there]
    back = np.flatnonzero(np.diff(stamps) < 0)
    if not back.size:
        return None
    dates = stamps // DAY
    if distinct(dates).size < _FEWEST:
        return None
    as_days = dates.astype("datetime64[D]")
    months = as_days.astype("datetime64[M]")
    day = (as_days - months.astype("datetime64[D]")).astype(int) + 1
    if day.max() > _MONTHS:
        return None
    years = months.astype("datetime64[Y]")
    month = (months - years.astype("datetime64[M]")).astype(int) + 1
    turned = (years.astype("datetime64[M]") + (day - 1)).astype("datetime64[D]") + (month - 1)
    other = turned.astype(int) * DAY + stamps % DAY
    if np.any(np.diff(other) < 0) or _is_mistyped(stamps, other):
        return None
    return int(there[back[0] + 1])


def out_of_order(times: np.ndarray) -> list[int]:
    """Those of some times without which, one alone, the others increase; there are several where two are exchanged."""
    back = np.flatnonzero(np.diff(times) <= 0)
    places = {int(k) + side for k in back for side in (0, 1)} if 0 < back.size <= _MOST else set()
    return sorted(k for k in places if np.all(np.diff(np.delete(times, k)) > 0))


def _is_mistyped(stamps: np.ndarray, other: np.ndarray) -> bool:
    """Whether one stamp alone is out of order, and the others are more evenly spaced than in another reading."""
    return any(
        _CLEARLY * unevenness(np.delete(stamps, k)) < unevenness(np.delete(other, k)) for k in out_of_order(stamps)
    )
