"""What a text says that is a date: nanoseconds since 1970, of ISO 8601 or of a pattern."""

from __future__ import annotations

import re
from calendar import monthrange
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime, timedelta

from hgorun.config.types import describe
from hgorun.data.times.date_hints import may_be_date
from hgorun.data.times.intervals import TWO_TIMES, ZONE_OFFSETS
from hgorun.data.times.pattern_texts import lacks_digits
from hgorun.data.times.zones import ZONES, date_of, names_zone, nanoseconds_beyond

_ISO = re.compile(
    r"(\d{4})-(\d\d)-(\d\d)(?:[T ](\d\d):(\d\d)(?::(\d\d)(?:[.,](\d{1,9}))?)?)?"
    r"\s?(Z|[-+]\d\d:?\d\d|(?(4)[-+]\d\d|(?!)))?",  # behind a date alone two digits are none of a zone
    re.ASCII,
)
_EPOCH = datetime(1970, 1, 1)
_SECOND = timedelta(seconds=1)
_MONTHS = 12


def looks_like_iso(text: str) -> bool:
    """Whether a text is a date of ISO 8601."""
    return _ISO.fullmatch(text.strip()) is not None


def iso_stamp(text: str, hint: Callable[[str], str] = lambda _: "") -> tuple[int, bool]:
    """Nanoseconds since 1970, in UTC where the text names a zone, and whether it does.

    Parameters
    ----------
    text : str
    hint : callable
        What is said of a date of another form.

    Raises
    ------
    ValueError
    """
    match = _ISO.fullmatch(text)
    if match is None:
        said = f"expected a date such as 2024-05-31T13:45:10.25, found {describe(text)}"
        raise ValueError(said + hint(text) if may_be_date(text) else said)
    year, month, day, hour, minute, second, digits, zone = match.groups()
    if second == "60":
        raise _leap_second(text)
    midnight = hour == "24" and not int(minute or 0) and not int(second or 0) and not int(digits or 0)
    clock = 0 if midnight else int(hour or 0), int(minute or 0), int(second or 0)
    if wrong := _impossible((int(year), int(month), int(day)), clock):
        turned = 1 <= int(day) <= _MONTHS < int(month) <= monthrange(int(year) or 1, int(day))[1]
        raise ValueError(f"{describe(text)}: {wrong}{hint(text) if turned else ''}")
    moment = datetime(int(year), int(month), int(day), *clock)
    seconds = (moment - _EPOCH) // _SECOND - _offset(zone) + 86_400 * midnight  # 24:00 ends the day
    return _in_range(seconds * 10**9 + int((digits or "0").ljust(9, "0")), text), zone is not None


def _leap_second(text: str) -> ValueError:
    return ValueError(f"{describe(text)} is a leap second, which dates here do not count: write the second before it")


def _impossible(date: tuple[int, int, int], clock: tuple[int, int, int]) -> str:
    """What is not in the calendar, or on a clock; empty where all is."""
    year, month, day = date
    if not 1 <= month <= _MONTHS:
        return f"there is no month {month}"
    if year == 0:
        return "there is no year 0"
    days = monthrange(year, month)[1]
    if not 1 <= day <= days:
        return f"there is no day {day} in a month of {days} days"
    for name, value, most in zip(("hour", "minute", "second"), clock, (23, 59, 59), strict=True):
        if value > most:
            return f"there is no {name} {value}: the last is {most}"
    return ""


def _offset(zone: str | None) -> int:
    """Seconds ahead of UTC."""
    if zone is None or zone == "Z":
        return 0
    hours, minutes = int(zone[1:3]), int(zone[3:].lstrip(":") or 0)
    if hours > 23 or minutes > 59:
        raise _no_zone(zone)
    size = hours * 3600 + minutes * 60
    offset = -size if zone[0] == "-" else size
    if offset not in ZONE_OFFSETS:
        raise _no_zone(zone)
    return offset


def _no_zone(zone: str) -> ValueError:
    ahead = "those are -12:00 to +14:00, in steps of 15 min"
    return ValueError(f"{describe(zone)} is not a time zone: {ahead}; {TWO_TIMES}")


def stamp_of(text: str, pattern: str, hint: Callable[[str], str]) -> tuple[int, bool]:
    """The same of a date of a pattern; parameters as of :func:`iso_stamp`.

    Raises
    ------
    ValueError
    """
    try:
        read = date_of(text, pattern)
    except ValueError:
        if _has_leap_second(text, pattern):
            raise _leap_second(text) from None
        said = f"expected a date of the form {pattern}, found {describe(text)}"
        if lacking := lacks_digits(text, pattern):
            raise ValueError(said + lacking) from None
        if names_zone(pattern):
            raise ValueError(
                f"{said}; %Z reads {ZONES}: of another zone write the offset, such as -05:00, and %z"
            ) from None
        raise ValueError(said + hint(text)) from None
    offset = read.utcoffset()
    if offset is not None and offset // _SECOND not in ZONE_OFFSETS:
        raise _no_zone(read.strftime("%z"))
    past = read.replace(tzinfo=None) - (offset or timedelta()) - _EPOCH
    stamp = past // timedelta(microseconds=1) * 1000 + nanoseconds_beyond(text, pattern)
    return _in_range(stamp, text), offset is not None


def _has_leap_second(text: str, pattern: str) -> bool:
    """Whether a text that is no date of a pattern is one with another second in the place of its 60."""
    for sixty in re.finditer("(?=60)", text):
        begin, end = text[: sixty.start()], text[sixty.start() + 2 :]
        with suppress(ValueError):
            if [date_of(f"{begin}{second}{end}", pattern).second for second in (58, 59)] == [58, 59]:
                return True
    return False


def _in_range(stamp: int, text: str) -> int:
    if not abs(stamp) < 2**63:
        raise ValueError(f"expected a date between 1678 and 2262, found {describe(text)}")
    return stamp
