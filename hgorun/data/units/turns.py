"""What units of pint count: turns, angles, or what they do not say, as 1/min does not."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

from hgorun.config.time_units import SHORT

if TYPE_CHECKING:
    import pint

_TURNS = ("turn", "hertz", "revolutions_per_minute", "revolutions_per_second", "cycle")
_ANGLES = ("radian", "degree", "arcminute", "arcsecond", "grade")
_NEAR = 1e-12


def exponents(unit: pint.Unit, names: tuple[str, ...]) -> float:
    """Of what units with these names, or with a prefix before them, are raised to, the sum."""
    return sum(float(Fraction(str(power))) for name, power in unit._units.items() if name.endswith(names))


def turns_alone(unit: pint.Unit, other: pint.Unit) -> bool:
    """Whether one counts turns or angles and the other does not say what it counts: 1/min is rpm to many.

    To pint a turn is 2 pi, a radian 1 and a hertz 1/s, as if that were a radian a second. 1/s and rad/s are the same.
    """
    turns = [exponents(one, _TURNS) for one in (unit, other)]
    angles = [exponents(one, (*_TURNS, *_ANGLES)) for one in (unit, other)]
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
