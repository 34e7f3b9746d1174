"""Whether a unit is another one per unit of time, as that of a speed is of that of a place; products of units."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping
from typing import TypeAlias

import numpy as np

from hgorun.config.time_units import SECONDS, SHORT
from hgorun.data.units.factored_units import has_factor
from hgorun.data.units.units import NO_UNIT, are_usual, converted, is_time
from hgorun.data.units.written_units import in_usual_notation, with_temperatures
from hgorun.errors import Problem

_OFFSET = re.compile(r"(?<!\w)deg([CF])(?!\w)")  # of a rate only differences count
_NEAR = 1e-6
_SIDE_BY_SIDE = re.compile(r"(?<=[\w)])\s+(?=[\w(])")
_ONE = frozenset(("rad", "radian", "radians"))  # beside which a number is the same
_TURNS = frozenset(("turn", "turns", "rev", "revolution", "cycle", "cycles"))
_SIGNS = {"%": "percent", "‰": "permille", "°": "deg"}
_NUMBERS = frozenset(("deg", "degree", "degrees", "percent", "ppm", "ppb", "arcmin", "arcsec", "permille", "grade"))

Factors: TypeAlias = Mapping[str, int]
"""A unit as its factors, with their exponents."""


def per_time(unit: str, time: str) -> str:
    """How a unit per unit of time is written: ``m/s``, ``m/s^2``, ``g/L per h``."""
    if unit.endswith(f"/{time}"):
        return f"{unit}^2"
    return f"{unit}/{time}" if unit.isalpha() else f"{unit} per {time}"


def unlike_rate(unit: str, time: str, rate: str) -> str:
    """What is wrong with the unit of a derivative: "1 rad/s is 57.2958 deg/s"; empty where nothing is.

    So it is of texts that are no units, and where one counts turns and the other does not say what it counts.

    Parameters
    ----------
    unit, time : str
        Of what is differentiated, and of time.
    rate : str
        The unit that the derivative is said to have.
    """
    right = per_time(unit, time)
    if rate == right or not is_time(time) or {unit, rate} & set(NO_UNIT) or not are_usual(unit, rate):
        return ""
    back, state = (
        _OFFSET.sub(r"delta_deg\1", with_temperatures(one)) for one in (f"{rate}*{SHORT.get(time, time)}", unit)
    )
    try:
        (size,) = converted(np.ones(1), back, state, ()).tolist()
    except Problem as problem:
        return f"{rate} is of another kind" if "of another kind" in problem.message else ""
    return "" if abs(size - 1) <= _NEAR else f"1 {right} is {1 / size:.6g} {rate}"


def factors_of(unit: str) -> Factors | None:
    """The factors of a unit; None of one that says that there is none, and of one that is no plain product.

    A temperature is a difference of temperatures, as which it enters rates.
    """
    if unit in NO_UNIT or not are_usual(unit) or has_factor(unit):
        return None
    text = _OFFSET.sub(r"delta_deg\1", in_usual_notation(unit)).replace("^", "**")
    for sign, name in _SIGNS.items():
        text = text.replace(sign, name)
    try:
        return _factors(ast.parse(_SIDE_BY_SIDE.sub("*", text), mode="eval").body)
    except (SyntaxError, ValueError):
        return None


def _factors(node: ast.expr) -> Factors:
    """Those of a parsed unit; ValueError where it is no product of powers."""
    match node:
        case ast.Name(id=name):
            return {SHORT.get(name, name): 1}
        case ast.Constant(value=1):
            return {}
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return product(_factors(left), _factors(right))
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return product(_factors(left), _factors(right), -1)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return product({}, _factors(left), int(ast.literal_eval(right)))
    raise ValueError


def product(one: Factors, other: Factors, power: int = 1) -> Factors:
    """One unit times a power of another."""
    found = dict(one)
    for name, exponent in other.items():
        found[name] = found.get(name, 0) + power * exponent
    return {name: exponent for name, exponent in found.items() if exponent}


def size_of(factors: Factors) -> float | None:
    """The number that a unit is; None of one that is no number, and where it counts turns, and no angles beside them.

    Told without pint where units of time alone are left, or a single factor: to import it takes long.
    """
    left = {name: exponent for name, exponent in factors.items() if name not in _ONE}
    if left.keys() <= SECONDS.keys():
        size = math.prod(SECONDS[name] ** exponent for name, exponent in left.items())
        return float(size) if not sum(left.values()) else None
    name = next(iter(left))
    if len(left) == 1 and name not in _NUMBERS and (name not in _TURNS or len(factors) == 1):
        return None
    try:
        (size,) = converted(np.ones(1), written(factors), "-", ()).tolist()
    except Problem:
        return None
    return float(size)


def written(factors: Factors) -> str:
    """A unit as it is read: ``g/(L h)``, ``m/s^2``, ``1/h``."""
    above = " ".join(_power(name, exponent) for name, exponent in factors.items() if exponent > 0)
    below = [_power(name, -exponent) for name, exponent in factors.items() if exponent < 0]
    if not below:
        return above or "1"
    return f"{above or '1'}/" + (below[0] if len(below) == 1 else f"({' '.join(below)})")


def _power(name: str, exponent: int) -> str:
    return name if exponent == 1 else f"{name}^{exponent}"
