"""Intervals of time in place of times: ``00:15-00:30``, whose end looks like the offset of a zone."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

ZONE_OFFSETS = range(-12 * 3600, 14 * 3600 + 1, 900)
"""Seconds that clocks are ahead of UTC somewhere."""
TWO_TIMES = "an interval has two times: write the one that the value is of, its start or its end, into the file"
_TIME = r"[0-9]{1,2}:[0-9]{2}(?::[0-9]{2}(?:[.,][0-9]+)?)?"
_ZONE = r"(?:\s?Z|[-+][0-9]{2}:?[0-9]{2})?"
_DATE = r"(?:[0-9]{1,4}[-./][0-9]{1,2}[-./][0-9]{1,4}[T ]\s*)?"
_BETWEEN = r"\s*(?:[-\u2010-\u2015~/]|\.{2,}|\u2026|to|bis|until|till)\s*"
_INTERVAL = re.compile(
    rf"{_DATE}{_TIME}{_ZONE}(?:{_BETWEEN}{_DATE}{_TIME}{_ZONE}|\s*/\s*P[0-9YMWDTHS.,]+)", re.IGNORECASE
)
_AS_ZONE = re.compile(r".*?([0-9]{1,2}):?([0-9]{2})(?::?[0-9]{2}(?:[.,][0-9]+)?)?\s?-([0-9]{2})(?::?([0-9]{2}))?")
_HOURS = re.compile(r".*[T ]([0-9]{1,2})-([0-9]{1,2})")
_DAY = 1440  # minutes
_FEWEST = 3  # zones of one column that are more than a log of two places has


def is_interval(text: str, beside: Sequence[str] = ()) -> bool:
    """Whether a text has two times; of one whose end may be a zone, the texts beside it in the column decide."""
    if _HOURS.fullmatch(text):
        return _are_hours([*beside] or [text])
    if not _INTERVAL.fullmatch(text):
        return False
    ends = _ends(text)
    return ends is None or re.match(_TIME, text) is not None or ends_change([*beside] or [text])


def ends_change(texts: Sequence[str]) -> bool:
    """Whether what may be zones of the dates of a column, in their order, are the ends of intervals.

    All lie behind a minus, and most are not that of the row above. They are several, or as far from the times of day
    as these are from each other, so that all intervals have one length.
    """
    found = [ends for text in dict.fromkeys(texts) if (ends := _ends(text)) is not None]
    if len(found) < len(dict.fromkeys(texts)) or len(found) < 2:
        return False
    changes = sum(first[1] != second[1] for first, second in pairwise(found))
    lengths = {(end - start) % _DAY for start, end in found}
    return 2 * changes > len(found) - 1 and (len({end for _, end in found}) >= _FEWEST or len(lengths) == 1)


def _are_hours(texts: Sequence[str]) -> bool:
    """Whether all texts end in two hours, as 13-14, that are equally far apart, as no other parts of a time are."""
    found = [match for text in texts if (match := _HOURS.fullmatch(text))]
    lengths = {(int(match[2]) - int(match[1])) % 24 for match in found}
    return len(found) == len(texts) and len(lengths) == 1 and 0 not in lengths and len({*texts}) > 1


def _ends(text: str) -> tuple[int, int] | None:
    """The time of day, and what lies behind the minus at the end, in minutes; None where there is no such thing."""
    match = _AS_ZONE.fullmatch(text)
    if match is None:
        return None
    hour, minute, end, of_end = (int(part or 0) for part in match.groups())
    return 60 * hour + minute, 60 * end + of_end
