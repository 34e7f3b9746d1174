"""Times at equal distances, as arithmetic: a train of any length takes no memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_NEAR = 2  # by how many a division may miss the place of a time among those of a train


@dataclass(frozen=True)
class Train:
    """The times first + k spacing, k = number .. number + size - 1, none of them below low or above high.

    Attributes
    ----------
    first, spacing : float
    size : int
    low, high : float
    number : int
        The first k; elsewhere times are numbered from 0.
    """

    first: float
    spacing: float
    size: int
    low: float
    high: float
    number: int = 0

    def unbounded(self, k: np.ndarray) -> np.ndarray:
        """Some of its times, by their numbers, wherever they are."""
        return np.asarray(self.first + (self.number + k) * self.spacing)

    def at(self, k: np.ndarray) -> np.ndarray:
        """Some of its times, by their numbers, which ascend."""
        times = self.unbounded(k)
        if times.size and (times[0] < self.low or times[-1] > self.high):
            return np.asarray(np.clip(times, self.low, self.high))
        return times

    @property
    def at_end(self) -> float:
        """The last of its times; minus infinity where there is none."""
        return float(self.at(np.array([self.size - 1]))[0]) if self.size else -np.inf

    def before(self, t: float) -> int:
        """How many of its times are before t."""
        guess = int(np.clip((t - self.first) / self.spacing - self.number, 0, self.size))
        near = np.arange(max(guess - _NEAR, 0), min(guess + _NEAR + 1, self.size))
        return int(near[0] + np.searchsorted(self.at(near), t)) if near.size else 0
