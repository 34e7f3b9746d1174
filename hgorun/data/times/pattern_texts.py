"""Texts of a pattern as ``strptime`` reads them rightly: where it takes less than was written, or not all of that.

Of digits side by side it takes fewer for a part than that has: 10305 would be 10:30:05 for ``%H%M%S``. Here zeros that
a number has lost in front are written again, and other such texts are refused. And it does not know 24:00, 0:30 PM,
times beyond a day where there is no date, a fraction that is left out where it is zero, as is the time at midnight, and
numbers that are filled with spaces.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import lru_cache

_WIDTHS = {**dict.fromkeys("YG", 4), **dict.fromkeys("ymdHIMSUWV", 2), "j": 3, "u": 1, "w": 1}
_LARGEST = {"m": 12, "d": 31, "j": 366, "H": 24, "I": 12, "M": 59, "S": 59}
_LOSING = "mdjHIMS"  # parts in front of which a number loses its zeros: one of years is of the first decade alone
_DAYS = 10_000_000  # more than there are dates
_OF_SECONDS = (3, 6, 9)  # digits of a fraction without a sign before it
_TOKEN = re.compile(r"%(.)|([^%]+)", re.DOTALL)
_DATE = frozenset("YyGmbBdjUWVaAuwcx")
_TIME = frozenset("HIMSfp")
_ANY = {"z": r"Z|[-+]\d\d:?\d\d(?::?\d\d)?", "%": "%", "f": "[0-9]+"}
_POINTED = re.compile(r"%[HIM]\.%[MS]")
_SPACES = re.compile(r"^\s+|(?<=[./:,\s-])\s+(?=\d)")
_FRACTION = re.compile(r"(?<=%S)[.,:]?%f")


@dataclass(frozen=True)
class _Form:
    """A pattern, taken apart.

    Attributes
    ----------
    text : re.Pattern
        Of its texts, with a group of digits for every part of numbers, or several side by side.
    runs : tuple of str
        The signs of each group.
    signs : str
        All of them.
    pointed : bool
        Whether minutes or seconds stand behind a point, as decimals do.
    """

    text: re.Pattern[str]
    runs: tuple[str, ...]
    signs: str
    pointed: bool

    @property
    def joined(self) -> bool:
        """Whether what strptime reads has to be of full width."""
        return self.pointed or any(len(run) > 1 for run in self.runs)


@lru_cache(64)
def form_of(pattern: str) -> _Form:
    """What a pattern is made of."""
    found: list[str] = []
    runs: list[str] = []
    signs, open_ = "", False
    for sign, between in _TOKEN.findall(pattern):
        signs += sign
        number = sign in _WIDTHS or sign == "f"
        if number and open_:
            runs[-1] += sign
        elif number:
            runs.append(sign)
            found.append(r"([0-9]+)")
        elif between:
            found.append(re.sub(r"(?:\\?\s)+", r"\\s+", re.escape(between)))
        else:
            found.append(f"(?:{_ANY.get(sign, r'.*?')})")
        open_ = number
    return _Form(re.compile("".join(found), re.IGNORECASE), tuple(runs), signs, _POINTED.search(pattern) is not None)


def has_time_only(pattern: str) -> bool:
    """Whether a pattern has a time and no date."""
    return not _DATE & set(form_of(pattern).signs)


def read(text: str, pattern: str) -> datetime:
    """The date of a text, without any zone where the pattern has none.

    Raises
    ------
    ValueError
        Where it is none of the pattern.
    """
    if not form_of(pattern).joined:
        try:
            return _plain(text, pattern)
        except ValueError:
            pass
    for other, form, beyond in _others(text, pattern):
        try:
            return _plain(_filled(other, form), form) + beyond
        except (ValueError, OverflowError):  # the year 10,000
            continue
    raise ValueError


def without_fill(text: str) -> str:
    """A text without the spaces that fill numbers: ``3. 5.2024  1:00`` is 3.5.2024 1:00."""
    return _SPACES.sub("", text)


def lacks_digits(text: str, pattern: str) -> str:
    """What is said of a text that has too few digits for parts side by side, or behind a point; empty of others."""
    form = form_of(pattern)
    match = form.text.fullmatch(text) if form.joined else None
    if match is None:
        return ""
    for k, run in enumerate(form.runs, 1):
        if len(run) > 1 and len(match[k]) < _width(run) + 3 * ("f" in run):
            signs = "".join(f"%{sign}" for sign in run)
            return f"; digits side by side, {signs}, need all of theirs, with zeros in front"
        if _is_cut(form, match, k):
            return f"; behind a point %{run} has two digits: a number has lost the zeros at its end"
    return ""


def _is_cut(form: _Form, match: re.Match[str], k: int) -> bool:
    """Whether minutes or seconds behind hours or minutes and a point have one digit: 13.5 may be 13:05 or 13:50."""
    before = match.string[match.end(k - 1) : match.start(k)] if k > 1 else ""
    return before == "." and form.runs[k - 2] in "HIM" and form.runs[k - 1] in "MS" and len(match[k]) == 1


def _plain(text: str, pattern: str) -> datetime:
    try:
        return datetime.strptime(text, pattern)
    except re.error:  # a part of a date stands there twice: %c has a day, too
        raise ValueError from None


def _others(text: str, pattern: str) -> Iterator[tuple[str, str, timedelta]]:
    """A text, and what it may mean where it is none of a pattern: what strptime reads, and what is to be added."""
    text = without_fill(text)
    yield text, pattern, timedelta()
    yield from _hours(text, pattern)
    without = _FRACTION.sub("", pattern)
    if without != pattern:
        yield text, without, timedelta()
        yield from _hours(text, without)
    if date := _date_of(pattern):
        yield text, date, timedelta()


def _hours(text: str, pattern: str) -> Iterator[tuple[str, str, timedelta]]:
    """A text with an hour that a clock shows, and what is beyond it."""
    form = form_of(pattern)
    match = form.text.fullmatch(text)
    if match is None:
        return
    first = next((sign for sign in "HIM" if sign in form.runs), "")
    if not first:
        return
    group = form.runs.index(first) + 1
    number, rest = int(match[group]), [match[k + 1] for k, run in enumerate(form.runs) if run in ("M", "S", "f")]
    put = f"{text[: match.start(group)]}{{:02d}}{text[match.end(group) :]}"
    if first == "I" and number == 0:
        yield put.format(12), pattern, timedelta()
    elif first == "H" and has_time_only(pattern):
        yield put.format(number % 24), pattern, timedelta(days=min(number // 24, _DAYS))
    elif first == "H" and number == 24 and not any(map(int, rest)):
        yield put.format(0), pattern, timedelta(days=1)
    elif first == "M" and has_time_only(pattern):
        yield put.format(number % 60), pattern, timedelta(hours=min(number // 60, 24 * _DAYS))


def _date_of(pattern: str) -> str:
    """The date of a pattern that has a time behind it; empty of others."""
    parts = list(_TOKEN.finditer(pattern))
    times = [k for k, part in enumerate(parts) if part[1] and part[1] in _TIME]
    dates = [k for k, part in enumerate(parts) if part[1] and part[1] in _DATE]
    if not times or len(dates) < 3 or times[0] < dates[-1] or any(part[1] and part[1] in "zZ" for part in parts):
        return ""
    return pattern[: parts[dates[-1]].end()]


def _width(run: str) -> int:
    return sum(_WIDTHS.get(sign, 0) for sign in run)


def _filled(text: str, pattern: str) -> str:
    """A text with the zeros that numbers in it have lost.

    Raises
    ------
    ValueError
        Where digits side by side are none of their parts, or may be several.
    """
    form = form_of(pattern)
    match = form.text.fullmatch(text) if form.joined else None
    if match is None:
        return text
    found, end = [], 0
    for k, run in enumerate(form.runs, 1):
        begin = match.start(k)
        if _is_cut(form, match, k):
            raise ValueError
        behind_sign = begin > 0 and text[begin - 1] in ".,"
        digits = match[k] if len(run) == 1 else _of_full_width(match[k], run, losing=not behind_sign)
        found += [text[end:begin], digits]
        end = match.end(k)
    return "".join(found) + text[end:]


def _of_full_width(digits: str, run: str, *, losing: bool) -> str:
    """Digits of parts side by side, each of its width."""
    width, losing = _width(run), losing and run[0] in _LOSING
    if "f" not in run and losing:
        digits = digits.zfill(width)
    rest = len(digits) - width
    if ("f" in run and (rest < 1 or (losing and rest not in _OF_SECONDS))) or ("f" not in run and rest):
        raise ValueError
    begin = 0
    for sign in run.replace("f", ""):
        if int(digits[begin : begin + _WIDTHS[sign]]) > _LARGEST.get(sign, 9999):
            raise ValueError
        begin += _WIDTHS[sign]
    return digits
