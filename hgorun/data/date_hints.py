"""What to write in the configuration where a text is a date: the whole key, so that it can be taken as it stands."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from datetime import datetime

import yaml

from hgorun.data.zones import without_zone

_DATES = {
    "%d.%m.%Y": "",
    "%Y.%m.%d": "",
    "%d/%m/%Y": "the day is first",
    "%m/%d/%Y": "the month is",
    "%Y/%m/%d": "",
    "%d-%m-%Y": "the day is first",
    "%m-%d-%Y": "the month is",
    "%Y-%m-%d": "",  # not quite ISO 8601: 2024-1-31
    "%Y-%d-%m": "",  # what cannot be that
    "%Y%m%d": "",
}
"""Patterns of dates, and in which order day and month stand in those that others may read, too."""
_TIMES = ("", "%H:%M", "%H:%M:%S", "%H:%M:%S.%f", "%H%M", "%H%M%S", "%I:%M %p", "%I:%M:%S %p", "%I:%M:%S.%f %p")
_EXAMPLE = "%d.%m.%Y %H:%M:%S"
_PLAIN = re.compile(r"[^\W\d]\w*")


def clock_key(key: str, column: str, form: str) -> str:
    """The key of a column of dates.

    Parameters
    ----------
    key : str
        ``time`` or ``available``; empty where the column is read as something else.
    column, form : str
        Its name, and how it is read.
    """
    return f"{key or 'time'}: {{column: {as_yaml(column)}, format: {as_yaml(form)}}}"


def form_hint(text: str, key: str, column: str) -> str:
    """How a date that is not one of ISO 8601 is read; parameters as of :func:`clock_key`."""
    found = list(_patterns_of(text))
    if len(found) > 1:
        which = ", ".join(f"{clock_key(key, column, form)} where {_DATES[form.split()[0]]}" for form in found)
        return f"; a date of another form needs its pattern, {which}"
    if not found and not key:
        return ""  # most likely no date: its column is none of time stamps
    form = found[0] if found else _EXAMPLE
    return f"; a date of another form needs its pattern, such as {clock_key(key, column, form)}"


def has_form(text: str) -> bool:
    """Whether a text is a date of a usual form."""
    return next(_patterns_of(text), None) is not None


def with_exchanged(form: str) -> str:
    """The pattern with day and month exchanged."""
    pattern = "%Y-%m-%d" if form == "iso" else form
    return pattern.translate(str.maketrans("dm", "md")) if "%d" in pattern and "%m" in pattern else "%Y-%d-%m"


def _patterns_of(text: str) -> Iterator[str]:
    """Those that read a text; a year in front is followed by the month, unless that cannot be."""
    if (bare := without_zone(text)) != text:
        between = " " if text[len(bare)] == " " else ""
        yield from (f"{form}{between}%Z" for form in _patterns_of(bare))
        return
    month_first = any(_reads(text, f"%Y-%m-%d{between}{time}") for time in _TIMES for between in ("", " ", "T"))
    for date in ("", *_DATES):
        if date == "%Y-%d-%m" and month_first:
            continue
        for time in _TIMES:
            for between in " T" if date and time else "":
                if _reads(text, form := date + between + time):
                    yield form
            if not (date and time) and date + time and _reads(text, date + time):
                yield date + time


def _reads(text: str, form: str) -> bool:
    try:
        datetime.strptime(text, form)
    except ValueError:
        return False
    return True


def as_yaml(text: str) -> str:
    """A text as YAML reads it, in quotes where it needs them."""
    plain = _PLAIN.fullmatch(text) and yaml.safe_load(text) == text
    return text if plain else json.dumps(text, ensure_ascii=False)
