"""What the cells of a column may hold, and what a cell says."""

from __future__ import annotations

import json
import math
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from hgorun.config.types import describe
from hgorun.data.number_signs import NUMBER, grouped, sign_hint
from hgorun.data.times.date_forms import patterns_of
from hgorun.data.times.date_hints import clock_key, form_hint, other_hint, reader, times_in
from hgorun.data.times.date_texts import iso_stamp, looks_like_iso, stamp_of
from hgorun.data.times.dates import NAT
from hgorun.patterns import Pattern

PLAIN_NUMBER = NUMBER["."]
"""A number as cells have it, with a point: no digits of other scripts, and no signs between them."""

_BEGINS_AS_NUMBER = Pattern(r"[-+<>=~.,\s]*\d")  # as in < 0.1: a number with something else
_LETTERS = Pattern(r"[^\W\d_]{2}")
# a number, and the unit that follows it
_WITH_UNIT = Pattern(r"[-+]?\d+(?:[.,]\d+)?\s*((?![eE][-+]?$)[^\W\d_¹²³][^\s\d]{0,9}|%|°[A-Z])")
_WITH_LIMIT = Pattern(r"[<>≤≥]=?\s*[-+]?\d+(?:[.,]\d+)?")  # < 0.1: below what the instrument tells
_WITH_MARK = Pattern(r"[-+]?\d+(?:[.,]\d+)?\s*([^\w\s.,;:()%°+-]{1,3})")  # 12.3 *
_OF_MICROSOFT = Pattern(r"[-+]?1\.#[A-Z]+\d*")  # 1.#QNAN, -1.#IND: what C once wrote there for no number
_DASHES = "\u2010\u2011\u2012\u2013\u2212"
_WORD = 40  # characters of a text that may mean a missing value
IF_MISSING = "; if it means a missing value: "
"""So begins what is told of a word in place of a number, behind what was found."""
_TRUTH = {"true": 1.0, "false": 0.0}

Reader: TypeAlias = Callable[[str], float | int]
"""From the text of a cell to its value; a ValueError says what is wrong with it."""


@dataclass(frozen=True)
class Numbers:
    """Numbers, NaN where one is missing.

    Attributes
    ----------
    column : str
    key : str
        Of the configuration, where they are time stamps: for what is said of those that are none.
    beside : list of str
        Texts of the column on which a pattern is tried before it is said.
    others : list of str
        The same where they are no time stamps: they show how it writes numbers.
    """

    column: str
    key: str = field(default="", compare=False)
    beside: list[str] = field(default_factory=list, compare=False, repr=False)
    others: list[str] = field(default_factory=list, compare=False, repr=False)

    dtype = np.dtype(float)

    def reader(self, decimal: str, missing: frozenset[str], thousands: str | None = None) -> Reader:
        pattern, comma = NUMBER[decimal], decimal == ","
        in_groups = None if thousands is None else grouped(thousands, decimal)

        def read(cell: str) -> float:
            text = bare(cell)
            if in_groups is not None and (match := in_groups.fullmatch(text)):
                text = "".join(char for char in match[1] if char in "+-0123456789") + match[2]
            if not pattern.fullmatch(text):
                if text.lower() in missing:
                    return math.nan
                raise ValueError(_no_number(text, decimal, thousands, self))
            value = float(text.replace(",", ".") if comma else text)
            if math.isinf(value):
                raise ValueError(f"{describe(text)} is larger than any number")
            return value

        return read


def bare(cell: str) -> str:
    """The text of a cell, also of one that a spreadsheet is to take as text: ``="20.1"``."""
    text = cell.strip()
    return text[2:-1].strip() if text[:2] == '="' and text[-1] == '"' and len(text) > len('="') else text


def _no_number(text: str, decimal: str, thousands: str | None, cells: Numbers) -> str:
    key, column, beside = cells.key, cells.column, cells.beside
    said = f"expected a number, found {describe(text)}"
    if key and "Y" in "".join(patterns_of(text)):  # 20240131,134510
        return said + form_hint(text, key, column, beside, _plain)
    with_signs = sign_hint(said, text, decimal, thousands, [*beside, *cells.others])
    if with_signs:
        return with_signs
    plain = "".join(map(_as_ascii, text))
    if NUMBER[decimal].fullmatch(plain):
        odd = next(char for char in text if not char.isascii())
        return f"{said}; {odd!r} is no sign of a number (U+{ord(odd):04X}): write {plain}"
    if looks_like_iso(text):
        return f"{said}; dates are read as time stamps, with {clock_key(key, column, 'iso')}"
    if behind := _WITH_UNIT.fullmatch(text):
        return f"{said}; a cell holds the number alone, and {behind[1]} is the unit of its column"
    left_out = f"csv: {{missing: [{json.dumps(text, ensure_ascii=False)}]}} leaves it out"
    if key != "time" and _WITH_LIMIT.fullmatch(text):
        return f"{said}; a limit is no measured value: {left_out}"
    if key != "time" and (behind := _WITH_MARK.fullmatch(text)):
        mark = f"a mark such as {behind[1]} has a column of its own, for quality"
        return f"{said}; a cell holds the number alone, and {mark}; {left_out}"
    if text.lower() in _TRUTH:
        return f"{said}; write 1 for true and 0 for false"
    if hint := other_hint(text, key, column, beside, _plain):
        return said + hint
    if key != "time" and is_word(text):
        return f"{said}; if it means a missing value: csv: {{missing: [{json.dumps(text, ensure_ascii=False)}]}}"
    return said


