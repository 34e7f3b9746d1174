"""Innovations that have been written to a result file, where there are too many to be held in memory."""

from __future__ import annotations

import numpy as np

from hgorun.result.growing import Growing
from hgorun.symbolic.evaluate import Floats

_ROWS = 1 << 16  # that are read at a time


class WrittenInnovations:
    """Of an output, see :class:`~hgorun.estimate.evaluated.Innovations`.

    Parameters
    ----------
    written : Growing
        With rows of one number for each observer.
    count : int
        How many rows there are.
    """

    def __init__(self, written: Growing, count: int) -> None:
        self._written, self._count = written, count

    def of(self, j: int, some: slice = slice(None)) -> Floats:
        """Those of observer j, of some samples: an array of its own, which may be changed."""
        first, stop, step = some.indices(self._count)
        found = np.empty(len(range(first, stop, step)))
        size, done = step * max(1, _ROWS // step), 0
        for start in range(first, stop, size):
            values = self._written.read(start, min(start + size, stop))[::step, j]
            found[done : done + values.size] = values
            done += values.size
        return found
