"""Numbers without a format that are dates by their size: of Unix, or days of a workbook."""

from __future__ import annotations

import numpy as np

from hgorun.data.times.day_counts import DAY, UNITS, WORKBOOKS, day_of, of_our_days
from hgorun.pieces import median

_YEAR = 365.25 * DAY
_LONGEST = 200  # years for which nothing has counted
_LOOKED_AT = 1000
_FEWEST, _FEWEST_SECONDS = 3, 5  # numbers that are whole minutes, or seconds, of a day by more than chance
_SINCE = np.datetime64("2000-01-01", "ns").astype(np.int64)  # earlier ones are hours, days or minutes of something else
# Of numbers with five decimals, as a workbook shows them, and of those with six.
_OF_A_MINUTE, _OF_A_SECOND = 0.01, 0.05
_ROUND = (1 / 0.005, 60)  # steps of clocks that count in seconds or hours: decimals, and pictures of a camera


def is_too_long(first: float, unit: float) -> bool:
    """Whether nothing has counted for so long as a first number says in its unit, in nanoseconds."""
    return first * unit > _LONGEST * _YEAR


def unix_unit(first: float, now: int) -> tuple[str, str] | None:
    """In which unit a first number would be a date of our days that is not after today.

    Parameters
    ----------
    first : float
    now : int
        In nanoseconds since 1970.

    Returns
    -------
    (str, str) or None
        The unit, and the date.
    """
    dates = {name: first * size for name, size in UNITS.items()}
    usual = (name for name, date in dates.items() if of_our_days(date) and date <= now + 2 * DAY)
    return next(((name, day_of(dates[name])) for name in usual), None)


def first_day(values: np.ndarray, unit: float, now: int, before: float = 0.0) -> str | None:
    """The first date of numbers that are days of a workbook, or others, by all signs; None of others.

    They are between 2000 and now, a step is less than one, and all are whole minutes or seconds of a day. Seconds or
    hours of that size that a device counts are decimals of few digits, or those of a camera: they are no such days.

    Parameters
    ----------
    values : ndarray
        Rising; none is missing.
    unit : float
        In which they would be taken, in nanoseconds; nothing is wrong with days.
    now : int
        In nanoseconds since 1970.
    before : float
        What is taken from them to make days of a workbook.
    """
    some = values[:: max(1, values.size // _LOOKED_AT)]
    if unit == DAY or some.size < _FEWEST:
        return None
    first, last = ((float(end) - before) * DAY + WORKBOOKS["excel"] for end in (some.min(), some.max()))
    if not (first >= _SINCE and last <= now + 2 * DAY) or not 0 < median(np.diff(values[:_LOOKED_AT])) < 1:
        return None
    if any(_whole(some * parts, 1e-3) for parts in _ROUND):
        return None
    minutes = _whole(some * 1_440, _OF_A_MINUTE)
    if minutes or (some.size >= _FEWEST_SECONDS and _whole(some * 86_400, _OF_A_SECOND)):
        return day_of(first)
    return None


def millionths_of_days(values: np.ndarray, now: int) -> str | None:
    """The first date of whole numbers that are millionths of days of a workbook by all signs; None of others.

    All are whole seconds between 2000 and now, and the steps are not all equal, as those of whole seconds are not in
    millionths of days: what counts evenly counts something else.

    Parameters
    ----------
    values : ndarray
        None is missing.
    now : int
        In nanoseconds since 1970.
    """
    some = values[:_LOOKED_AT]
    steps = np.diff(some)
    if some.size < _FEWEST_SECONDS or not np.all(some == np.floor(some)) or not steps.max() > steps.min() >= 0:
        return None
    first, last = (float(end) * DAY / 1e6 + WORKBOOKS["excel"] for end in (some[0], some[-1]))
    if not (first >= _SINCE and last <= now + 2 * DAY) or not _whole(some * 0.0864, _OF_A_SECOND):
        return None
    return day_of(first)


def _whole(values: np.ndarray, apart: float) -> bool:
    return bool(np.all(np.abs(values - np.rint(values)) < apart))
