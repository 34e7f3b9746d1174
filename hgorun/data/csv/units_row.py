"""Whether the row below the names of the columns states their units, or is the first row of data.

A row of data that is taken for one of units is lost without a word. So it is one of units only where it looks like
one; of any other row that is no data the reading says so.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

from hgorun.data.times.date_forms import reads
from hgorun.data.times.date_texts import looks_like_iso
from hgorun.data.units.factored_units import has_factor
from hgorun.data.units.units import are_usual, is_time, is_unit

NUMBER = re.compile(r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_BEGINS_AS_NUMBER = re.compile(r"[-+\u2010-\u2015\u2212<>=~\u2248\u2264\u2265\u00b1.,'\s]*\d")
_NOTHING = re.compile(r"[-\u2010-\u2015=_:\s]*")  # also a ruler
_IN_BRACKETS = re.compile(r"\[.*\]|\(.*\)|\{.*\}|<.*>")
_OF_DATES = re.compile(  # UTC, dd.mm.yyyy hh:mm; TS in files of TOA5
    r"(?i)(?:utc|gmt)(?:\s?[-+][\d:]+)?|(?=.*(?:yy|jj|hh))[ymdhsfztj:./,\s-]+|ts"
)
_OF_LOGGERS = frozenset(("smp", "avg", "max", "min", "tot", "std", "med", "mom", "cov", "wvc", "tmx", "tmn", ""))


def is_value(text: str) -> bool:
    """Whether a cell is a number, with a decimal point or a comma, or a date of ISO 8601."""
    text = text.strip()
    return bool(NUMBER.fullmatch(text)) or looks_like_iso(text)


def may_state_units(
    row: Sequence[str], names: Sequence[str], missing: frozenset[str], clocks: Mapping[str, Collection[str | None]]
) -> bool:
    """Whether no cell of a row is a number, a date, or begins as one and is no unit.

    Parameters
    ----------
    row, names : sequence of str
        Its cells, and the names of the columns.
    missing : frozenset of str
        Texts for a missing value, in small letters.
    clocks : mapping of str to collection of str
        Of the columns of time stamps, the formats in which they are read; None for numbers.
    """
    texts = [text.strip() for text in row]
    of_stamps = [text for text, _ in _stamps(texts, names, clocks)]
    of_time = bool(of_stamps) and all(is_time(text) and not has_factor(text) for text in of_stamps)
    if all(text.lower() in missing for text in texts) or any(_may_be_value(text, of_time) for text in texts):
        return False
    return not any(_reads(text, form) for text, forms in _stamps(texts, names, clocks) for form in forms)


def states_units(row: Sequence[str], names: Sequence[str], clocks: Mapping[str, Collection[str | None]]) -> bool:
    """Whether a row that may state units looks like one that does.

    If the cells of the time stamps say what these are in, other cells may hold any word: also units that nobody else
    knows. Else they are units, in brackets, or empty. Parameters as of :func:`may_state_units`.
    """
    texts = [text.strip() for text in row]
    if all(_of_stamps(text) for text, _ in _stamps(texts, names, clocks)):
        return True
    values = [text for text, name in zip(texts, map(str.strip, names), strict=False) if name not in clocks]
    return are_units(values)


def tells_processing(row: Sequence[str]) -> bool:
    """Whether a row says how a logger came to its values, as the line below the units does in files of TOA5."""
    texts = {text.strip().lower() for text in row}
    return texts != {""} and texts <= _OF_LOGGERS


def _stamps(
    texts: Sequence[str], names: Sequence[str], clocks: Mapping[str, Collection[str | None]]
) -> list[tuple[str, Collection[str | None]]]:
    """The cells in columns of time stamps, with the formats of these."""
    return [(text, clocks[name]) for text, name in zip(texts, map(str.strip, names), strict=False) if name in clocks]


def _may_be_value(text: str, of_time: bool) -> bool:
    """Whether a cell is no unit, and is a number, a date, or something that begins as one does.

    A number with a unit is a unit only beside one of time in the column of stamps: ``0.1 K`` may as well be a value.
    """
    if is_value(text) or _BEGINS_AS_NUMBER.match(text) is None:
        return is_value(text)
    return not is_unit(text) or (has_factor(text) and not of_time)


def _reads(text: str, form: str | None) -> bool:
    """Whether a text is a date of a pattern."""
    return form is not None and "%" in form and reads(text, form)  # numbers and ISO 8601 are known as such


def _of_stamps(text: str) -> bool:
    """Whether a text can be what a file says of the unit of time stamps."""
    return is_time(text) or any(form.fullmatch(text) for form in (_NOTHING, _IN_BRACKETS, _OF_DATES))


def are_units(texts: Sequence[str]) -> bool:
    """Whether some cells are nothing but units, in brackets, or empty: not all of them empty, and none a number."""
    stripped = [text.strip() for text in texts]
    return any(stripped) and all(_of_values(text) and not is_value(text) for text in stripped)


def _of_values(text: str) -> bool:
    return are_usual(text) or is_time(text) or any(form.fullmatch(text) for form in (_NOTHING, _IN_BRACKETS))
