"""Dates of a pattern, with what Python does not read: zones, halves of the day with points, and nanoseconds.

Of names of zones it reads those of the machine's own alone, and drops them: where it is would decide whether a log is
read. Here they are those that mean one offset everywhere.
"""

from __future__ import annotations

import re
from contextlib import suppress
from datetime import datetime

from hgorun.data.times.pattern_texts import read

_HOURS = {
    **dict.fromkeys(("UTC", "GMT", "Z", "WET"), 0),
    **dict.fromkeys(("WEST", "CET", "MEZ"), 1),
    **dict.fromkeys(("CEST", "MESZ", "EET"), 2),
    "EEST": 3,
}
"""Ahead of UTC. CST, IST, BST and the like are several."""
ZONES = ", ".join(_HOURS)
_NAME = re.compile(rf"(?<![^\W\d_])(?:{'|'.join(_HOURS)})(?![^\W\d_])", re.IGNORECASE)
_HALF = re.compile(r"(?<![^\W\d_])([ap])\.\s?m\b\.?", re.IGNORECASE)  # p.m.
_FINE = re.compile(r"(?<=[.,:][0-9]{6})[0-9]{1,3}(?![0-9])")  # of a second, behind its microseconds
_DIRECTIVE = re.compile("%(.)")
BOTH = "write the zone behind those that have none, as in 2024-05-31 13:45+02:00 (a pattern has %z for it)"
"""What is right where some dates have a zone and others have none."""


def names_zone(pattern: str) -> bool:
    """Whether a pattern has the name of a zone."""
    return "Z" in _DIRECTIVE.findall(pattern)


def without_zone(text: str) -> str:
    """A date without the name of a zone at its end; the text itself where it has none."""
    found = [match for match in _NAME.finditer(text) if match.end() == len(text)]
    return text[: found[0].start()].rstrip() if found else text


def without_halves(text: str) -> str:
    """A date whose half of the day has no points: ``pm`` for ``p.m.``."""
    return _HALF.sub(lambda half: f"{half[1]}m", text)


def nanoseconds_beyond(text: str, pattern: str) -> int:
    """What a date of a pattern has beyond its microseconds."""
    fine = _FINE.search(text) if "%f" in pattern else None
    return int(fine[0].ljust(3, "0")) if fine else 0


def date_of(text: str, pattern: str) -> datetime:
    """What :mod:`hgorun.data.times.pattern_texts` reads, to the microsecond.

    The name of a zone is its offset, and beside an offset passed over.

    Raises
    ------
    ValueError
    """
    if "%p" in pattern:
        text = without_halves(text)
    if "%f" in pattern:
        text = _FINE.sub("", text)
    if not names_zone(pattern):
        return read(text, pattern)
    beside = "z" in _DIRECTIVE.findall(pattern)
    pattern = _DIRECTIVE.sub(lambda one: ("" if beside else "%z") if one[1] == "Z" else one[0], pattern)
    for name in _NAME.finditer(text):  # another one may stand in the pattern itself: GMT%z (%Z)
        offset = "" if beside else f"+{_HOURS[name[0].upper()]:02d}00"
        with suppress(ValueError):
            return read(f"{text[: name.start()]}{offset}{text[name.end() :]}", pattern)
    raise ValueError
