"""The innovations of an output: in memory, or in the result file where there are too many to be held there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hgorun.result.hdf5.growing import Growing
from hgorun.symbolic.evaluate import Floats

_ROWS = 1 << 16  # that are read at a time


class Innovations(Protocol):
    """Of an output measured minus estimated at the time of each sample, as it was estimated without that sample."""

    def of(self, j: int, some: slice = slice(None), room: Floats | None = None) -> Floats:
        """Those of observer j, of some samples; ``room`` may be taken for them."""


@dataclass(frozen=True, eq=False, repr=False)
class InnovationsInMemory:
    """Innovations of a run that is carried out at once.

    Attributes
    ----------
    values : ndarray, shape (m, n_k)
    """

    values: Floats

    def of(self, j: int, some: slice = slice(None), room: Floats | None = None) -> Floats:
        """Those of observer j, of some samples, which are not to be changed."""
        return self.values[j, some]


class WrittenInnovations:
    """Innovations of a run whose result is written as it goes on.

    Parameters
    ----------
    written : Growing
        With rows of one number for each observer.
    count : int
        How many rows there are.
    """

    def __init__(self, written: Growing, count: int) -> None:
        self._written, self._count = written, count

    def of(self, j: int, some: slice = slice(None), room: Floats | None = None) -> Floats:
        """Those of observer j, of some samples: an array of its own, or in a room, which may be changed."""
        first, stop, step = some.indices(self._count)
        count = len(range(first, stop, step))
        found = np.empty(count) if room is None or room.size < count else room[:count]
        size, done = step * max(1, _ROWS // step), 0
        for start in range(first, stop, size):
            values = self._written.read(start, min(start + size, stop))[::step, j]
            found[done : done + values.size] = values
            done += values.size
        return found
