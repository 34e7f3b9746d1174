"""Outliers: samples that an observer does not take, since they are too far from what it expects.

An innovation counts as too large beyond ``gate`` standard deviations. These are told by the observer's own covariance
where it has one, and otherwise by the median of the last innovations, which outliers do not move: 1.4826 times the
median of |e| is the standard deviation of normal numbers. Those found to be outliers are among them, so that a step of
the output is followed after some samples and does not shut the observer out for ever.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import deque

_WINDOW = 61  # innovations whose median is taken
_FEWEST = 8  # of them, before anything is an outlier
_NORMAL = 1.4826  # standard deviations in a median of |e|


class RunningDeviation:
    """The standard deviation of the last innovations of one output and one observer, by their median.

    Parameters
    ----------
    least : float
        It is at least that: the noise stated for the output.
    """

    def __init__(self, least: float = 0.0) -> None:
        self.least = least
        self._last: deque[float] = deque()
        self._sorted: list[float] = []

    @property
    def value(self) -> float:
        """Infinite until there are enough innovations."""
        count = len(self._sorted)
        if count < _FEWEST:
            return float("inf")
        middle = count // 2
        median = self._sorted[middle] if count % 2 else 0.5 * (self._sorted[middle - 1] + self._sorted[middle])
        return max(_NORMAL * median, self.least)

    def add(self, innovation: float) -> None:
        """Take one more into account."""
        size = abs(innovation)
        if size != size:
            return
        self._last.append(size)
        insort(self._sorted, size)
        if len(self._last) > _WINDOW:
            del self._sorted[bisect_left(self._sorted, self._last.popleft())]

    def state(self) -> list[float]:
        """The innovations kept, oldest first."""
        return list(self._last)

    def restore(self, innovations: list[float]) -> None:
        """Those of :meth:`state` again."""
        self._last, self._sorted = deque(innovations), sorted(innovations)
