"""Numbers whose digits are hours, minutes and seconds: 1345 is followed by 1400, and 13.45 by 14.00."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.data.times.time_steps import unevenness

_LOOKED_AT = 1000
_FEWEST = 8  # numbers of which none is 60 to 99 by more than chance
_CLEARLY = 4.0  # times as evenly
_WITHIN = 4  # steps from one hour to the next, at the most, for each one within an hour
_EXACT = 1e-6  # of a hundredth
_MOST = 60  # minutes, or hours of fewer
_POINTED = {"hours and minutes": "%H.%M", "minutes and seconds": "%M.%S"}
_SHORT = {"hours and minutes": "%H%M", "minutes and seconds": "%M%S"}


@dataclass(frozen=True)
class ClockInDigits:
    """What numbers most likely are.

    Attributes
    ----------
    before, behind : float
        Two that follow each other.
    patterns : dict of str to str
        By what they are.
    """

    before: float
    behind: float
    patterns: dict[str, str]


def clock_in_digits(values: np.ndarray) -> ClockInDigits | None:
    """What numbers are whose last digits go on to 59 alone, and which are more evenly spaced as times than as numbers.

    Seconds that are counted evenly are not, whatever hundreds they pass.

    Parameters
    ----------
    values : ndarray
        None is missing.
    """
    some = values[:_LOOKED_AT]
    if (back := np.flatnonzero(np.diff(some) < 0)).size:  # up to the first midnight
        some = some[: back[0] + 1]
    if some.size < _FEWEST or not np.all((some >= 0) & (some < 240_000)):
        return None
    whole, hundredths = np.floor(some), np.rint(100 * some)
    fine = bool(np.any(some != whole))
    if fine and np.all(np.abs(100 * some - hundredths) < _EXACT) and some[-1] < _MOST:
        return _found(hundredths, some, _POINTED)
    if not fine and some[-1] < 100 * _MOST:
        return _found(whole, some, _SHORT)
    return _found(some, some, {"hours, minutes and seconds": "%H%M%S.%f" if fine else "%H%M%S"})


def _found(digits: np.ndarray, some: np.ndarray, patterns: dict[str, str]) -> ClockInDigits | None:
    """What numbers with two digits of a last part are; None where these are not parts of 60, or nothing is carried."""
    last, above = digits % 100, digits // 100
    carries = np.flatnonzero(np.diff(above) > 0)
    if np.any(last >= 60) or not carries.size or _WITHIN * (some.size - 1 - carries.size) < carries.size:
        return None
    if len(patterns) == 1:
        if np.any(above % 100 >= 60):
            return None
        above = above // 100 * 60 + above % 100
    elif above[-1] >= 24:  # no hours
        patterns = {name: pattern for name, pattern in patterns.items() if "%H" not in pattern}
    if not _CLEARLY * unevenness(60 * above + last) < unevenness(digits):
        return None
    k = int(carries[0])
    return ClockInDigits(float(some[k]), float(some[k + 1]), patterns)
