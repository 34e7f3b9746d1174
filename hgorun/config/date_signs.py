"""The signs of a pattern of dates: those that are not read, or stand there twice, and the pattern that is meant."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

_READ = frozenset("aAbBcdfGHIjmMpSuUVwWxXyYzZ%")
_MEANT = {
    **{"F": "%Y-%m-%d", "D": "%m/%d/%y", "T": "%H:%M:%S", "R": "%H:%M", "r": "%I:%M:%S %p"},
    **{"e": "%d", "k": "%H", "l": "%I", "h": "%b", "P": "%p", "i": "%M", "L": "%f", "N": "%f", "q": "%f"},
}  # of date, of MySQL and of JavaScript
_SIGN = re.compile(r"%(-?.|-?$)", re.DOTALL)
_IN_TIMES = re.compile(r"(%[iMm][^%]?)%s|%h(?=[^%]?%[iMm])")
_EACH = "mMdSHYf"  # that are taken for each other
_DATE = r"(?:%d[^%]?%m[^%]?%[Yy]|%m[^%]?%d[^%]?%[Yy]|%[Yy][^%]?%m[^%]?%d)"
_TIME = r"%[HI][^%]?%M(?:[^%]?%S(?:[.,:]%f)?)?(?:[^%]?%p)?"
_USUAL = re.compile(rf"(?:{_DATE}[^%]*)?{_TIME}|{_TIME}[^%]*{_DATE}|{_DATE}")


def require_signs(pattern: str) -> None:
    """Refuse a pattern with a sign that is not read, or that stands there twice.

    Raises
    ------
    ValueError
        With the pattern that is meant, where one is.
    """
    wrong = _sign_in_the_way(pattern)
    if wrong is None:
        return
    sign, count = wrong
    meant = next(_others(pattern, sign), "") if count else _SIGN.sub(_as_read, _IN_TIMES.sub(_in_times, pattern))
    near = f". Did you mean `{meant}`?" if meant and _sign_in_the_way(meant) is None else ""
    if count:
        raise ValueError(f"format {pattern}: %{sign} stands there {count} times{near}")
    raise ValueError(f"format {pattern}: %{sign} is no sign of a pattern{near}")


def _sign_in_the_way(pattern: str) -> tuple[str, int] | None:
    """The first sign that is wrong, and how often it stands there: 0 of one that is not read; None where all are."""
    signs = _SIGN.findall(pattern)
    for sign in signs:
        if sign not in _READ:
            return sign, 0
    return next(((sign, count) for sign, count in Counter(signs).items() if count > 1 and sign != "%"), None)


def _in_times(match: re.Match[str]) -> str:
    """Small letters of hours and seconds beside minutes."""
    return f"{match[1]}%S" if match[1] else "%H"


def _as_read(match: re.Match[str]) -> str:
    """A sign as it is read; itself where none is known."""
    sign: str = match[1].removeprefix("-")
    return "%" + sign if sign in _READ else _MEANT.get(sign, match[0] if sign else "")


def _others(pattern: str, twice: str) -> Iterator[str]:
    """Usual patterns in which one of two signs is another one."""
    for match in reversed(list(_SIGN.finditer(pattern))):
        for sign in _EACH if match[1] == twice else "":
            other = f"{pattern[: match.start()]}%{sign}{pattern[match.end() :]}"
            if _USUAL.fullmatch(other):
                yield other
