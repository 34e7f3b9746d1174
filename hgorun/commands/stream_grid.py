"""The times at which a stream with ``--every`` is answered."""

from __future__ import annotations

import math
from collections.abc import Iterator

from hgorun.estimate.scores.output_points import same_point


class Grid:
    """Multiples of a step, from what has been reached on; one that is a sample on paper is at its time, and behind it.

    As output points of a file are, see :class:`~hgorun.estimate.scores.output_points.OutputPoints`.
    """

    def __init__(self, origin: float, step: float | None, reached: float) -> None:
        self._origin, self.step, self._next, self._reached = origin, step, 0, reached
        if step is not None and reached > origin:
            self._next = max(math.floor((reached - origin) / step) - 1, 0)
            while self._due(step) < reached - self._near(step, reached):
                self._next += 1

    def until(self, t: float) -> Iterator[float]:
        """Those before a time, which is that of a sample."""
        if self.step is None:
            return
        before = t - self._near(self.step, t)
        while (due := self._due(self.step)) < before:
            yield self._reached if abs(due - self._reached) <= self._near(self.step, due) else due
            self._next += 1
        self._reached = max(self._reached, t)

    def _due(self, step: float) -> float:
        return self._origin + self._next * step

    def _near(self, step: float, t: float) -> float:
        """How far apart a multiple and a sample are one."""
        return same_point(step, 4 * math.ulp(max(abs(self._origin), abs(t))))