def _plain(text: str) -> float:
    """A number as cells have it, with either sign of decimals.

    Raises
    ------
    ValueError
    """
    if not any(form.fullmatch(text) for form in NUMBER.values()):
        raise ValueError(text)
    return float(text.replace(",", "."))


def _as_ascii(char: str) -> str:
    """A digit of another script, a minus, or a sign of full width as ASCII has it."""
    if char in _DASHES:
        return "-"
    if char.isdecimal():
        return str(unicodedata.decimal(char))
    return unicodedata.normalize("NFKC", char) if "\uff00" < char < "\uff5f" else char


def is_word(text: str) -> bool:
    """Whether a text may mean that there is no value: not one that is a number with something else."""
    if len(text) > _WORD or not text.isprintable():
        return False
    if not any(char.isnumeric() for char in text) or _OF_MICROSOFT.fullmatch(text):
        return True
    return _LETTERS.search(text) is not None and not _BEGINS_AS_NUMBER.match(text)


@dataclass(frozen=True)
class Flags:
    """Whether a cell is one of those that are good: 1 or 0."""

    column: str
    good: tuple[float | str, ...]

    dtype = np.dtype(float)

    def reader(self, decimal: str, missing: frozenset[str], thousands: str | None = None) -> Reader:
        texts = {good.strip() for good in self.good if isinstance(good, str)}
        numbers = {good for good in self.good if not isinstance(good, str)}
        numbers |= {_TRUTH[text.lower()] for text in texts if text.lower() in _TRUTH}

        def read(cell: str) -> float:
            text = cell.strip()
            if text in texts:
                return 1.0
            try:
                return float(_TRUTH.get(text.lower(), math.nan) in numbers or float(text) in numbers)
            except ValueError:
                return 0.0

        return read


@dataclass(frozen=True)
class Stamps:
    """Dates, in nanoseconds since 1970; of a pattern those of ``strptime``, else ISO 8601.

    Attributes
    ----------
    key : str
        Of the configuration.
    zoned : set of bool
        Whether stamps with and without a zone have been read.
    beside : list of str
        As of :class:`Numbers`.
    first : list of str
        The first texts that were read, as far as :attr:`MANY` of them: they show what all are.
    """

    column: str
    pattern: str | None = None
    key: str = field(default="time", compare=False)
    zoned: set[bool] = field(default_factory=set, compare=False)
    beside: list[str] = field(default_factory=list, compare=False, repr=False)
    first: list[str] = field(default_factory=list, compare=False, repr=False)

    dtype = np.dtype(np.int64)
    MANY = 500  # texts, in which a rare sign of what they are comes often

    def reader(self, decimal: str, missing: frozenset[str], thousands: str | None = None) -> Reader:
        def hint(text: str) -> str:
            if self.pattern is not None:
                return _as_written(text, self, self.pattern)
            return other_hint(text, self.key, self.column, self.beside, lambda other: iso_stamp(other)[0])

        def read(cell: str) -> int:
            text = bare(cell)
            if text.lower() in missing:
                return NAT
            stamp, zoned = iso_stamp(text, hint) if self.pattern is None else stamp_of(text, self.pattern, hint)
            self.zoned.add(zoned)
            if len(self.first) < self.MANY:
                self.first.append(text)
            if len(self.zoned) > 1:
                raise ValueError("dates with and without a time zone in one column")
            return stamp

        return read


Cells: TypeAlias = Numbers | Flags | Stamps


def _as_written(text: str, cells: Stamps, pattern: str) -> str:
    """What is said of a text that has not the form that is given: how it is read, where that is known."""
    if looks_like_iso(text):
        return f"; this one is read with {clock_key(cells.key, cells.column, 'iso')}"
    if NUMBER["."].fullmatch(text) and not times_in(cells.beside, reader(pattern)):
        return "; leave out format where stamps are numbers"
    return form_hint(text, cells.key, cells.column, cells.beside, reader(pattern))
