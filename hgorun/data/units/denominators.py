"""Units of time that a unit is divided by."""

from __future__ import annotations

import re
from collections.abc import Iterator

from hgorun.data.units.units import alike_times, is_time

_PER = re.compile(r"/\s*\(?\s*((?:\d[\d.,]*\s*)?[^\W\d_]+)|([^\W\d_]+)\s*(?:\^|\*\*)?\s*\(?[-⁻][1-9¹²³]")
_PER_SEVERAL = re.compile(r"/\s*\(([^()]*)\)")  # as in g/(L h)
_FACTOR = re.compile(r"[^\W\d_]+(?!\s*(?:\^|\*\*)?\s*[-⁻])")


def per_unit_of(unit: str, time: str) -> str:
    """A unit that is per another unit of time, as it is per this one: 1/s of 1/h and 1/24h; empty where it is not."""
    if not is_time(time):
        return ""
    found = unit
    for first, end in sorted(set(_denominators(unit)), reverse=True):  # from the end, so that places stay
        name = unit[first:end]
        if is_time(name) and not alike_times(name, time):
            found = found[:first] + time + found[end:]
    return found if found != unit else ""


def _denominators(unit: str) -> Iterator[tuple[int, int]]:
    """Where the units stand, with their numbers, that a unit is divided by."""
    for match in _PER.finditer(unit):
        yield match.span(1 if match[1] else 2)
    for group in _PER_SEVERAL.finditer(unit):
        yield from (match.span() for match in _FACTOR.finditer(unit, *group.span(1)))
