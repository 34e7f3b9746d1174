"""Patterns of dates as spreadsheets and other languages write them, in letters: what they are with percent signs."""

from __future__ import annotations

import re
from collections.abc import Sequence

_LETTERS = re.compile(
    r"'(?P<quoted>[^']*)'|(?P<half>AM/PM|am/pm|tt|aa?|A)(?![A-Za-z])|(?P<same>([A-Za-z])\4*)|(?P<zeros>0+)"
)
_YEARS, _DAYS, _HOURS = "yYJj", "dDT", "Hh"  # J and T: Jahr and Tag
_NAMES = {("M", 3): "%b", ("m", 3): "%b", ("M", 4): "%B", ("m", 4): "%B", ("d", 3): "%a", ("d", 4): "%A"}
_ZONES = "zZXx"
_SINGLE = {"d": "%d", "j": "%d", "D": "%a", "l": "%A", "m": "%m", "n": "%m", "M": "%b", "F": "%B", "Y": "%Y", "y": "%y"}
_SINGLE |= {"H": "%H", "G": "%H", "h": "%I", "g": "%I", "i": "%M", "s": "%S", "u": "%f", "v": "%f"}
_SINGLE |= {"A": "%p", "a": "%p", "O": "%z", "P": "%z", "T": "T"}  # as PHP writes dates; T as in ISO 8601
_DATE = re.compile(r"%[dmbBYy]")


def with_percent(pattern: str) -> str:
    """What a pattern of letters such as ``dd.mm.yyyy hh:mm`` is for ``format``: ``%d.%m.%Y %H:%M``.

    ``m`` stands for months and minutes: minutes are those beside hours or seconds.

    Returns
    -------
    str
        Empty where it is no such pattern.
    """
    if single := _of_single_letters(pattern):
        return single
    parts = list(_LETTERS.finditer(pattern))
    runs = [part["same"] or "" for part in parts]
    half = any(part["half"] for part in parts)
    found, end = [], 0
    for i, part in enumerate(parts):
        sign = part["quoted"] if part["quoted"] is not None else "%p" if part["half"] else ""
        sign = sign or ("%f" if part["zeros"] else _sign(runs, i, pattern[end : part.start()], half))
        if not sign and part["quoted"] is None:
            return ""
        found += [pattern[end : part.start()], sign]
        end = part.end()
    whole = "".join(found) + pattern[end:]
    return whole if sum(part["same"] is not None for part in parts) > 1 and not re.search("[0-9]", whole) else ""


def _of_single_letters(pattern: str) -> str:
    """What a pattern of PHP such as ``d.m.Y H:i:s`` is; empty where it is none, with which words are not mistaken."""
    found = [_SINGLE.get(sign, "") if sign.isalpha() else sign for sign in pattern]
    whole, signs = "".join(found), [one for one in found if one.startswith("%")]
    date = set(_DATE.findall(whole))
    full = len(date) == len("dmy") and "%d" in date and len(date & {"%Y", "%y"}) == 1
    hour = {"%H", "%I"} & set(signs)
    minutes = len(hour) == 1 and "%M" in signs and ("%I" in hour) == ("%p" in signs)
    wrong = "" in found or len(set(signs)) < len(signs) or re.search("[0-9%]", pattern) or (date and not full)
    return (
        whole
        if not wrong and (minutes or (full and "%Y" in date and not {"%H", "%I", "%M", "%p"} & set(signs)))
        else ""
    )


def _sign(runs: Sequence[str], i: int, before: str, half: bool) -> str:
    """What a run of one letter stands for, between others; ``before`` is what stands between it and the last one."""
    letter, count = runs[i][0], len(runs[i])
    last, following = (runs[k][:1] if 0 <= k < len(runs) else "" for k in (i - 1, i + 1))
    if name := _NAMES.get((letter, count)):
        return name
    if letter == "T" and count == 1 and last and last in _DAYS:
        return "T"  # as in ISO 8601
    if letter in "mM" and count <= 2:
        return "%M" if (last and last in _HOURS) or (following and following in "sS") else "%m"
    if letter in "sS" and before.endswith((".", ",")) and (letter == "S" or count == 3):
        return "%f"
    kinds = {_YEARS: "%Y" if count == 4 else "%y", _DAYS: "%d", _HOURS: "%I" if half else "%H"}
    kinds |= {"sS": "%S", "f": "%f", _ZONES: "%z"}
    fits = count <= 2 or letter in f"f{_ZONES}" or (letter in _YEARS and count == 4)
    return next((sign for letters, sign in kinds.items() if letter in letters and fits), "")
