"""Where the steps of a stream end although nothing happens: its first ones, and at kinks of functions of time.

A log has them at the same times. A stream has no end, so that kinks are found ahead, in pieces of a constant length.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hgorun.engine.early import Breaks, Early
from hgorun.errors import Problem
from hgorun.estimate.steps.first_steps import early
from hgorun.measurement.events import merge
from hgorun.measurement.schedule import inward_of, pulses_of, tolerances_of
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.plant_alone import breaks_in_time, plant_kinks

_PIECE = 4096.0  # steps
_KEPT = 4  # pieces: late samples go back, and predictions ahead


@dataclass(frozen=True, eq=False, repr=False)
class _Piece:
    """What breaks in a piece of time: the kinks, the events that they are, and the ends of pulses that are shorter."""

    sides: list[float]
    times: list[float]
    pulses: list[float]


@dataclass(frozen=True, eq=False, repr=False)
class KinksAhead:
    """Kinks and jumps of the plant's functions of time, beside shorter first steps.

    Attributes
    ----------
    experiment : Experiment
    first : Early
    step : float
        The longest.
    """

    experiment: Experiment
    first: Early
    step: float
    _pieces: OrderedDict[int, _Piece] = field(default_factory=OrderedDict)

    @property
    def settled(self) -> float:
        """There are always more."""
        return np.inf

    def between(self, t: float, end: float) -> Iterator[float]:
        """Those between two times, ascending."""
        apart, last = self.first.apart, self._number(end)
        begun, ahead = t >= self.first.settled, list(self.first.between(t, end))
        for number in range(self._number(t), last + 1):
            piece = self._piece(number)
            times = piece.times
            if not begun:
                until = end if number == last else (number + 1) * self._length
                own = [one for one in ahead if one <= until]
                ahead = ahead[len(own) :]
                times = merge(np.array([*times, *own]), apart).tolist()
            found = times[bisect_right(times, t + apart) : bisect_left(times, end - apart)]
            if piece.pulses:
                ends = [one for one in piece.pulses if t + self._rounding < one < end - self._rounding]
                found = merge(np.array([*found, *ends]), self._rounding).tolist()
            yield from found

    def clear(self, t: float) -> tuple[float, float]:
        """About a time, as far as its piece reaches."""
        number, apart = self._number(t), self.first.apart
        sides = self._piece(number).sides
        k = bisect_left(sides, t)
        low = sides[k - 1] if k else number * self._length
        high = sides[k] if k < len(sides) else (number + 1) * self._length
        first = self.first.clear(t)
        return max(low + apart, first[0]), min(high - apart, first[1])

    def inward(self, t: float) -> float:
        """How far from there functions of time are evaluated."""
        apart = self.first.apart
        found: list[float] = []
        events = {t}
        for number in {self._number(max(t - apart, 0.0)), self._number(t + apart)}:
            sides = self._piece(number).sides
            found += sides[bisect_left(sides, t - apart) : bisect_right(sides, t + apart)]
            events |= {one for one in self._piece(number).pulses if self._rounding < abs(one - t) <= 2 * apart}
        if not found:
            return 0.0
        ordered = sorted(events)
        return float(inward_of(np.array([*ordered, np.inf]), np.array(found), self.step)[ordered.index(t)])

    @cached_property
    def _rounding(self) -> float:
        return tolerances_of(self.experiment.stretches, self.step)[0]

    @property
    def _length(self) -> float:
        return _PIECE * self.step

    def _number(self, t: float) -> int:
        """That of the piece in which a time lies."""
        return int(t // self._length)

    def _piece(self, number: int) -> _Piece:
        """What breaks in a piece."""
        if number not in self._pieces:
            self._pieces[number] = self._found(number * self._length, (number + 1) * self._length)
            if len(self._pieces) > _KEPT:
                self._pieces.popitem(last=False)
        return self._pieces[number]

    def _found(self, start: float, end: float) -> _Piece:
        experiment, apart = self.experiment, self.first.apart
        time = experiment.time.model_copy(update={"start": start, "end": end})
        try:
            sides = plant_kinks(experiment.plant, time, experiment.origin).times
        except Problem as problem:
            raise ValueError(f"{'.'.join(map(str, problem.path))}: {problem.message}") from problem
        pulses = pulses_of(sides, apart, self._rounding, self.step)
        return _Piece(sides.tolist(), merge(sides, apart).tolist(), pulses.tolist())


def breaks_of(experiment: Experiment, step: float) -> Breaks:
    """Those of a stream.

    Parameters
    ----------
    step : float
        The longest.
    """
    first = early(experiment, step)
    return KinksAhead(experiment, first, step) if breaks_in_time(experiment.plant) else first
