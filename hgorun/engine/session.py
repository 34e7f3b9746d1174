"""A run that is carried out piece by piece; between the pieces its state may be looked at, and changed."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hgorun.engine.layout import ACTION_WORDS, ARRIVE, DONE, NOTHING, REBASE, RECORD, RETAKE, SAVE, TAKE
from hgorun.engine.memory import Raw, Start
from hgorun.engine.plan import Floats, Integers, Plan
from hgorun.engine.program import Program
from hgorun.engine.turns import without
from hgorun.errors import SimulationError

_AT_ONCE = 4096  # segments between two checks for Ctrl-C


# What changes with every step; what is told of a sample or an output point has a place of its own, and is told anew.
_CHANGING = ("z", "w", "channels", "diverged", "lost", "largest", "hints", "error", "size", "own")


@dataclass(frozen=True, eq=False, repr=False)
class Mark:
    """A moment of a session.

    Attributes
    ----------
    at : int
        The segment that comes next.
    context : ndarray
    arrays : mapping of str to ndarray
        What changes with every step.
    slots : sequence of (slice, ndarray)
        What is kept of samples, of those that change.
    """

    at: int
    context: Integers
    arrays: Mapping[str, np.ndarray]
    slots: Sequence[tuple[slice, Floats]] = ()


@dataclass(frozen=True, eq=False, repr=False)
class _Touching:
    """What happens to the samples of a channel.

    Attributes
    ----------
    begin, end : ndarray of int, shape (N,)
        Of each action, to which samples.
    first, last : ndarray of int, shape (segments,)
        The actions of each segment among these.
    """

    begin: Integers
    end: Integers
    first: Integers
    last: Integers


class Session:
    """A run of a program with fixed steps, on one lane.

    Parameters
    ----------
    program : Program
    plan : Plan
        With the segments of the whole run.
    start : Start
    late : bool
        Whether samples are taken before they are known: what is kept of them changes until they arrive.
    """

    def __init__(self, program: Program, plan: Plan, start: Start, *, late: bool = False) -> None:
        self._program, self._plan = program, plan
        self._late = late
        self._memory = program.memory(plan, start)
        self._at = 0
        self._happened = 0, np.zeros((0, ACTION_WORDS), dtype=np.int64)  # the segment, and the actions

    @property
    def z(self) -> Floats:
        """All states, shape (states,): a view."""
        return self._view("z")

    @property
    def w(self) -> Floats:
        """What is held, as :class:`~hgorun.engine.layout.Held` lays it out: a view."""
        return self._view("w")

    @property
    def innovations(self) -> Floats:
        """What is kept of samples that have arrived, shape (slots, noted), first each C xhat - y: a view."""
        found: Floats = self._memory.arrays["innovations"][:, :, 0]
        return found

    def arriving(self, slots: Collection[int]) -> Floats:
        """What is kept of some samples since they were taken, shape (N, width), copied."""
        return self._slots[list(slots)]

    def _view(self, name: str) -> Floats:
        found: Floats = self._memory.arrays[name].reshape(-1)
        return found

    def advance(self, stop: int) -> None:
        """Go on to the start of segment ``stop``, before what happens there."""
        while self._at < stop:
            self._go_on(min(stop, self._at + _AT_ONCE))

    def _go_on(self, stop: int) -> None:
        """Go on to the start of a segment in one native call."""
        self._at = stop
        if self._program.go_on(self._memory, stop) != DONE:
            raise SimulationError(f"the run cannot go on at t = {self._memory.real('now'):.6g}")

    @property
    def actions(self) -> Integers:
        """What happens at the start of the next segment: rows of the action table, copied."""
        return self._rows(self._at).copy()

    def happen(self, actions: Integers, *, again: bool = False) -> None:
        """Go through the next segment, which has no steps, as if other actions were in the table.

        Parameters
        ----------
        actions : ndarray of int
            As many as :attr:`actions`.
        again : bool
            Whether the same segment comes next.
        """
        here, rows = self._at, self._rows(self._at)
        kept = rows.copy()
        rows[:] = actions
        try:
            self.advance(here + 1)
        finally:
            rows[:] = kept  # the tables may be those of another run, too
        self._happened = here, actions
        if again:
            self._at = self._memory["segment"] = here

    def _rows(self, segment: int) -> Integers:
        first, last = self._plan.counts[segment, 4:6]
        rows: Integers = self._memory.arrays["actions"].reshape(-1, ACTION_WORDS)[first:last]
        return rows

    def mark(self, stop: int) -> Mark:
        """This moment of a run without continuous delays, to go back to while it has not passed segment ``stop``."""
        memory = self._memory
        changing = {name: memory.arrays[name].copy() for name in _CHANGING}
        places = self._touched(self._at, stop) if self._late else []
        return Mark(self._at, memory.context.copy(), changing, [(one, self._slots[one].copy()) for one in places])

    @property
    def _slots(self) -> Floats:
        """What is kept of every sample, shape (slots, width): a view."""
        return self._view("slots").reshape(-1, self._program.system.width)

    def _touched(self, first: int, stop: int) -> list[slice]:
        """The samples to which something happens in some segments: of each channel, whose samples lie in their order.

        A log may have very many, and few of them are on their way at once.
        """
        places = [(one, one.first[first], one.last[stop - 1]) for one in self._touching]
        return [slice(int(one.begin[a:b].min()), int(one.end[a:b].max())) for one, a, b in places if a < b]

    @cached_property
    def _touching(self) -> list[_Touching]:
        """Of every channel."""
        rows = self._memory.arrays["actions"].reshape(-1, ACTION_WORDS)
        op, rebased = rows[:, 0], rows[:, 0] == REBASE
        begin, end = np.where(rebased, rows[:, 3], rows[:, 2]), np.where(rebased, rows[:, 4], rows[:, 2] + 1)
        does = (op == TAKE) | (op == RETAKE) | (op == ARRIVE) | (op == RECORD) | (rebased & (begin < end))
        found = []
        for channel in np.unique(rows[does, 1]):
            own = np.flatnonzero(does & (rows[:, 1] == channel))
            bounds = (np.searchsorted(own, self._plan.counts[:, word]) for word in (4, 5))
            found.append(_Touching(begin[own], end[own], *bounds))
        return found

    def go_back(self, mark: Mark) -> None:
        """Go on from a moment that has been marked; what was told since then is told again."""
        memory = self._memory
        self._at = mark.at
        memory.context[:] = mark.context
        for name, values in mark.arrays.items():
            memory.arrays[name][...] = values
        for place, kept in mark.slots:
            self._slots[place] = kept

    @property
    def happened(self) -> Integers:
        """What :meth:`happen` has done."""
        return self._happened[1]

    def happened_without(
        self, samples: Collection[tuple[int, int]], z: Floats, w: Floats, arriving: Mapping[int, Floats]
    ) -> tuple[Floats, Floats]:
        """As :meth:`happened_as`, without some of the samples, (channel, slot) each."""
        flags = [self._program.system.held.fresh(channel) for channel, _ in samples]
        return self.happened_as(without(self.happened, samples, flags), z, w, arriving)

    def happened_as(
        self, actions: Integers, z: Floats, w: Floats, arriving: Mapping[int, Floats]
    ) -> tuple[Floats, Floats]:
        """All states, and what is held, if other actions than :attr:`happened` had been in the table.

        Nothing follows from it.

        Parameters
        ----------
        actions : ndarray of int
        z, w : ndarray
            The states, and what was held, before.
        arriving : mapping of int to ndarray
            By slot, what was kept of the samples before: see :meth:`arriving`.
        """
        memory, here = self._memory, self._happened[0]
        kept = {name: memory.arrays[name].copy() for name in ("z", "w", "diverged")}
        arrays = self._slots, memory.arrays["innovations"]
        of_samples = [(array, one, array[one].copy()) for one in self._touched(here, here + 1) for array in arrays]
        words = {name: memory[name] for name in ("row", "ring_count", "segment")}
        rows = self._rows(here)
        own = rows.copy()
        rows[:] = actions
        rows[rows[:, 0] == SAVE, 0] = NOTHING
        self.z[...], self.w[...] = z, w
        for slot, row in arriving.items():
            self._slots[slot] = row
        memory["segment"] = here
        try:
            if self._program.go_on(memory, here + 1) != DONE:
                raise SimulationError(f"the run cannot go on at t = {memory.real('now'):.6g}")
            return self.z.copy(), self.w.copy()
        finally:
            rows[:] = own
            for name, values in kept.items():
                memory.arrays[name][...] = values
            for array, one, values in of_samples:
                array[one] = values
            for name, word in words.items():
                memory[name] = word

    def finish(self) -> Raw:
        """The rest of the run, and what it has given."""
        self.advance(len(self._plan.counts))
        return self._memory.result(self._plan.steps)
