"""What to write in the configuration where a text is a date: the whole key, so that it can be taken as it stands."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import datetime, timedelta
from itertools import pairwise

import numpy as np
import yaml

from hgorun.data.times.date_forms import foreign_month, lacks_year, longest_part, may_read, patterns_of
from hgorun.data.times.intervals import TWO_TIMES, is_interval
from hgorun.data.times.time_steps import unevenness
from hgorun.data.times.zones import date_of

_EXAMPLE = "%d.%m.%Y %H:%M:%S"
_READ = "31.05.2024 13:45:10"
_NUMERIC = re.compile(
    r"[0-9]{1,4}([./-])[0-9]{1,2}\1[0-9]{1,4}(?:[ T,]+[0-9]{1,2}:[0-9]{2}(?::[0-9]{2}(?:[.,][0-9]+)?)?)?"
)
_EPOCH = datetime(1970, 1, 1)
_CLEARLY = 2.0  # times as evenly
_SEVERAL = 3  # others that show how a column is written
_MISTYPED = "; the others are dates in order, and this one alone is wrong: correct it in the file"
_FIRST = {"d": "day", "m": "month", "y": "year"}
_LIKE_DATES = re.compile(
    r"[0-9]{1,4}([./-])[0-9]{1,2}\1[0-9]{1,4}(?:[ T].*)?|[0-9]{1,2}:[0-9]{2}(?::[0-9]{2})?.*|[0-9]{8}T[0-9]{4,6}.*"
)
_FOUR = re.compile(r"(?<![0-9:])[0-9]{1,3}:[0-9]{2}:[0-9]{2}:[0-9]{1,2}$")
_FOUR_NUMBERS = (
    "four numbers between colons may be days to seconds, or hours to seconds with the frames of a video or parts of a "
    "second behind: write seconds into the file, or a fraction of a second with all of its digits"
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


def form_hint(text: str, key: str, column: str, beside: Sequence[str], taken: Callable[[str], float]) -> str:
    """How a date that is not one of ISO 8601 is read, as far as that is known: each pattern that is said reads it.

    Parameters
    ----------
    text : str
    key, column : str
        As of :func:`clock_key`.
    beside : sequence of str
        Others of its column, in their order, and it may stand among them. Those that are no dates decide nothing,
        unless the first is of the form in which the column is read.
    taken : callable
        The time of a text in that form. Patterns in which the others run backwards are not said where they do not
        in that form. A ValueError says that a text is none of it.
    """
    if is_interval(text, beside):
        return f"; {TWO_TIMES}"
    if all(_FOUR.search(one) for one in (text, *beside) if one):
        return f"; {_FOUR_NUMBERS}"
    found = patterns_of(text)
    others = [other for other in beside if other not in ("", text)] if found else []
    if _is_mistyped(text, others, beside, taken, list(found.values())):
        return _MISTYPED
    for other in others:
        both = {order: form for order, form in found.items() if may_read(other, form)}
        if not both and "may" in text.lower():  # which is a month in full, too
            whole = {order: form.replace("%b", "%B") for order, form in found.items()}
            both = {order: form for order, form in whole.items() if may_read(other, form)}
        if not both and (patterns_of(other) or (other is others[0] and times_in([other], taken))):
            one = next(iter(found.values()))
            return f"; this one is of the form {one}, and {other!r} is not: a column has one form"
        if not both:
            break
        found = both
    if len(times := times_in(others, taken)) > 1 and _in_order(times):
        found = {order: form for order, form in found.items() if _in_order(times_in(beside, reader(form)))}
        if not found:
            return ""
    if len(found) > 1:
        first, *others = (
            f"{clock_key(key, column, form)} where the {_FIRST[order[0]]} is" for order, form in found.items()
        )
        return f"; a date of another form needs its pattern, {first} first, {', '.join(others)}"
    for form in found.values():
        if form == "%H:%M" and not _passes_midnight(beside):
            keys = clock_key(key, column, form), clock_key(key, column, "%M:%S")
            both_of = "{} where these are hours and minutes, {} where they are minutes and seconds".format(*keys)
            return f"; a date of another form needs its pattern, {both_of}"
        return f"; a date of another form needs its pattern, such as {clock_key(key, column, form)}"
    return _hint_of_parts(text) if key else ""  # without one it is most likely no date


def _passes_midnight(texts: Sequence[str]) -> bool:
    """Whether texts of two numbers go on from 23 to 0, as hours do."""
    hours = [text.partition(":")[0].strip() for text in texts if text]
    return any(before == "23" and int(behind or 1) == 0 for before, behind in pairwise(hours) if behind.isdigit())


def _is_mistyped(
    text: str, others: Sequence[str], beside: Sequence[str], taken: Callable[[str], float], forms: Sequence[str]
) -> bool:
    """Whether a text is written as all others are, and these are in order in the form in which the column is read.

    In a pattern that reads all of them, too, they are less even.
    """
    times = times_in(others, taken)
    if not len(times) == len(others) >= _SEVERAL or not _in_order(times) or times_in([text], taken):
        return False
    if _shape(text) != _shape(others[0]):
        return False
    evenly = _CLEARLY * unevenness(np.array(times))
    in_order = [form for form in forms if _in_order(times_in(beside, reader(form)))]
    read = [times_in(others, reader(form)) for form in in_order]
    return not any(len(one) == len(others) and unevenness(np.array(one)) <= evenly for one in read)


def _shape(text: str) -> str:
    return re.sub(r"\d", "0", text)


def times_in(texts: Sequence[str], taken: Callable[[str], float]) -> list[float]:
    """The times of those texts that are of a form."""
    found = []
    for text in texts:
        with suppress(ValueError):
            found.append(taken(text))
    return found


def _in_order(times: Sequence[float]) -> bool:
    return all(first <= second for first, second in pairwise(times))


def reader(form: str) -> Callable[[str], float]:
    """The times of texts of a pattern, in seconds by the clock on the wall."""
    return lambda text: (date_of(text, form).replace(tzinfo=None) - _EPOCH) / timedelta(seconds=1)


def other_hint(text: str, key: str, column: str, beside: Sequence[str], taken: Callable[[str], float]) -> str:
    """How a text that may be a date is read; empty where it is most likely none. Parameters as above."""
    hint = form_hint(text, key, column, beside, taken)
    if hint or not key or not may_be_date(text):
        return hint
    if times_in(beside, taken):
        return ""  # a pattern would not read the others
    return f"; a date of another form needs its pattern: {clock_key(key, column, _EXAMPLE)} reads {_READ}"


def may_be_date(text: str) -> bool:
    """Whether a text is a date, looks like one, or has one in it."""
    return (
        _LIKE_DATES.fullmatch(text) is not None or is_interval(text) or bool(patterns_of(text) or _hint_of_parts(text))
    )


def _hint_of_parts(text: str) -> str:
    """What is said of a text of which no pattern is known: what its parts are."""
    if _NUMERIC.fullmatch(text) and not patterns_of(text):
        return "; it is no date and time in any order of day, month and year"
    if lacks_year(text):
        return "; it has no year: write dates with it, or the time since the start, into the file"
    if month := foreign_month(text):
        return f"; names of months are English, and {month!r} is none: write the month as a number into the file"
    before, part, behind = longest_part(text)
    if not part:
        return ""
    forms = " or ".join(patterns_of(part).values())
    rest = " and ".join(repr(one) for one in (before, behind) if one)
    zone = (
        "; of a zone write the offset, such as -05:00, and %z"
        if _LETTERS.fullmatch(behind) and behind.strip() not in ("AM", "PM")
        else ""
    )
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
