"""What units of pint count: turns, angles, or what they do not say, as 1/min does not."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import TYPE_CHECKING

from hgorun.config.time_units import SHORT

if TYPE_CHECKING:
    import pint

_TURNS = ("turn", "hertz", "revolutions_per_minute", "revolutions_per_second", "cycle")
_ANGLES = ("radian", "degree", "arcminute", "arcsecond", "grade")
_OF_ANYTHING = ("count", "percent", "permille", "ppm", "part_per_billion")
_NEAR = 1e-12
_COUNTS = """
    count counts cnt cnts cts inc incs incr increment increments ink inkr inkrement inkremente tick ticks raw digit
    digits pulse pulses imp impulse lsb adc
"""
_COUNTED = frozenset(_COUNTS.split())
_PART_OF_TURN = re.compile(r"\(?\s*(?:(2)\s*\*?\s*)?(?:pi|π)\s*\)?\s*/\s*(\d{1,9})(?:\s*\*?\s*rad)?", re.IGNORECASE)


def exponents(unit: pint.Unit, names: tuple[str, ...]) -> float:
    """Of what units with these names, or with a prefix before them, are raised to, the sum."""
    return sum(float(Fraction(str(power))) for name, power in unit._units.items() if name.endswith(names))


def turns_alone(unit: pint.Unit, other: pint.Unit) -> bool:
    """Whether one counts turns or angles and the other does not say what it counts: 1/min is rpm to many.

    Nor do a count and a percentage, which are numbers to pint, as a radian is.
    To pint a turn is 2 pi, a radian 1 and a hertz 1/s, as if that were a radian a second. 1/s and rad/s are the same.
    """
    if unit.is_compatible_with(other) and len({exponents(one, _OF_ANYTHING) for one in (unit, other)}) == 2:
        return _angles(unit) != _angles(other)
    turns = [exponents(one, _TURNS) for one in (unit, other)]
    angles = [_angles(one) for one in (unit, other)]
    if any(turns):
        return angles[0] != angles[1]
    of_time = all(set(one.dimensionality) == {"[time]"} for one in (unit, other))
    if not of_time or angles[0] == angles[1] or not unit.is_compatible_with(other):
        return False
    return abs(float((1 * unit).to(other).magnitude) - 1) > _NEAR


def counted_by(unit: pint.Unit) -> str:
    """Which units say what one per time leaves open: "`turn/min` counts turns, `rad/min` radians"; empty of others."""
    ((name, power), *more) = [*unit._units.items(), ("", 0)]
    if len(more) != 1 or power != -1 or name not in SHORT:
        return ""
    return f"`turn/{SHORT[name]}` counts turns, `rad/{SHORT[name]}` radians"


def _angles(unit: pint.Unit) -> float:
    return exponents(unit, (*_TURNS, *_ANGLES))


def is_counted(text: str) -> bool:
    """Whether numbers are said to be counted, of an encoder or a converter, and not what one of them is."""
    return text.strip().rstrip(".").casefold() in _COUNTED


def counts_of(wanted: pint.Unit) -> str:
    """How counts are converted to a unit, as a sentence."""
    if _angles(wanted) == 1 and not wanted.dimensionality:
        return "Counts are converted by how many make a turn, as `turn/8192`."
    return f"Counts are converted by what one of them is, as `0.01 {wanted:~}`."


def part_of_turn(text: str) -> str:
    """The unit that is written as a part of 2 pi: ``turn/8192`` of ``2*pi/8192``, ``deg`` of ``pi/180``; else empty."""
    match = _PART_OF_TURN.fullmatch(text.strip())
    if match is None:
        return ""
    parts = int(match[2]) * (1 if match[1] else 2)
    return "deg" if parts == 360 else f"turn/{parts}" if parts else ""
