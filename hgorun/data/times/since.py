"""Numbers that count from a date, as in netCDF: ``minutes since 2024-01-01 12:00``, by the CF conventions."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from hgorun.config.types import describe

_FORM = re.compile(r"\s*[\[({]?(\S+)\s+since\s+(.*?)\s*[\])}]?\s*", re.IGNORECASE)
_DATE = re.compile(
    r"(\d{1,4})-(\d{1,2})-(\d{1,2})"
    r"(?:(?:\s+|T)(\d{1,2})(?::(\d{1,2})(?::(\d{1,2})(?:\.(\d{1,9})\d*)?)?)?)?"
    r"(?:\s*(Z|UTC|GMT)|\s*([-+])(\d{1,2})(?::?(\d{2}))?)?",
    re.ASCII | re.IGNORECASE,
)
_UNITS: dict[str, tuple[int, tuple[str, ...]]] = {
    "ns": (1, ("nanosecond", "nanosec", "nsec")),
    "us": (10**3, ("microsecond", "microsec", "usec", "\u00b5s", "\u03bcs")),
    "ms": (10**6, ("millisecond", "millisec", "msec")),
    "s": (10**9, ("second", "sec")),
    "min": (60 * 10**9, ("minute", "min")),
    "h": (3600 * 10**9, ("hour", "hr")),
    "d": (86400 * 10**9, ("day",)),
    "week": (7 * 86400 * 10**9, ("week",)),
}


def _spelt(unit: str, names: Sequence[str]) -> set[str]:
    """How a unit may be written."""
    return {unit, *(name + end for name in names for end in ("", "s"))}


_NANOSECONDS = {spelt: size for unit, (size, names) in _UNITS.items() for spelt in _spelt(unit, names)}
_OF_UNIX = ("epoch", "unix epoch", "the epoch", "1970")
_CALENDARS = ("standard", "gregorian", "proleptic_gregorian")
_EPOCH = datetime(1970, 1, 1)
_REFORM = datetime(1582, 10, 15)


@dataclass(frozen=True)
class Since:
    """What numbers of a column count.

    Attributes
    ----------
    unit : int
        Nanoseconds.
    start : int
        Nanoseconds since 1970, in UTC where a time zone is named.
    zoned : bool
        Whether one is.
    """

    unit: int
    start: int
    zoned: bool


def counts_from_a_date(unit: str) -> bool:
    """Whether the unit of a column has the form ``... since ...``."""
    return _FORM.fullmatch(unit) is not None


def own_unit(unit: str) -> str:
    """What makes times of their own of numbers that count from a date: their unit, or the format of Unix.

    Returns
    -------
    str
        Keys, such as ``unit: h``; empty where the unit is not known.
    """
    match = _FORM.fullmatch(unit)
    said, date = ("", "") if match is None else match.groups()
    found = next((key for key, (_, names) in _UNITS.items() if said.lower() in _spelt(key, names)), "")
    if found and date.lower() in _OF_UNIX:
        return "format: unix" if found == "s" else f"format: unix, unit: {found}"
    return found and f"unit: {found}"


def since(unit: str, calendar: str) -> Since:
    """What the numbers of a column count.

    Raises
    ------
    ValueError
        When dates cannot be told from the unit, or not by this calendar.
    """
    match = _FORM.fullmatch(unit)
    assert match is not None
    said, date = match.groups()
    size = _NANOSECONDS.get(said.lower())
    if size is None:
        raise ValueError(f"counts in {describe(said)}, which has no fixed length or is not known")
    if (calendar.strip().lower() or "standard") not in _CALENDARS:
        raise ValueError(f"the calendar {describe(calendar)} is not that of dates; known: {', '.join(_CALENDARS)}")
    found = _DATE.fullmatch(date)
    if found is None:
        raise ValueError(f"expected units such as {said} since 2024-05-31 13:45:10, found {describe(unit)}")
    year, month, day, hour, minute, second, digits, utc, sign, hours, minutes = found.groups()
    try:
        moment = datetime(int(year), int(month), int(day), int(hour or 0), int(minute or 0), int(second or 0))
    except ValueError as error:
        raise ValueError(f"units {describe(unit)}: {error}") from None
    if moment < _REFORM and calendar.strip().lower() != "proleptic_gregorian":
        raise ValueError(f"units {describe(unit)}: before 1582-10-15 this calendar is Julian, which is not read")
    if int(hours or 0) > 23 or int(minutes or 0) > 59:
        raise ValueError(f"units {describe(unit)}: this is not a time zone")
    ahead = (int(hours or 0) * 60 + int(minutes or 0)) * (-1 if sign == "-" else 1)
    past = moment - _EPOCH
    start = (past.days * 86400 + past.seconds - 60 * ahead) * 10**9 + int((digits or "0").ljust(9, "0"))
    return Since(size, start, bool(utc or sign))
