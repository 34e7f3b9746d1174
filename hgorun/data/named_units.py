"""Units that stand in the names of columns, and what is told of a unit that is not the one taken."""

from __future__ import annotations

import re

import numpy as np

from hgorun.data.units import converted, is_time
from hgorun.errors import Problem

_IN_NAME = re.compile(r"\S\s*(?:\[([^\[\]]{1,60})\]|\(([^()]{1,60})\)|\sin\s+(\S{1,60}))\s*")
_TEMPERATURES = {"C": "degC", "F": "degF"}  # to pint coulomb and farad


def unit_in_name(name: str) -> str:
    """What the name of a column ends with as its unit: ``[unit]``, ``(unit)`` or `` in unit``; empty without one."""
    end = max(name.rfind(sign) for sign in ("[", "(", " in "))
    match = _IN_NAME.fullmatch(name, max(len(name[:end].rstrip()) - 1, 0)) if end > 0 else None
    return "" if match is None else next(part for part in match.groups() if part).strip()


def without_unit(name: str) -> str:
    """The name of a column without the unit in brackets behind it."""
    place = max(name.rfind("["), name.rfind("("))
    return name[:place].strip() if place > 0 else name.strip()


def convertible_in_name(name: str, wanted: str) -> str:
    """The unit in the name of a column, where numbers of it can be converted to a unit; else empty.

    What stands in brackets may as well be a tag, a place or a remark, and a letter that is a unit of something else.
    """
    said = unit_in_name(name)
    for unit in (said, _TEMPERATURES.get(said, said)):
        if _same_kind(unit, wanted):
            return unit
    return ""


def _same_kind(unit: str, other: str) -> bool:
    if unit == other or not (unit and other) or unit.isdigit():
        return unit == other
    try:
        converted(np.zeros(1), unit, other, ())
    except Problem:
        return False
    return True


def time_in_name(name: str) -> str:
    """The unit of time in the name of a column; empty without one."""
    said = unit_in_name(name)
    return said if is_time(said) else ""


def another_unit(column: str, source: str, found: str, wanted: str, said: str | None) -> str:
    """That a file has another unit than the one that is taken, and what to write.

    Parameters
    ----------
    source : str
        Where the unit stands that was found.
    wanted : str
        What is taken without a unit of the configuration.
    said : str, optional
        The unit of the configuration.
    """
    if said is None:
        return f"column {column!r}: {source} says {found}, {wanted}: taken as they are; unit: {found} converts"
    return f"column {column!r}: {source} says {found}, the configuration unit: {said}, which is taken; is it {found}?"
