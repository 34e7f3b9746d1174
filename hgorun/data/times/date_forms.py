"""Patterns that read a date, found from its parts: numbers, English names of months and days, and what is between."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from hgorun.data.times.pattern_texts import without_fill
from hgorun.data.times.zones import ZONES, date_of, without_halves, without_zone

_DATES = ("Ymd", "Ydm", "dmY", "mdY", "dmy", "mdy", "ymd", "dbY", "bdY", "Ybd", "dby", "Yj", "GVu")
_TIMES = ("HMSf", "HMS", "HM")
_FEW_PARTS = {"": "MSf", "Ymd": "H", "dmY": "H"}  # times that stand alone, or behind such dates
_WITHOUT_YEAR = ("bd", "db")
_WIDTHS = {
    **dict.fromkeys("YG", (4, 4)),
    **dict.fromkeys("yV", (2, 2)),
    **dict.fromkeys("mdHIMS", (1, 2)),
    **{"j": (3, 3), "u": (1, 1), "f": (1, 9)},
}
"""How many digits a part of a date has, with one sign of a pattern for each."""
_MONTHS = (
    *("January", "February", "March", "April", "May", "June"),
    *("July", "August", "September", "October", "November", "December"),
)
_DAYS = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")
_NAMES = {
    **{name.lower(): "%B" for name in _MONTHS},
    **{name[:3].lower(): "%b" for name in _MONTHS},
    **{name.lower(): "%A" for name in _DAYS},
    **{name[:3].lower(): "%a" for name in _DAYS},
    **dict.fromkeys(("am", "pm"), "%p"),
}
_AS_THEY_ARE = frozenset(("t", "w", "h", "m", "s", "uhr", "um", "at", "de", *"年月日时時分秒点"))  # in any date
_PART = re.compile(r"[0-9]+|[^\W\d_]+|.")
_MANY, _FEW = 30, 12  # parts of a date at most, and those but signs where some of them may be one
_WORDS = 3  # that may be names in another language
_INSIDE = re.compile(rf"(.*[0-9]) ({'|'.join(ZONES.split(', '))}) ([0-9]{{4}})", re.IGNORECASE)
_OFFSET = re.compile(r"(\s?(?:UTC|GMT)?)[+-][0-9]{2}:?[0-9]{2}$")
_ALONE = re.compile(r"%[HI]:%M(?::%S(?:[.,:]%f)?)?\s?(?:%p|uhr)?|%M:%S[.,]%f", re.IGNORECASE)  # a time without a date
_SAME_SIGNS = re.compile(
    r"%[dmY](?P<sign>[./_ -]?\s?)%[dmY](?P=sign)%[dmY]|%[dmy](?P<short>[./-]?)%[dmy](?P=short)%[dmy]|%Y年%m月%d|%[bBjV]"
)
# 31.12.2016 as a short year and an hour, and 11:15-05:00 with seconds
_JOINED = re.compile(r"[./:-]%[bBdjmuyMS]%[^pf]|%[HI]:%M[^:%\w]+%S")
_HOUR = re.compile(r"[ T]%H$")
_LARGEST = {"m": 12, "d": 31, "j": 366, "H": 23, "I": 12, "M": 59, "S": 59}
_YEARS = range(1800, 2300)
_OF_SECONDS = (3, 6, 9)  # digits of a fraction that follow seconds without a sign
_BETWEEN = re.compile(r"%[dmYy](\W?)%")
_FRACTION = re.compile(r"%S[.,:]?%f")


def patterns_of(text: str) -> dict[str, str]:
    """Those that read a date or a time, as a log may have it.

    Behind a year in front stands the month, unless that cannot be, and before dots the day; else what may stand first
    are several patterns.

    Returns
    -------
    dict of str to str
        By the order of year, month and day; empty of a time.
    """
    if found := _patterns(text) or _patterns(without_fill(text)):
        return found
    if (bare := without_zone(text)) != text:
        between = " " if text[len(bare)] == " " else ""
        return {order: f"{pattern}{between}%Z" for order, pattern in _patterns(bare).items()}
    if match := _INSIDE.fullmatch(text):  # as date of Unix has it
        return {order: f"{pattern} %Z %Y" for order, pattern in _without_year(match[1], match[3])}
    if match := _OFFSET.search(text):
        return {order: f"{pattern}{match[1]}%z" for order, pattern in _patterns(text[: match.start()]).items()}
    return {}


def _without_year(text: str, year: str) -> Iterator[tuple[str, str]]:
    """The patterns of a text behind which a year stands, without it."""
    for order, pattern in _patterns(f"{text} {year}").items():
        if pattern.endswith(" %Y"):
            yield order, pattern.removesuffix(" %Y")


def lacks_year(text: str) -> bool:
    """Whether a text is a date with all but its year."""
    parts = _PART.findall(without_halves(text))
    orders = [[*date, *time] for date in _WITHOUT_YEAR for time in ("", *_TIMES)] if len(parts) <= _MANY else []
    return any(_has_fraction(pattern) for order in orders if (pattern := _pattern(parts, order)))


def foreign_month(text: str) -> str:
    """The word of a text that is a date with an English month in its place; empty where there is none.

    Another word may be the day of the week.
    """
    parts: list[str] = _PART.findall(text)
    unknown = [k for k, part in enumerate(parts) if part.isalpha() and part.lower() not in _AS_THEY_ARE | _NAMES.keys()]
    for month in reversed(unknown) if len(unknown) <= _WORDS else ():
        english = ["May" if k == month else "Monday" if k in unknown else part for k, part in enumerate(parts)]
        if patterns_of("".join(english)):
            return parts[month]
    return ""


def longest_part(text: str) -> tuple[str, str, str]:
    """The longest part of a text that is a date, with what stands before and behind it.

    Returns
    -------
    before, part, behind : str
        The part is empty where there is none of two numbers and half of the text.
    """
    ends = [match.span() for match in _PART.finditer(text) if match[0].isalnum()]
    if len(ends) <= _FEW:
        spans = [(first, end) for k, (first, _) in enumerate(ends) for _, end in ends[k + 1 :]]
        for first, end in sorted(spans, key=lambda span: span[0] - span[1]):
            if 2 * (end - first) < len(text):
                break
            if patterns_of(text[first:end]):
                return text[:first], text[first:end], text[end:]
    return text, "", ""


def _patterns(text: str) -> dict[str, str]:
    """Those that read a text without a zone."""
    parts = _PART.findall(re.sub(r"\s+", " ", without_halves(text)))
    if len(parts) > _MANY or not any(part[0] in "0123456789" for part in parts):
        return {}
    found: dict[str, str] = {}
    for date in ("", *_DATES):
        for order in _orders(date):
            pattern = _pattern(parts, order)
            if pattern is not None and date not in found and _is_usual(pattern, date) and may_read(text, pattern):
                found[date] = pattern
    return _likely(found)


def _orders(date: str) -> Iterator[list[str]]:
    """The parts of a date with those of a time behind or before it."""
    if date:
        yield [*date]
    if date in _FEW_PARTS:
        yield [*date, *_FEW_PARTS[date]]
    for time in _TIMES:
        yield [*date, *time]
        if date:
            yield [*time, *date]
        if date == "bdY":
            yield ["b", "d", *time, "Y"]  # as C has it: Jan 31 13:45:10 2024


def _pattern(parts: Sequence[str], order: Sequence[str]) -> str | None:
    """The pattern in which the numbers of a text are parts of a date in an order; None where they are not."""
    halves = any(part.lower() in ("am", "pm") for part in parts)
    rest, found = ["I" if sign == "H" and halves else sign for sign in order], []
    for part in parts:
        name = _NAMES.get(part.lower())
        if part[0] in "0123456789":
            count = _filled(part, rest)
            if not count:
                return None
            found += [f"%{sign}" for sign in rest[:count]]
            del rest[:count]
        elif name is not None:
            if name in ("%b", "%B") and rest[:1] != ["b"]:
                return None
            rest = rest[1:] if name in ("%b", "%B") else rest
            found.append(name)
        elif part.isalpha() and part.lower() not in _AS_THEY_ARE:
            return None
        else:
            found.append(part.replace("%", "%%"))
    return None if rest else "".join(found)


def _filled(digits: str, signs: Sequence[str]) -> int:
    """How many parts of a date a number is: one, or several side by side at their full widths; 0 where it is none.

    Each of several is what its part may be: strptime would take a shorter one.
    """
    least, most = _WIDTHS.get(signs[0], (1, 0)) if signs else (1, 0)
    if least <= len(digits) <= most:
        return 1
    left = len(digits)
    for count, sign in enumerate(signs, 1):
        if sign == "f":
            return count if left in _OF_SECONDS else 0
        width = _WIDTHS.get(sign, (0, left + 1))[1]
        start = len(digits) - left
        left -= width
        if int(digits[start : start + width]) > _LARGEST.get(sign, 9999):
            return 0
        if left <= 0:
            return 0 if left else count
    return 0


def _is_usual(pattern: str, date: str) -> bool:
    """Whether signs stand between the parts as people write them: a time by its colons, a date by the same one."""
    found = _SAME_SIGNS.search(pattern) if date else _ALONE.fullmatch(pattern)
    hour_alone = "%H" in pattern and "%M" not in pattern
    if found is None or (hour_alone and not _HOUR.search(pattern)):
        return False
    return _has_fraction(pattern) and not _JOINED.search(pattern)


def _has_fraction(pattern: str) -> bool:
    """Whether digits of a fraction, if there are such, stand behind seconds."""
    return "%f" not in pattern or _FRACTION.search(pattern) is not None


def may_read(text: str, pattern: str) -> bool:
    """Whether a text is a date of a pattern, and of centuries that logs may be of: digits side by side are of any."""
    try:
        return date_of(text, pattern).year in _YEARS
    except ValueError:
        return False


def reads(text: str, pattern: str) -> bool:
    """Whether a text is a date of a pattern."""
    try:
        date_of(text, pattern)
    except ValueError:
        return False
    return True


def _likely(found: dict[str, str]) -> dict[str, str]:
    """Of orders that are possible those that are likely."""
    orders = [order for order in found if "Y" in order] or list(found)
    if len(orders) < 2:
        return {order: found[order] for order in orders}
    match = _BETWEEN.search(found[orders[0]])
    sign = match[1] if match else ""
    if orders[0].startswith("Y") or sign == ".":
        orders = orders[:1]
    elif "ymd" in orders and not sign:
        orders = ["ymd"]
    return {order: found[order] for order in orders}
