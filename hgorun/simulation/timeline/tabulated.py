"""Segments between events, and what happens at each event, from a schedule."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hgorun.engine.layout import HybridSystem
from hgorun.engine.plan import Following, Segments
from hgorun.native.places import places_in
from hgorun.simulation.timeline.actions import Actions
from hgorun.simulation.timeline.recorded_inputs import RecordedInputs
from hgorun.simulation.timeline.segment_rows import segment_rows
from hgorun.simulation.timeline.steps import (
    count_steps,
    counted_steps,
    in_pieces,
    steps_of_a_piece,
    unevenly,
    unevenly_alike,
)
from hgorun.simulation.timeline.timeline import Stepping, Timeline

_PART_EVENTS = 1 << 14  # of a part: its tables stay in the processor's cache


def long_from() -> int:
    """From how many events on tables are made part by part."""
    return 2 * _PART_EVENTS


@dataclass(frozen=True, eq=False, repr=False)
class Tables:
    """The engine's tables of a run without its numbers.

    Attributes
    ----------
    segments : Segments
    slots : int
        Samples on their way, over all outputs.
    values : ndarray
        What is set beside noise and recorded inputs.
    snapshots : int
        States that are kept at a time.
    """

    segments: Segments
    slots: int
    values: np.ndarray
    snapshots: int


class Stretchwise:
    """What runs that follow each other share: at their events the same happens, as a rule.

    Attributes
    ----------
    last : Tabulated or None
        That of the run before.
    """

    KEPT = 8  # tables of the parts of a run

    def __init__(self) -> None:
        self.last: Tabulated | None = None


class Tabulated:
    """The tables of a run, of as many of its events as are asked for.

    Parameters
    ----------
    timeline : Timeline
    system : HybridSystem
    stepping : Stepping
    inputs : RecordedInputs, optional
        As those of :func:`~hgorun.simulation.timeline.tables.build_plan`.
    piece : int, optional
        Steps of a piece, where they are counted for more than these events.
    before : Tabulated, optional
        Of other events, whose tables are taken over as far as the same happens.
    kept : int
        Parts whose tables are kept.
    """

    def __init__(
        self,
        timeline: Timeline,
        system: HybridSystem,
        stepping: Stepping,
        inputs: RecordedInputs | None = None,
        *,
        piece: int | None = None,
        before: Tabulated | None = None,
        kept: int = 1,
    ) -> None:
        self.schedule, self.grid, self.stepping = timeline.events, timeline.grid, stepping
        self.always_slope = system.remembers or stepping.always_slope
        schedule = self.schedule
        self.actions: Actions
        if before is not None and schedule.alike is not None and schedule.alike == before.schedule.alike:
            self.actions = before.actions
        else:
            self.actions = Actions(schedule, timeline.channels, system, inputs, kept)
            if before is not None:
                self.actions.take_from(before.actions)
        self._piece = piece

    @cached_property
    def order(self) -> np.ndarray:
        """The events that are carried out, one after the other."""
        order = self.schedule.order
        return np.arange(self.schedule.size) if order is None else order.event

    @cached_property
    def steps(self) -> int:
        """All steps of the run."""
        return self.stepping.total(self.schedule)

    @cached_property
    def piece(self) -> int:
        """How many of them are a piece."""
        return steps_of_a_piece(self.steps) if self._piece is None else self._piece

    def whole(self) -> Tables:
        """All of a run."""
        return self._tables(self.segments(0, self.order.size))

    def in_parts(self) -> tuple[Tables, Following]:
        """The first events of a run, and the others part by part."""
        count = self.schedule.events.size
        first = self.segments(0, _PART_EVENTS)
        steps = self.steps - int(np.sum(first.counts[:, 2] - first.counts[:, 1]))

        def rest() -> Iterator[Segments]:
            for start in range(_PART_EVENTS, count, _PART_EVENTS):
                yield self.segments(start, min(start + _PART_EVENTS, count))

        following = Following(rest, steps, steps + count - _PART_EVENTS, float(self.schedule.events[-1]))
        return self._tables(first), following

    def alike(self) -> Tables | None:
        """All of a run of which nothing is told of each segment but when it begins and ends; None of others.

        Nothing happens at its last event.
        """
        schedule, stepping = self.schedule, self.stepping
        if schedule.order is not None or any((*schedule.inward.strides, *schedule.variant.strides, schedule.inward[0])):
            return None  # where these are the same of all events, that shows in memory
        repeated, steps = self.actions.repeated, counted_steps(schedule, stepping.longest).steps
        if repeated is None or steps.size > 1 or steps[0] >= self.piece:
            return None
        actions, advance = repeated
        # the slope at the end of a segment is needed where output points may lie inside of it
        slope = self.always_slope or not np.array_equal(self.grid, schedule.events)
        times = schedule.events
        counts = np.array([[steps[0], 0, steps[0], schedule.variant[0], 0, len(actions), slope]])
        if stepping.uneven is not None:
            times, counts = unevenly_alike(times, counts[0], stepping.uneven)
        return self._tables(Segments(times, counts, actions, advance=advance))

    def _tables(self, segments: Segments) -> Tables:
        return Tables(segments, self.actions.slots, self.actions.values, self.actions.snapshots)

    def segments(self, first: int, stop: int) -> Segments:
        """From event ``first`` on, with what happens at the events before ``stop``.

        Behind the last event of the run, one more segment without steps has what happens at the very end.
        """
        piece = self.piece  # the steps of the whole run are counted for it: too many are refused
        actions, places = self.actions.at(first, stop)
        last = stop == self.order.size
        tabulated = self._in_order if self.schedule.order is None else self._in_any_order
        spans, counts = tabulated(first, stop - 1 if last else stop, places)
        if self.stepping.uneven is not None:
            spans, counts = unevenly(spans, counts, self.stepping.uneven)
        if self.steps - self.order.size + 2 > piece:  # so many may be in one, if each of the others has one
            spans, counts = in_pieces(spans, counts, piece)
        if last:
            end = np.array([[1, 0, 0, self.schedule.variant[-1], places[-2], places[-1], 0]])
            spans = np.concatenate([spans, np.full((1, 4), self.schedule.events[-1])])
            counts = np.concatenate([counts, end])
        return Segments(spans, counts, actions)

    def _in_order(self, first: int, stop: int, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Spans and counts from event ``first`` to ``stop`` of a run that never goes back in time."""
        events, inward = (of[first : stop + 1] for of in (self.schedule.events, self.schedule.inward))
        variant = self.schedule.variant[first:stop]
        longest = self.stepping.longest
        return segment_rows(events, inward, variant, places, self.grid, longest, always_slope=self.always_slope)

    def _in_any_order(self, first: int, stop: int, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same of a run that late samples take back."""
        events, inward, variant = self.schedule.events, self.schedule.inward, self.schedule.variant
        left = self.order[first:stop]
        right = left + 1
        steps = count_steps(events[right] - events[left], self.stepping.longest)
        slope = 1 if self.always_slope else rows_in_last_steps(events[left], events[right], steps, self.grid)
        inside = events[left] + inward[left], events[right] - inward[right]
        spans = _columns(float, events[left], events[right], *inside)
        of_segments = places[: steps.size], places[1 : steps.size + 1]
        return spans, _columns(np.int64, steps, 0, steps, variant[first:stop], *of_segments, slope)


def _columns(kind: type[np.generic] | type[float], *columns: np.ndarray | int) -> np.ndarray:
    """Columns side by side; what is one number is so in every row."""
    rows = max(np.size(column) for column in columns if isinstance(column, np.ndarray))
    table = np.empty((rows, len(columns)), dtype=kind)
    for i, column in enumerate(columns):
        table[:, i] = column
    return table


def rows_in_last_steps(start: np.ndarray, end: np.ndarray, steps: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Whether an output point lies strictly inside the last step of each of some segments, in any order."""
    h = (end - start) / steps
    snap = 1e-9 * h + 1e-15 * np.maximum(np.abs(start), np.abs(end))
    behind = places_in(grid, end - snap)  # whether the last one before the end is in the step
    return np.asarray((behind > 0) & (grid[np.maximum(behind, 1) - 1] > end - h + snap))
