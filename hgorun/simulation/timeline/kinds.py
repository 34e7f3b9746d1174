"""Actions of one kind, as columns of the engine's action table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.engine.layout import ACTION_WORDS
from hgorun.memo import Memo, same


@dataclass(frozen=True)
class Numbered:
    """The number of each thing, counted from ``first`` on in steps: an array that takes no memory."""

    first: int
    step: int = 1

    def __getitem__(self, items: slice) -> np.ndarray:
        return self.first + self.step * np.arange(items.start, items.stop)


_KEPT = 1 << 17  # events whose order is kept in memory
_IN_ORDER: Memo[bool] = Memo(8)


def _in_order(event: np.ndarray) -> bool:
    """Whether events ascend; many kinds of actions happen at the same ones."""

    def told() -> bool:
        return not np.any(event[1:] < event[:-1])

    return _IN_ORDER.get(same(event), told) if event.size <= _KEPT else told()


Column = int | np.ndarray | Numbered


@dataclass(frozen=True, eq=False, repr=False)
class Kind:
    """Actions of one kind, in the order of their events.

    Attributes
    ----------
    event : ndarray of int, shape (N,)
        At which each happens, ascending.
    rank : int
        Before which others at the same event, from -5 on.
    columns : tuple
        Of the action table: one number for all, or an array, shape (N,).
    """

    event: np.ndarray
    rank: int
    columns: tuple[Column, ...]

    @classmethod
    def of(cls, event: np.ndarray, rank: int, *columns: Column) -> Kind:
        """In the order of their events."""
        if not _in_order(event):
            order = np.argsort(event, kind="stable")
            every = slice(0, event.size)
            columns = tuple(c if isinstance(c, int) else np.asarray(c[every])[order] for c in columns)
            event = event[order]
        return cls(event, rank, columns)

    def equals(self, other: Kind) -> bool:
        """Whether it says the same as another one."""
        return (
            self.rank == other.rank
            and (self.event is other.event or np.array_equal(self.event, other.event))
            and len(self.columns) == len(other.columns)
            and all(map(_equal, self.columns, other.columns))
        )

    def at(self, items: np.ndarray, event: np.ndarray) -> Kind:
        """Some of them, some several times, at other events."""
        every = slice(0, self.event.size)
        columns = [c if isinstance(c, int) else np.asarray(c[every])[items] for c in self.columns]
        return Kind.of(event, self.rank, *columns)

    @property
    def constants(self) -> list[int]:
        """The columns that are one number for all; zero in place of the others, and of those that are missing."""
        given = [column if isinstance(column, int) else 0 for column in self.columns]
        return given + [0] * (ACTION_WORDS - len(given))

    def write(self, rows: np.ndarray, items: slice, *, constants: bool = True) -> None:
        """Some of them as rows of the table; ``constants``: with those of their columns that are one number for all."""
        if constants:
            rows[:] = self.constants
        for i, column in enumerate(self.columns):
            if not isinstance(column, int):
                rows[:, i] = column[items]


def _equal(a: Column, b: Column) -> bool:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return isinstance(a, np.ndarray) and isinstance(b, np.ndarray) and np.array_equal(a, b)
    return a == b
