"""Local time without a zone where clocks are put forward or back: an hour that is missing, or there twice.

Nights are those of Europe (the last Sundays of March and October, at 1, 2 or 3 o'clock) and of North America (the
second Sunday of March and the first of November, at 2).
"""

from __future__ import annotations

import numpy as np

from hgorun.data.faults.fault_passes import gaps_above
from hgorun.data.faults.faults import usual_step
from hgorun.data.recording import Origin
from hgorun.data.units.units import seconds

PUT_FORWARD = (
    "the time stamps have no zone, and jump by an hour in a night when clocks are put forward: if it is that, no "
    "sample is missing, and all that follow are taken to be an hour later than they were"
)
PUT_BACK = ", in a night when clocks are put back: if it is that, two hours would be mixed"
RIGHT = "right are stamps in UTC or with their zone (%z), or a log that is cut there"
HOUR = 3600.0
_OFF = 60.0, 900.0  # seconds by which the change may be off an hour, at the least and at the most
_SUNDAY = 6


class HourTwice:
    """What is said of samples of one signal that run backwards or come again: something else where clocks are put back.

    Parameters
    ----------
    origin : Origin
        Of their times.
    """

    def __init__(self, origin: Origin) -> None:
        self._origin, self._found = origin, False

    def told(self, taken: np.ndarray, what: str, hint: str) -> tuple[str, str, str]:
        """What is wrong, what is right, and what a note says that is no refusal; once found, it is remembered."""
        self._found = self._found or put_back(taken, self._origin).size > 0
        if not self._found:
            return what, hint, what
        what += PUT_BACK
        return what, RIGHT, f"{what}; {RIGHT}"


def put_forward(taken: np.ndarray, origin: Origin) -> np.ndarray:
    """Samples before which an hour is missing, as where clocks are put forward; of times that increase."""
    unit, usual = _usual(taken, origin)
    if not 0 < usual <= HOUR:
        return np.empty(0, dtype=int)
    found = gaps_above(taken, (usual + HOUR - _off(usual)) / unit)
    found = found[(taken[found] - taken[found - 1]) * unit <= usual + HOUR + _off(usual)]
    sunday, month, day, hour = _dates(taken[found], origin, unit)
    skipped = np.floor(hour) - 1
    whole = hour - (taken[found] - taken[found - 1]) * unit / HOUR <= skipped
    europe = (day >= 25) & (skipped >= 1) & (skipped <= 3)
    america = (day >= 8) & (day <= 14) & (skipped == 2)
    return np.asarray(found[sunday & whole & (month == 3) & (europe | america)])


def put_back(taken: np.ndarray, origin: Origin) -> np.ndarray:
    """Samples with which an hour begins again, as where clocks are put back; of times as they stand in the file."""
    unit, usual = _usual(taken, origin)
    found = an_hour_back(taken * unit, usual)
    if not found.size:  # as where times have no date
        return found
    sunday, month, day, hour = _dates(taken[found], origin, unit)
    again = np.floor(hour)
    europe = (month == 10) & (day >= 25) & (again >= 1) & (again <= 3)
    america = (month == 11) & (day <= 7) & (again == 1)
    return np.asarray(found[sunday & (europe | america)])


def an_hour_back(taken: np.ndarray, usual: float) -> np.ndarray:
    """Samples with which an hour begins again, in whatever night, of times and their usual step in seconds."""
    if not 0 < usual <= HOUR:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(np.abs(np.diff(taken) - usual + HOUR) <= _off(usual)) + 1


def _usual(taken: np.ndarray, origin: Origin) -> tuple[float, float]:
    """The unit of the run and the usual step, in seconds; no step where stamps are no dates, or have a zone."""
    if origin.epoch is None or origin.zone:
        return 1.0, 0.0
    unit = float(seconds(origin.unit, ("time", "unit")))
    return unit, unit * usual_step(taken)


def _off(usual: float) -> float:
    return min(max(_OFF[0], usual / 2), _OFF[1])


def _dates(times: np.ndarray, origin: Origin, unit: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Whether dates are Sundays, their months and days of these, and the hours of the clock."""
    assert origin.epoch is not None
    date = origin.epoch.astype("datetime64[ms]") + np.rint(times * unit * 1e3).astype("timedelta64[ms]")
    day, month = date.astype("datetime64[D]"), date.astype("datetime64[M]")
    sunday = (day.astype(int) + 3) % 7 == _SUNDAY  # the first day of 1970 was a Thursday
    hour = (date - day).astype(float) / (1e3 * HOUR)
    return sunday, month.astype(int) % 12 + 1, (day - month.astype("datetime64[D]")).astype(int) + 1, hour
