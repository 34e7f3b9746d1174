"""Whether a unit is another one per unit of time, as that of a speed is of that of a place."""

from __future__ import annotations

import re

import numpy as np

from hgorun.config.time_units import SHORT
from hgorun.data.units import NO_UNIT, are_usual, converted, is_time
from hgorun.data.written_units import with_temperatures
from hgorun.errors import Problem

_OFFSET = re.compile(r"(?<!\w)deg([CF])(?!\w)")  # of a rate only differences count
_NEAR = 1e-6


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
