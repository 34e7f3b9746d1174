"""What the members of an ensemble differ in, what is made of their rows, and what is found of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from hgorun.engine.many import Reducer
from hgorun.engine.plan import Floats, Integers


@dataclass(frozen=True, kw_only=True, eq=False)
class MemberNumbers:
    """The numbers of N runs; of any strides, so that a transposed array costs nothing.

    Attributes
    ----------
    z0 : ndarray, shape (states, N)
    p : ndarray, shape (parameters, N)
    gain, bias : ndarray, shape (slots, N), or (slots,) where all have the same
    holds : ndarray, shape (hold values, N) or (hold values,)
        These three take the place of the plan's.
    bound : (offset, factor)
        As in :class:`~hgorun.engine.program.Start`.
    awaited : ndarray, shape (observers, N), optional
        One for each observer without which the run of a member need not go on, else zero: it may end when nothing is
        left of them any more. Then the rows behind that tell nothing of all else.
    """

    z0: Floats
    p: Floats
    gain: Floats
    bias: Floats
    holds: Floats
    bound: tuple[float, float] = (1e6, 1e6)
    awaited: Floats = field(default_factory=lambda: np.zeros((0, 1)))

    @property
    def count(self) -> int:
        """N."""
        return int(self.z0.shape[1])

    def named(self, name: str) -> Floats:
        """The numbers that the engine calls ``z``, ``p``, ``gain``, ``bias``, ``holds``, ``awaited``."""
        numbers: Floats = getattr(self, {"z": "z0"}.get(name, name))
        return numbers

    def some(self, which: slice) -> MemberNumbers:
        """Some of them, as views."""
        parts = {name: getattr(self, name) for name in ("z0", "p", "gain", "bias", "holds", "awaited")}
        return replace(self, **{name: part[:, which] if part.ndim == 2 else part for name, part in parts.items()})


class Reduction(Protocol):
    """What is made of the rows of a member."""

    @property
    def size(self) -> int:
        """So many numbers a member."""
        ...

    @property
    def states(self) -> Sequence[int] | None:
        """The states that are in the rows where it is compiled and rows are not kept; all of them where it is None."""
        ...

    def reducer(self, lanes: int, *, whole: int | None) -> Reducer | None:
        """Compiled, with memory for a thread of its own; None where it cannot be.

        Parameters
        ----------
        whole : int or None
            How many states the rows hold, where these are all of them.
        """
        ...

    def finished(self, found: Floats) -> Floats:
        """The numbers, shape (size, N), from what the reducer has found, shape (reducer.size, N)."""
        ...

    def of(self, rows: Floats, p: Floats) -> Floats:
        """The numbers of some members, not compiled.

        Parameters
        ----------
        rows : ndarray, shape (grid points, states, members)
        p : ndarray, shape (parameters, members)

        Returns
        -------
        ndarray, shape (size, members)
        """
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """What N runs have given, the last axis counts the members.

    Attributes
    ----------
    reduced : ndarray, shape (reduction.size, N)
        Without a reduction, no rows.
    diverged : ndarray, shape (observers, N)
        Time of divergence of each observer, infinity where there was none.
    plant_diverged : ndarray, shape (N,)
        When the plant did; other numbers of such a member mean nothing. Infinity where it did not. Minus infinity of
        controlled steps where none was small enough, or more would have had to be tried than may be.
    first, last : ndarray, shape (states, N)
        The states at the first and at the last point of the grid; at the first one, of a compiled reduction those
        that are not in the rows have their initial values.
    error : ndarray, shape (states, N)
        Largest local error estimate of an embedded method where rows were asked for, zeros otherwise.
    rows : ndarray, shape (grid points, states, N), or None
        Where they were asked for.
    tries : ndarray of int64, shape (N,)
        Steps that were tried, where they are controlled; zeros otherwise.
    """

    reduced: Floats
    diverged: Floats
    plant_diverged: Floats
    first: Floats
    last: Floats
    error: Floats
    rows: Floats | None = None
    tries: Integers
