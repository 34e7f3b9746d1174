"""Numbers of the command line: what is wrong with one is said as for any other value, with what was found."""

from __future__ import annotations

import math
from collections.abc import Callable

from hgorun.errors import ConfigError, printable


def whole(option: str, low: int, high: float = math.inf) -> Callable[[str | int], int]:
    """What reads an integer from ``low`` to ``high``.

    Parameters
    ----------
    option : str
        What it is called, for messages.

    Examples
    --------
    >>> whole("--port", 0, 65535)("8080")
    8080
    """

    def integer(text: str | int) -> int:  # click has its own default read, too
        text = str(text)
        try:
            value: int | None = int(text)
        except ValueError:
            value = None
        if value is None or not low <= value <= high:
            limits = f"of at least {low}" if high == math.inf else f"from {low} to {high}"
            raise ConfigError(f"{option}: expected an integer {limits}, found {printable(text[:60])}")
        return value

    return integer


def not_negative(option: str) -> Callable[[str | float], float]:
    """What reads a number that is not negative.

    Parameters
    ----------
    option : str
        What it is called, for messages.
    """

    def number(text: str | float) -> float:
        text = str(text)
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not 0 <= value < math.inf:
            raise ConfigError(f"{option}: expected a number of at least 0, found {printable(text[:60])}")
        return value

    return number
