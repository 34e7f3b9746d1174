"""From a schedule to the engine's tables: segments between events, and what happens at each event."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import islice

import numpy as np

from hgorun.engine.layout import HybridSystem
from hgorun.engine.plan import Following, Kept, PartNumbers, Plan, Segments
from hgorun.measurement.channels import Channel, joined
from hgorun.measurement.late import HeardOtherwise
from hgorun.measurement.long import AnySchedule, LongSchedule, Part
from hgorun.measurement.schedule import Schedule
from hgorun.memo import Memo, same
from hgorun.simulation.actions import Actions, RecordedInputs
from hgorun.simulation.steps import count_steps, counted_steps, in_pieces, steps_of_a_piece, unevenly
from hgorun.symbolic.levels import distinct


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


def build_plan(
    schedule: AnySchedule,
    channels: Sequence[Channel],
    grid: np.ndarray,
    system: HybridSystem,
    *,
    always_slope: bool,
    longest: float,
    reach: float,
    origin: float = 0.0,
    uneven: float | None = None,
    inputs: RecordedInputs | None = None,
    samples: Sequence[np.ndarray] | None = None,
    in_parts: bool = False,
) -> Plan:
    """The engine's tables, with the numbers of a run.

    Parameters
    ----------
    schedule : Schedule or LongSchedule
    channels : sequence of Channel
    grid : ndarray
        Output times.
    system : HybridSystem
        What the plan is for.
    always_slope : bool
        The method needs the slope at the end of every segment.
    longest : float
        No step is longer; infinity for adaptive steps, where a segment is one piece.
    reach : float
        The longest continuous delay.
    origin : float
        The start of the run on the configuration's clock.
    uneven : float, optional
        For a run that is compared with one of even steps: so many steps for each of its steps, not even.
    inputs : RecordedInputs, optional
        Where the system takes its inputs from the tables.
    samples : sequence of ndarray, shape (Nk,) each, optional
        What arrives of every output, where it is recorded: the system's own outputs are zero then. The channels of
        the outputs come first.
    in_parts : bool
        A plan of many events may be given part by part, so that its tables need not fit into memory.
    """
    if in_parts and isinstance(schedule, LongSchedule) and not system.remembers:
        return _Long(schedule, grid, system, always_slope, longest, uneven).plan(origin)
    key = schedule, system, same(grid), always_slope, longest, uneven, None if inputs is None else same(inputs)
    events = schedule if isinstance(schedule, Schedule) else schedule.whole
    tabulated = partial(_Tabulated, events, channels, grid, system, always_slope, longest, uneven, inputs)
    following = None
    if in_parts and schedule.size > 2 * _PART_EVENTS and not system.remembers and schedule.order is None:
        tables, following = tabulated().in_parts()
    else:
        tables = _TABLES.get(key, lambda: tabulated().whole())
    changes = [channel.held_changes[1] for channel in channels]
    recorded = [] if inputs is None else inputs.values(channels, before=bool(system.stepped))
    if samples is None:
        measured = [channel.gain_and_bias for channel in channels]
    else:
        measured = [(np.ones(values.size), values) for values in _recorded(channels, samples)]
    return Plan(
        spans=tables.segments.spans,
        counts=tables.segments.counts,
        actions=tables.segments.actions,
        grid=grid,
        slots=tables.slots,
        gain=joined([gain for gain, _ in measured]),
        bias=joined([bias for _, bias in measured]),
        holds=np.concatenate([np.zeros(0), *changes, tables.values, *recorded]),
        reach=reach,
        origin=origin,
        snapshots=tables.snapshots,
        following=following,
    )


def _recorded(channels: Sequence[Channel], samples: Sequence[np.ndarray]) -> Iterator[np.ndarray]:
    """What arrives in every channel, from what arrives of every output."""
    known = {id(channel): np.asarray(values, dtype=float) for channel, values in zip(channels, samples, strict=False)}
    for channel in channels:
        if isinstance(channel, HeardOtherwise):
            yield known[id(channel.source)][channel.which]
        else:
            yield known[id(channel)]


_KEPT = 500_000  # actions and segments of tables that are kept in memory
_TABLES: Memo[Tables] = Memo(16, lambda tables: len(tables.segments.actions) + len(tables.segments.counts) < _KEPT)


_PART_EVENTS = 1 << 15  # of a part: its tables stay in the processor's cache


class _Tabulated:
    """The tables of a run, of as many of its events as are asked for; parameters as of :func:`build_plan`."""

    def __init__(
        self,
        schedule: Schedule,
        channels: Sequence[Channel],
        grid: np.ndarray,
        system: HybridSystem,
        always_slope: bool,
        longest: float,
        uneven: float | None,
        inputs: RecordedInputs | None,
        piece: int | None = None,
        before: _Tabulated | None = None,
    ) -> None:
        self.schedule, self.grid, self.longest, self.uneven = schedule, grid, longest, uneven
        self.always_slope = system.remembers or always_slope
        self.actions = Actions(schedule.events, channels, system, inputs, schedule.order, schedule.acting)
        if before is not None:
            self.actions.take_from(before.actions)
        self._piece = piece
        # what is carried out, one after the other
        self.order = np.arange(schedule.events.size) if schedule.order is None else schedule.order.event

    @property
    def steps(self) -> int:
        """All steps of the run."""
        return _all_steps(self.schedule, self.longest, self.uneven)

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

    def _tables(self, segments: Segments) -> Tables:
        return Tables(segments, self.actions.slots, self.actions.values, self.actions.snapshots)

    def segments(self, first: int, stop: int) -> Segments:
        """From event ``first`` on, with what happens at the events before ``stop``.

        Behind the last event of the run, one more segment without steps has what happens at the very end.
        """
        events, inward, variant = self.schedule.events, self.schedule.inward, self.schedule.variant
        between = slice(first, min(stop, self.order.size - 1))
        left = self.order[between]
        right = left + 1
        steps = count_steps(events[right] - events[left], self.longest)
        slope = 1 if self.always_slope else _row_in_last_step(events[left], events[right], steps, self.grid)
        actions, places = self.actions.at(first, stop)
        inside = events[left] + inward[left], events[right] - inward[right]
        spans = _columns(float, events[left], events[right], *inside)
        of_segments = places[: steps.size], places[1 : steps.size + 1]
        counts = _columns(np.int64, steps, 0, steps, variant[between], *of_segments, slope)
        if self.uneven is not None:
            spans, counts = unevenly(spans, counts, self.uneven)
        spans, counts = in_pieces(spans, counts, self.piece)
        if stop == self.order.size:
            last = np.array([[1, 0, 0, variant[-1], places[-2], places[-1], 0]])
            spans, counts = np.concatenate([spans, np.full((1, 4), events[-1])]), np.concatenate([counts, last])
        return Segments(spans, counts.astype(np.int64, copy=False), actions)


@dataclass(frozen=True, eq=False, repr=False)
class _Long:
    """The tables of a run that is too long for them, part by part; parameters as of :func:`build_plan`."""

    schedule: LongSchedule
    grid: np.ndarray
    system: HybridSystem
    always_slope: bool
    longest: float
    uneven: float | None

    def plan(self, origin: float) -> Plan:
        """The plan of all parts, with the first of them."""
        first = next(self.parts())
        left = self._steps - int(np.sum(first.counts[:, 2] - first.counts[:, 1]))
        numbers = first.numbers
        assert numbers is not None
        return Plan(
            spans=first.spans,
            counts=first.counts,
            actions=first.actions,
            grid=self.grid,
            slots=numbers.gain.size,
            gain=numbers.gain,
            bias=numbers.bias,
            holds=numbers.holds,
            origin=origin,
            following=Following(
                lambda: islice(self.parts(), 1, None),
                left,
                left + counted_steps(self.schedule, self.longest).segments - len(first.counts),
                self.schedule.time.end,
            ),
            numbers=numbers,
            kept=sum(self._kept),
        )

    @property
    def _steps(self) -> int:
        return _all_steps(self.schedule, self.longest, self.uneven)

    @property
    def _kept(self) -> list[int]:
        """How many samples of every output are kept."""
        return [-(-c.samples.size // self.schedule.every) for c in self.schedule.channels]

    def parts(self) -> Iterator[Segments]:
        """The segments of the whole run, with the numbers of what is measured in them."""
        places, piece = np.cumsum([0, *self._kept]).tolist(), steps_of_a_piece(self._steps)
        tables: _Tabulated | None = None
        given = self.grid, self.system, self.always_slope, self.longest, self.uneven
        for part in self.schedule.parts():
            tables = _Tabulated(part.schedule, part.channels, *given, None, piece, tables)
            segments = tables.segments(0, part.schedule.size - (not part.last))
            measured = [channel.gain_and_bias for channel in part.channels]
            changes = [channel.held_changes[1] for channel in part.channels]
            numbers = PartNumbers(
                gain=joined([gain for gain, _ in measured]),
                bias=joined([bias for _, bias in measured]),
                holds=joined([*changes, tables.actions.values]),
                kept=self._places(part, places),
            )
            yield replace(segments, numbers=numbers)

    def _places(self, part: Part, places: Sequence[int]) -> tuple[Kept, ...]:
        """Which of the samples of a part are kept, and where."""
        every, found, base = self.schedule.every, [], 0
        for c, before, place in zip(part.channels, part.first, places, strict=False):
            skipped = -before % every
            if c.samples.size > skipped:
                some = slice(base + skipped, base + c.samples.size, every)
                first = place + (before + skipped) // every
                found.append(Kept(some, slice(first, first + len(range(c.samples.size)[skipped::every]))))
            base += c.samples.size
        return tuple(found)


def _columns(kind: type[np.generic] | type[float], *columns: np.ndarray | int) -> np.ndarray:
    """Columns side by side; what is one number is so in every row."""
    rows = max(np.size(column) for column in columns if isinstance(column, np.ndarray))
    table = np.empty((rows, len(columns)), dtype=kind)
    for i, column in enumerate(columns):
        table[:, i] = column
    return table


def _all_steps(schedule: AnySchedule, longest: float, uneven: float | None) -> int:
    counted = counted_steps(schedule, longest)
    return counted.total if uneven is None else counted.uneven(uneven)


def _row_in_last_step(start: np.ndarray, end: np.ndarray, steps: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Whether an output point lies strictly inside the last step before each event."""
    if grid.size < end.size:  # then every output point is asked for its segment
        i = np.searchsorted(end, grid)
        inside = (i < end.size) & (grid > start[np.minimum(i, end.size - 1)])
        found = np.zeros(end.size, dtype=bool)
        if inside.any():
            own = distinct(i[inside])
            found[own] = _row_in_last_step(start[own], end[own], steps[own], grid[inside])
        return found
    h = (end - start) / steps
    snap = 1e-9 * h + 1e-15 * np.maximum(np.abs(start), np.abs(end))
    first = np.searchsorted(grid, end - h + snap, side="right")
    return np.asarray(np.searchsorted(grid, end - snap, side="left") > first)
