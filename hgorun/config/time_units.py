"""Units of time: of a run and of a log."""

from __future__ import annotations

from collections.abc import Collection
from fractions import Fraction

from hgorun.config.nearest import nearest

SECONDS = {
    "ns": Fraction(1, 10**9),
    "us": Fraction(1, 10**6),
    "ms": Fraction(1, 1000),
    "s": Fraction(1),
    "min": Fraction(60),
    "h": Fraction(3600),
    "d": Fraction(86400),
    "week": Fraction(604800),
}
"""How long each is."""
_NAMES = {
    "ns": ("nanosecond", "nanoseconds"),
    "us": ("µs", "μs", "usec", "usecs", "microsecond", "microseconds"),
    "ms": ("msec", "msecs", "millisecond", "milliseconds"),
    "s": ("sec", "secs", "second", "seconds"),
    "min": ("mins", "minute", "minutes"),
    "h": ("hr", "hrs", "hour", "hours"),
    "d": ("day", "days"),
    "week": ("weeks",),
}
SHORT = {name: unit for unit, names in _NAMES.items() for name in names}
"""Other names of them."""
_LONG = {"month": ("months",), "year": ("years", "yr", "a")}  # of no fixed length
_COUNTED = {"step": ("steps",), "sample": ("samples",)}
_WITHOUT = {"-": ("", "1")}
_OF_RUNS = {name: unit for unit, names in {**_LONG, **_COUNTED, **_WITHOUT}.items() for name in names}


def run_unit(text: str) -> str:
    """The short name of a unit of time of a run: one of a log, a longer one, or none.

    Raises
    ------
    ValueError
        Where it is another unit, or no unit.
    """
    unit = SHORT.get(text, _OF_RUNS.get(text, text))
    if unit in SECONDS or without_length(unit):
        return unit
    known = (*SECONDS, *_LONG)
    raise ValueError(
        f"{text!r} is not a unit of time.{meant_unit(text, (*known, *SHORT))} Known: {', '.join(known)}, and - for a "
        "time without a unit"
    )


def without_length(text: str) -> bool:
    """Whether it is a unit of time of runs that has no fixed length: month and year, steps and samples, or none."""
    unit = _OF_RUNS.get(text, text)
    return unit in _LONG or unit in _COUNTED or unit in _WITHOUT


def meant_unit(text: str, known: Collection[str]) -> str:
    """Which unit of time may be meant, as a question; empty where none is like it."""
    return " Did you mean `min`? m is a metre." if text == "m" else nearest(text.strip(), known)
