"""Dates of a pattern, with the names of time zones that mean one offset everywhere.

Python reads names of the machine's own zone alone, and drops them: where it is would decide whether a log is read.
"""

from __future__ import annotations

import re
from datetime import datetime

_HOURS = {
    **dict.fromkeys(("UTC", "GMT", "Z", "WET"), 0),
    **dict.fromkeys(("WEST", "CET", "MEZ"), 1),
    **dict.fromkeys(("CEST", "MESZ", "EET"), 2),
    "EEST": 3,
}
"""Ahead of UTC. CST, IST, BST and the like are several."""
ZONES = ", ".join(_HOURS)
_NAME = re.compile(rf"(?<![^\W\d_])(?:{'|'.join(_HOURS)})(?![^\W\d_])", re.IGNORECASE)
_DIRECTIVE = re.compile("%(.)")


def names_zone(pattern: str) -> bool:
    """Whether a pattern has the name of a zone."""
    return "Z" in _DIRECTIVE.findall(pattern)


def without_zone(text: str) -> str:
    """A date without the name of a zone at its end; the text itself where it has none."""
    found = [match for match in _NAME.finditer(text) if match.end() == len(text)]
    return text[: found[0].start()].rstrip() if found else text


def date_of(text: str, pattern: str) -> datetime:
    """What ``strptime`` reads, where a name of a zone is its offset; one beside an offset is passed over.

    Raises
    ------
    ValueError
    """
    if names_zone(pattern):
        beside = "z" in _DIRECTIVE.findall(pattern)
        pattern = _DIRECTIVE.sub(lambda one: ("" if beside else "%z") if one[1] == "Z" else one[0], pattern)
        text = _NAME.sub(lambda one: "" if beside else f"+{_HOURS[one[0].upper()]:02d}00", text, count=1)
    try:
        return datetime.strptime(text, pattern)
    except re.error:  # a sign of the pattern stands there twice
        raise ValueError from None
