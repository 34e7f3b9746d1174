"""Units of time: of a run and of a log."""

from __future__ import annotations

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
}
SHORT = {name: unit for unit, names in _NAMES.items() for name in names}
"""Other names of them."""
_WITHOUT = ("", "-", "1", "step", "steps", "sample", "samples")  # of a time that is counted, or has no unit
_LONG = ("week", "weeks", "month", "months", "year", "years", "yr", "a")  # of which no log counts


def run_unit(text: str) -> str:
    """A unit of time of a run: one of a log, a longer one, or none.

    Raises
    ------
    ValueError
        Where it is another unit, or no unit.
    """
    if text in SECONDS or text in SHORT or text in _WITHOUT or text in _LONG:
        return text
    known = (*SECONDS, "week", "month", "year")
    raise ValueError(
        f"{text!r} is not a unit of time.{nearest(text, (*known, *SHORT))} Known: {', '.join(known)}, and - for a time "
        "without a unit"
    )
