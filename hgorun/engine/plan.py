"""A run as tables: segments between events, what happens at events, where output is wanted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from hgorun.engine.work import work_up_to

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_OF_ACTIONS = np.array([0, 0, 0, 0, 1, 1, 0])  # the counts of a segment that number actions


@dataclass(frozen=True, eq=False, repr=False)
class Kept:
    """Some of the samples that are measured in a part of a run, and where they are kept.

    Attributes
    ----------
    slots, places : slice
        Of the part, and among all that is kept of the run.
    """

    slots: slice
    places: slice


@dataclass(frozen=True, eq=False, repr=False)
class PartNumbers:
    """What is measured in a part of a run whose samples are numbered anew in every part.

    Attributes
    ----------
    gain, bias, holds : ndarray
        As those of a :class:`Plan`.
    kept : tuple of Kept
    """

    gain: Floats
    bias: Floats
    holds: Floats
    kept: tuple[Kept, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Segments:
    """Some segments one after the other, and what happens at the events that they start with.

    Attributes
    ----------
    spans, counts, actions, advance
        As those of a :class:`Plan`; the ranges of actions are those of these segments.
    numbers : PartNumbers, optional
        In place of those of the plan.
    """

    spans: Floats
    counts: Integers
    actions: Integers
    numbers: PartNumbers | None = None
    advance: Integers | None = None

    @property
    def size(self) -> int:
        """How many there are."""
        return len(self.counts) if self.advance is None else self.spans.size - 1

    @property
    def steps(self) -> int:
        """Of them all."""
        own = int(np.sum(self.counts[:, 2] - self.counts[:, 1]))
        return own if self.advance is None else own * (self.size // len(self.counts))

    @property
    def work(self) -> Integers | range:
        """About the steps of all segments up to each one, and one more for what happens before each."""
        if self.advance is None:
            return work_up_to(self.counts)
        each = self.steps // self.size + 1
        return range(each, each * self.size + 1, each)

    def with_rows_anywhere(self) -> Segments:
        """The same where output points may lie anywhere in the steps."""
        counts = self.counts.copy()
        counts[:, 6] = 1
        return replace(self, counts=counts)

    def begun_before(self, t: float) -> Segments:
        """The segments that begin before a time."""
        count = max(int(np.searchsorted(self.spans[:, 0], t, side="left")), 1)
        return replace(self, spans=self.spans[:count], counts=self.counts[:count])

    def ended_by(self, t: float) -> Segments:
        """The segments with ends no later than a time."""
        spans = self.spans.copy()
        spans[:, [1, 3]] = np.minimum(spans[:, [1, 3]], t)
        return replace(self, spans=spans)


@dataclass(frozen=True, eq=False, repr=False)
class Following:
    """The rest of a long run, which is tabulated part by part while it is carried out.

    Attributes
    ----------
    parts : callable
    steps, work : int
        Its steps, and about how many there are together with its segments.
    end : float
        When the run ends.
    """

    parts: Callable[[], Iterator[Segments]]
    steps: int
    work: int
    end: float


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Plan:
    """Everything of a run that is known before it starts.

    Attributes
    ----------
    spans : ndarray, shape (segments, 4)
        Start and end of each segment, and the times at which functions of time are evaluated there: a few
        ulp inside where such a function has a kink or a jump.
    counts : ndarray of int64, shape (segments, 7)
        Number of equal steps between the two events, the first and last step of this piece of them,
        regime, range of actions, and whether the slope at the end is needed.
    actions : ndarray of int64, shape (actions, 5)
        Kind, output, slot or index, and a range of slots.
    advance : ndarray of int64, shape (actions, 5), optional
        Of segments that are alike, by how much the words of each action are more from one event to the next; then
        ``spans`` are times alone, shape (segments + 1,), and ``counts`` is one row, or two of segments that are cut.
    grid : ndarray, shape (rows,)
        Output times.
    slots : int
        Samples on their way, over all outputs.
    gain, bias : ndarray, shape (slots,)
        A measured sample is gain * output + bias.
    holds : ndarray, shape (hold values,)
        Successive values of held noise.
    reach : float
        The longest continuous delay.
    origin : float
        What is added to a time where it is told to somebody.
    snapshots : int
        States that are kept at a time, to go back to them.
    following : Following, optional
        What comes behind these segments, where they are not those of the whole run.
    numbers : PartNumbers, optional
        Of the first part, where every part has its own.
    kept : int
        How many samples are kept then.
    """

    spans: Floats
    counts: Integers
    actions: Integers
    grid: Floats
    slots: int
    gain: Floats
    bias: Floats
    holds: Floats
    reach: float = 0.0
    origin: float = 0.0
    snapshots: int = 0
    following: Following | None = None
    numbers: PartNumbers | None = None
    kept: int = 0
    advance: Integers | None = None

    def with_grid(self, grid: Floats) -> Plan:
        """The same with other output times, which may lie anywhere in its steps."""
        return replace(self._each(Segments.with_rows_anywhere), grid=grid)

    def up_to(self, t: float) -> tuple[Plan, Segments]:
        """The same without the segments that do not begin before a time, and the last one that does."""
        last = next(self.parts())
        for part in self.parts():
            if part.spans[0, 0] < t:
                last = part
            if part.spans[-1, 0] >= t:
                break
        begun = last.begun_before(t)
        only = replace(begun, spans=begun.spans[-1:], counts=begun.counts[-1:])
        plan = self._each(lambda part: part.begun_before(t))
        if plan.following is not None:
            following = plan.following

            def begun_parts() -> Iterator[Segments]:
                return takewhile(lambda part: bool(part.spans[0, 0] < t), following.parts())

            plan = replace(plan, following=replace(following, parts=begun_parts))
        return plan, only

    def ended_by(self, t: float) -> Plan:
        """The same with ends of segments no later than a time: what happens there does, and no step is made."""
        return self._each(lambda part: part.ended_by(t))

    def _each(self, change: Callable[[Segments], Segments]) -> Plan:
        """The same with every part changed."""
        assert self.advance is None
        own = change(self._own)
        following = self.following
        if following is not None:
            parts = following.parts
            following = replace(following, parts=lambda: map(change, parts()))
        return replace(self, spans=own.spans, counts=own.counts, following=following)

    def whole(self) -> Plan:
        """The same with the segments of the whole run at once."""
        if self.following is None:
            return self
        assert self.numbers is None
        parts = list(self.parts())
        first = np.cumsum([0, *(len(part.actions) for part in parts[:-1])])
        counts = [part.counts + at * _OF_ACTIONS for part, at in zip(parts, first, strict=True)]
        return replace(
            self,
            spans=np.concatenate([part.spans for part in parts]),
            counts=np.concatenate(counts),
            actions=np.concatenate([part.actions for part in parts]),
            following=None,
        )

    def parts(self) -> Iterator[Segments]:
        """The segments of the whole run, some of them at a time."""
        yield self._own
        if self.following is not None:
            yield from self.following.parts()

    @property
    def _own(self) -> Segments:
        return Segments(self.spans, self.counts, self.actions, self.numbers, self.advance)

    @property
    def steps(self) -> int:
        """Steps of the whole run (fixed step)."""
        return self._own.steps if self.following is None else self._own.steps + self.following.steps

    @property
    def work(self) -> int:
        """Steps and segments of the whole run."""
        own = self._own.steps + self._own.size
        return own if self.following is None else own + self.following.work

    @property
    def span(self) -> float:
        """How long the run lasts."""
        end = self.spans[-1, 1] if self.following is None else self.following.end
        return float(end - self.spans[0, 0])
