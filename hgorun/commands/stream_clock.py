"""Times of a stream that go back or on by an hour, as those of local time do where clocks are put back or forward.

Numbers have no zone. Where they are large enough to count from 1970 their nights are known, as those of dates in a file
are; otherwise it is only told what it may be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, TypeAlias

import numpy as np

from hgorun.data.faults.clock_changes import HOUR, an_hour_back, put_back, put_forward
from hgorun.data.faults.faults import usual_step
from hgorun.data.recording import Origin
from hgorun.data.units.units import seconds
from hgorun.errors import Problem
from hgorun.symbolic.evaluate import Floats

UTC = "right are times in UTC, in which no hour is missing or comes twice"
AGAIN = "the times of {} go back by an hour, as where clocks are put back"
_UNIX = Origin(unit="s", epoch=np.datetime64(0, "s"))
_DATES = 9.4e8, 4.2e9  # seconds since 1970, from 2000 on to the next century
_KEPT = 20  # times of a signal that show what is usual

Back: TypeAlias = Literal["", "hour", "night"]
Kept: TypeAlias = Mapping[str, tuple[Sequence[float], float | None]]


class Clock:
    """The last times of each signal.

    Parameters
    ----------
    unit : str
        Of the run's time; without a length nothing is known of hours.
    """

    def __init__(self, unit: str) -> None:
        try:
            self._unit = float(seconds(unit, ("time", "unit")))
        except Problem:
            self._unit = 0.0
        self._last: dict[str, list[float]] = {}
        self._again: dict[str, float] = {}

    def kept(self) -> dict[str, tuple[list[float], float | None]]:
        """For a checkpoint: by signal its last times in seconds, and until when an hour comes again, where one does."""
        return {signal: (last, self._again.get(signal)) for signal, last in self._last.items()}

    def restore(self, kept: Kept) -> None:
        """That of :meth:`kept` again."""
        self._last = {signal: [float(t) for t in last] for signal, (last, _) in kept.items()}
        self._again = {signal: float(until) for signal, (_, until) in kept.items() if until is not None}

    def took(self, signal: str, t: float) -> float | None:
        """Note a time of a signal; that time where it lies an hour ahead, in a night when clocks are put forward.

        Late ones are passed over.
        """
        last, now = self._last.setdefault(signal, []), t * self._unit
        if last and now <= last[-1]:
            return None
        far = len(last) > 1 and now - last[-1] > HOUR / 2
        last.append(now)
        ahead = far and _dated(now) and put_forward(np.array(last), _UNIX)[-1:].tolist() == [len(last) - 1]
        del last[:-_KEPT]
        return t if ahead else None

    def took_all(self, signal: str, times: Floats) -> float | None:
        """The same of several times, which increase: the first that lies so."""
        last = self._last.get(signal, [])
        known = np.concatenate([last, times * self._unit])
        self._last[signal] = known[-_KEPT:].tolist()
        found = put_forward(known, _UNIX) if _dated(float(known[-1])) else np.empty(0, dtype=int)
        found = found[found >= len(last)]
        return float(known[found[0]]) / self._unit if found.size else None

    def back(self, signal: str, t: float) -> Back:
        """Whether the time of a sample goes back by an hour, behind the last ones of its signal.

        ``night`` is one in which clocks are put back; all samples are of it until the hour that comes again has passed.
        """
        last, now = self._last.get(signal, []), t * self._unit
        if signal in self._again:
            if now <= self._again[signal]:
                return "night"
            del self._again[signal]
        times = np.array([*last, now])
        if not _is_last(an_hour_back(times, usual_step(times[:-1])), last):
            return ""
        if not (_dated(now) and _is_last(put_back(times, _UNIX), last)):
            return "hour"
        self._again[signal] = last[-1]
        return "night"

    def until(self, signal: str) -> float:
        """The last time of a signal, in the unit of the run."""
        return self._last[signal][-1] / self._unit


def _dated(t: float) -> bool:
    return _DATES[0] < t < _DATES[1]


def _is_last(found: np.ndarray, last: Sequence[float]) -> bool:
    """Whether what was found is the time that follows some."""
    return bool(found.size) and int(found[-1]) == len(last)
