"""Output points of a long run, some at a time: what is handed on need not fit into memory."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from hgorun.engine.plan import Floats

Take = Callable[[Floats, Floats], None]
"""What is done with some rows, one after the other: their times, shape (N,), and all states, shape (N, states).

Both are overwritten afterwards.
"""

_ROOM = 1 << 21  # bytes of rows: enough of them for what is done with each part to cost little beside them
_CALLED = ctypes.CFUNCTYPE(None, ctypes.c_void_p)


class Window:
    """A part of the output grid that goes along it, on one lane.

    Parameters
    ----------
    grid : ndarray, shape (Nt,)
        All output times.
    states : int
        Numbers of a row.
    take : callable
        Gets all rows, some of them at a time.
    room : int, optional
        So many rows at a time.
    """

    def __init__(self, grid: Floats, states: int, take: Take, room: int | None = None) -> None:
        self.room = max(1, _ROOM // (8 * max(states, 1))) if room is None else room
        self._whole, self._take, self._first = grid, take, 0
        self.grid, self.rows = np.empty(self.room + 1), np.empty((self.room, states, 1))
        self._row = np.zeros(1, dtype=np.int64)
        self._failed: BaseException | None = None
        self._function = _CALLED(self._full)
        self._fill()

    @property
    def address(self) -> int:
        """Of the function that the native code calls when there is no room left."""
        return ctypes.cast(self._function, ctypes.c_void_p).value or 0

    def counts_in(self, row: np.ndarray) -> None:
        """Where the native code counts the rows, an array of one integer."""
        self._row = row

    def check(self) -> None:
        """Raise what has been raised while rows were taken: nothing can be raised through native code."""
        if self._failed is not None:
            raise self._failed

    def finish(self, last: Floats) -> None:
        """Hand on what is left.

        Parameters
        ----------
        last : ndarray, shape (states,)
            The state at the end, which all rows have that were not reached before.
        """
        self.check()
        while self._first < self._whole.size:
            self.rows[int(self._row[0]) :] = last[:, None]
            self._hand_on(min(self.room, self._whole.size - self._first))

    def _fill(self) -> None:
        """The next times, then one that is never reached."""
        times = self._whole[self._first : self._first + self.room]
        self.grid[: times.size] = times
        self.grid[times.size] = np.inf
        self._row[0] = 0

    def _hand_on(self, count: int) -> None:
        self._take(self.grid[:count], self.rows[:count, :, 0])
        self._first += count
        self._fill()

    def _full(self, _: int) -> None:
        try:
            self._hand_on(self.room)
        except BaseException as error:
            self._failed = error
            self.grid[0], self._row[0] = np.inf, 0  # nothing more is written
