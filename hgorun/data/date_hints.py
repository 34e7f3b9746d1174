"""What to write in the configuration where a text is a date: the whole key, so that it can be taken as it stands."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

import yaml

from hgorun.data.date_forms import foreign_month, lacks_year, longest_part, patterns_of, reads

_EXAMPLE = "%d.%m.%Y %H:%M:%S"
_READ = "31.05.2024 13:45:10"
_FIRST = {"d": "day", "m": "month", "y": "year"}
_LIKE_DATES = re.compile(
    r"[0-9]{1,4}([./-])[0-9]{1,2}\1[0-9]{1,4}(?:[ T].*)?|[0-9]{1,2}:[0-9]{2}(?::[0-9]{2})?.*|[0-9]{8}T[0-9]{4,6}.*"
)
_LETTERS = re.compile(r"\s?[A-Z]{2,5}")
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


def form_hint(text: str, key: str, column: str, beside: Sequence[str] = ()) -> str:
    """How a date that is not one of ISO 8601 is read, as far as that is known: each pattern that is said reads it.

    Parameters
    ----------
    text : str
    key, column : str
        As of :func:`clock_key`.
    beside : sequence of str, optional
        Others of its column. Those that are no dates decide nothing.
    """
    found = patterns_of(text)
    for other in filter(None, beside if found else ()):
        both = {order: form for order, form in found.items() if reads(other, form)}
        if not both and patterns_of(other):
            one = next(iter(found.values()))
            return f"; this one is of the form {one}, and {other!r} is not: a column has one form"
        if not both:
            break
        found = both
    if len(found) > 1:
        first, *others = (
            f"{clock_key(key, column, form)} where the {_FIRST[order[0]]} is" for order, form in found.items()
        )
        return f"; a date of another form needs its pattern, {first} first, {', '.join(others)}"
    for form in found.values():
        return f"; a date of another form needs its pattern, such as {clock_key(key, column, form)}"
    return _hint_of_parts(text) if key else ""  # without one it is most likely no date


def other_hint(text: str, key: str, column: str, beside: Sequence[str] = ()) -> str:
    """How a text that may be a date is read; empty where it is most likely none. Parameters as above."""
    hint = form_hint(text, key, column, beside)
    if hint or not key or not may_be_date(text):
        return hint
    return f"; a date of another form needs its pattern: {clock_key(key, column, _EXAMPLE)} reads {_READ}"


def may_be_date(text: str) -> bool:
    """Whether a text is a date, looks like one, or has one in it."""
    return _LIKE_DATES.fullmatch(text) is not None or bool(patterns_of(text) or _hint_of_parts(text))


def _hint_of_parts(text: str) -> str:
    """What is said of a text of which no pattern is known: what its parts are."""
    if lacks_year(text):
        return "; it has no year: write dates with it, or the time since the start, into the file"
    if month := foreign_month(text):
        return f"; names of months are English, and {month!r} is none: write the month as a number into the file"
    before, part, behind = longest_part(text)
    if not part:
        return ""
    forms = " or ".join(patterns_of(part).values())
    rest = " and ".join(repr(one) for one in (before, behind) if one)
    zone = "; of a zone write the offset, such as -05:00, and %z" if _LETTERS.fullmatch(behind) else ""
    as_it_is = "what is the same in all stands as it is"
    return f"; {part!r} in it is {forms}, and no pattern is known for {rest}: {as_it_is}{zone}"


def with_exchanged(form: str) -> str:
    """The pattern with day and month exchanged."""
    pattern = "%Y-%m-%d" if form == "iso" else form
    return pattern.translate(str.maketrans("dm", "md")) if "%d" in pattern and "%m" in pattern else "%Y-%d-%m"


def as_yaml(text: str) -> str:
    """A text as YAML reads it, in quotes where it needs them."""
    plain = _PLAIN.fullmatch(text) and yaml.safe_load(text) == text
    return text if plain else json.dumps(text, ensure_ascii=False)
