"""From a schedule to the engine's tables: segments between events, and what happens at each event."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hgorun.engine.layout import ARRIVE, JUMP, REBASE, RECORD, SET, TAKE, Held, HybridSystem
from hgorun.engine.plan import Plan
from hgorun.errors import Problem
from hgorun.measurement.schedule import Channel, Schedule, nearest_event
from hgorun.memo import Memo, Same
from hgorun.symbolic.levels import distinct

_PIECE = 1 << 14  # steps between two checks for Ctrl-C, more only where there were too many pieces
_MAX_PIECES = 100_000
_MAX_STEPS = 1e10  # then a piece is still a matter of a second


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Tables:
    """The engine's tables of a run without its numbers.

    Attributes
    ----------
    spans, counts, actions, slots
        As in :class:`~hgorun.engine.plan.Plan`.
    intervals : ndarray
        The times between samples, for what jumps at them.
    """

    spans: np.ndarray
    counts: np.ndarray
    actions: np.ndarray
    slots: int
    intervals: np.ndarray


def build_plan(
    schedule: Schedule,
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
) -> Plan:
    """The engine's tables, with the numbers of a run.

    Parameters
    ----------
    schedule : Schedule
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
        What arrives of every output, where it is recorded: the system's own outputs are zero then.
    """
    key = schedule, system, Same(grid), always_slope, longest, uneven, None if inputs is None else Same(inputs)
    tables = _TABLES.get(key, lambda: _build(schedule, channels, grid, system, always_slope, longest, uneven, inputs))
    changes = [channel.held_changes[1] for channel in channels]
    recorded = [] if inputs is None else [inputs.values(channels)]
    measured = [channel.gain_and_bias for channel in channels]
    if samples is not None:
        measured = [(np.ones(values.size), np.asarray(values, dtype=float)) for values in samples]
    return Plan(
        spans=tables.spans,
        counts=tables.counts,
        actions=tables.actions,
        grid=grid,
        slots=tables.slots,
        gain=np.concatenate([np.zeros(0), *(gain for gain, _ in measured)]),
        bias=np.concatenate([np.zeros(0), *(bias for _, bias in measured)]),
        holds=np.concatenate([np.zeros(0), *changes, tables.intervals, *recorded]),
        reach=reach,
        origin=origin,
    )


_KEPT = 500_000  # actions and segments of tables that are kept in memory
_TABLES: Memo[Tables] = Memo(16, lambda tables: len(tables.actions) + len(tables.counts) < _KEPT)


def _build(
    schedule: Schedule,
    channels: Sequence[Channel],
    grid: np.ndarray,
    system: HybridSystem,
    always_slope: bool,
    longest: float,
    uneven: float | None,
    inputs: RecordedInputs | None,
) -> Tables:
    events = schedule.events
    gaps = np.diff(events)
    steps = count_steps(gaps, longest)
    table = _Actions(events, channels, system, inputs)
    always = system.remembers or always_slope
    slope = np.full(gaps.size, int(always))
    if not always:
        slope = _row_in_last_step(events, steps, grid).astype(int)
    inner = events[:-1] + schedule.inward[:-1], events[1:] - schedule.inward[1:]
    spans = np.column_stack([events[:-1], events[1:], *inner])
    counts = np.column_stack(
        [steps, np.zeros_like(steps), steps, schedule.variant, table.first[:-1], table.first[1:], slope]
    )
    if uneven is not None:
        spans, counts = _unevenly(spans, counts, uneven)
    spans, counts = in_pieces(spans, counts)
    # what happens at the very end: one more segment without steps
    last = np.array([[1, 0, 0, counts[-1, 3], table.first[-1], table.rows.shape[0], 0]])
    end = np.full((1, 4), events[-1])
    return Tables(
        spans=np.concatenate([spans, end]),
        counts=np.concatenate([counts, last]).astype(np.int64),
        actions=table.rows,
        slots=table.slots,
        intervals=table.intervals,
    )


def count_steps(gaps: np.ndarray, longest: float, key: str = "step") -> np.ndarray:
    """How many equal steps, none longer than ``longest``, each gap between two events takes.

    Parameters
    ----------
    gaps : ndarray
    longest : float
    key : str
        The solver's key that ``longest`` comes from.

    Raises
    ------
    Problem
        For more steps than a run can make.
    """
    with np.errstate(over="ignore", divide="ignore"):
        steps = np.maximum(np.ceil(gaps / longest * (1 - 1e-9)), 1)
        total = float(np.sum(steps))
    if not total <= _MAX_STEPS:
        raise Problem(
            ("solver", key),
            f"the run takes {total:.3g} steps of {longest:.3g}, at most {_MAX_STEPS:.0e} are possible: "
            f"increase solver.{key}" + (", or solver.method: rodas5p if the system is stiff" if key == "step" else ""),
        )
    return np.asarray(steps.astype(np.int64))


_PART = 0.5 * (3 - 5**0.5)  # of a gap, before its cut: no simple fraction


def uneven_steps(steps: np.ndarray, ratio: float) -> np.ndarray:
    """How many steps a gap takes in a run that is compared with one of ``steps`` even steps.

    Parameters
    ----------
    steps : ndarray of int
    ratio : float
        So many for each of them, two at least; where that would hardly be another number, one more.
    """
    other = np.maximum(np.round(ratio * steps).astype(np.int64), 2)
    return np.where((other >= steps) & (ratio < 1), steps + 1, other)


def _cut(total: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How many of the uneven steps of each gap lie before its cut, and how many behind it."""
    before = np.clip(np.round(_PART * total).astype(np.int64), 1, total - 1)
    return before, total - before


def part_of_difference(steps: np.ndarray, ratio: float, order: int) -> float:
    """How large the error of even steps is, for a difference of one to uneven ones.

    Parameters
    ----------
    steps : ndarray of int
        Even steps of every gap.
    ratio : float
        As in :func:`uneven_steps`.
    order : int
        With which errors fall with the step; where it is higher, what is found is too large.
    """
    even = distinct(steps)
    uneven = _cut(uneven_steps(even, ratio))
    own = even ** (-1.0 * order)
    parts = (_PART, 1 - _PART)
    other = sum(part ** (order + 1) / count ** (1.0 * order) for part, count in zip(parts, uneven, strict=True))
    return float(np.max(own / np.abs(other - own)))


def _unevenly(spans: np.ndarray, counts: np.ndarray, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Segments cut in two parts with even steps each, whose times are no simple fractions of the segment.

    Two runs with even steps share the zeros of many a sinusoid, whatever the numbers of their steps.
    """
    before, after = _cut(uneven_steps(counts[:, 0], ratio))
    cut = spans[:, 0] + _PART * (spans[:, 1] - spans[:, 0])
    cut = np.clip(cut, spans[:, 2], spans[:, 3])  # not outside of where functions of time are evaluated
    split_spans, split_counts = np.repeat(spans, 2, axis=0), np.repeat(counts, 2, axis=0)
    split_spans[::2, 1] = split_spans[::2, 3] = split_spans[1::2, 0] = split_spans[1::2, 2] = cut
    split_counts[::2, 0] = split_counts[::2, 2] = before
    split_counts[1::2, 0] = split_counts[1::2, 2] = after
    split_counts[1::2, 4] = split_counts[1::2, 5]  # nothing happens at the cut
    split_counts[:, 6] = 1
    return split_spans, split_counts


def _row_in_last_step(events: np.ndarray, steps: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Whether an output point lies strictly inside the last step before each event."""
    start, end = events[:-1], events[1:]
    h = np.diff(events) / steps
    snap = 1e-9 * h + 1e-15 * np.maximum(np.abs(start), np.abs(end))
    first = np.searchsorted(grid, end - h + snap, side="right")
    return np.asarray(np.searchsorted(grid, end - snap, side="left") > first)


def in_pieces(spans: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Long segments in pieces, so that the native code comes back soon; numbering of the steps goes on.

    A piece has 16,384 steps. In runs of more than 1.6e9 steps it is longer, since the pieces themselves
    take memory: up to 100,000 steps, well below a second for all but the largest systems.
    """
    piece = max(_PIECE, -(-int(counts[:, 0].sum()) // _MAX_PIECES))
    pieces = np.maximum(-(-counts[:, 0] // piece), 1)
    if np.all(pieces == 1):
        return spans, counts
    origin = np.repeat(np.arange(counts.shape[0]), pieces)
    part = np.arange(origin.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    new = counts[origin].copy()
    new[:, 1] = part * piece
    new[:, 2] = np.minimum((part + 1) * piece, new[:, 0])
    inner = new[:, 2] < new[:, 0]
    new[inner, 6] = 1
    new[part > 0, 4] = new[part > 0, 5]
    return spans[origin], new


@dataclass(frozen=True, eq=False, repr=False)
class RecordedInputs:
    """Inputs as they were recorded: each is a straight line from one of its times to the next.

    Attributes
    ----------
    times : ndarray, shape (N,)
        From these times on the lines hold; the first is not after the start of the run.
    levels, slopes : ndarray, shape (N, m)
        u(t) = level + slope (t - time); held values have slope zero.
    """

    times: np.ndarray
    levels: np.ndarray
    slopes: np.ndarray

    def at(self, times: np.ndarray) -> np.ndarray:
        """u at several times, shape (len(times), m)."""
        i = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, None)
        return np.asarray(self.levels[i] + self.slopes[i] * (times - self.times[i])[:, None])

    def values(self, channels: Sequence[Channel]) -> np.ndarray:
        """What is set in w, in the order of :meth:`actions`."""
        since = np.repeat(self.times, self.levels.shape[1])
        lines = np.column_stack([self.levels.ravel(), self.slopes.ravel(), since]).ravel()
        return np.concatenate([lines, self.at(_times_before(channels)).ravel()])

    def actions(self, events: np.ndarray, channels: Sequence[Channel], held: Held, first: int) -> list[np.ndarray]:
        """Rows that set the lines at their times, and at every sample the inputs at the sample before.

        Parameters
        ----------
        first : int
            Place of the first value of :meth:`values` among all that is set.
        """
        places = np.array([held.input(i) for i in range(self.levels.shape[1])])
        lines, before = places[:, :3].ravel(), places[:, 3]
        at = np.repeat(nearest_event(events, np.maximum(self.times, events[0])), lines.size)
        later = first + at.size
        sample = np.repeat(nearest_event(events, _arrivals(channels)), before.size)
        return [
            _rows(at, -3, SET, np.tile(lines, self.times.size), first + np.arange(at.size)),
            _rows(sample, -3, SET, np.resize(before, sample.size), later + np.arange(sample.size)),
        ]


def _arrivals(channels: Sequence[Channel]) -> np.ndarray:
    """When the samples arrive that observers jump at."""
    return channels[0].samples.arrival


def _times_before(channels: Sequence[Channel]) -> np.ndarray:
    """For every sample the time of the one before; for the first its own."""
    times = _arrivals(channels)
    return np.concatenate([times[:1], times[:-1]])


class _Actions:
    """The action table: samples taken and arriving, noise changing, alpha counted from zero again, jumps.

    At one event the inputs change first, then the plant is stepped, then samples are taken, then they arrive,
    then alpha is counted anew, and last the discrete-time observers jump.
    """

    def __init__(
        self, events: np.ndarray, channels: Sequence[Channel], system: HybridSystem, inputs: RecordedInputs | None
    ) -> None:
        layout = system.held
        rebase = system.has_alpha and not system.remembers
        parts = [np.zeros((0, 7), dtype=np.int64)]  # event, rank at the event, then the engine's five integers
        base, held = 0, 0
        for i, c in enumerate(channels):
            s = c.samples
            slot = base + np.arange(s.arrival.size)
            arrive, take = nearest_event(events, s.arrival), nearest_event(events, s.taken)
            parts.append(_rows(take, 0, TAKE, i, slot))
            heard = s.used & _last_of_equal(arrive) if system.jumps else s.used
            parts.append(_rows(arrive, 1, np.where(heard, ARRIVE, RECORD), i, slot))
            if rebase:
                pending = base + _taken_by(take, arrive)
                parts.append(_rows(arrive, 2, REBASE, i, slot, slot + 1, np.maximum(pending, slot + 1))[s.used])
            base += s.arrival.size
            times = c.held_changes[0]
            parts.append(_rows(nearest_event(events, times), 0, SET, layout.noise(i), held + np.arange(times.size)))
            held += times.size
        self.intervals = np.zeros(0)
        if system.jumps:
            samples = channels[0].samples
            event = nearest_event(events, samples.arrival)
            heard = samples.used & _last_of_equal(event)  # from one sample to the next time passes
            at, self.intervals = event[heard][1:], np.diff(samples.arrival[heard])
            parts.append(_rows(at, -2, SET, layout.interval, held + np.arange(at.size)))
            held += at.size
            for number, (start, _, _) in enumerate(system.jumps):
                parts.append(_rows(at, -1 if start < system.plant_states else 3, JUMP, number))
        if inputs is not None:
            parts += inputs.actions(events, channels, layout, held)
        table = np.concatenate(parts)
        table = table[np.lexsort((table[:, 1], table[:, 0]))]
        self.rows = np.ascontiguousarray(table[:, 2:])
        self.first = np.searchsorted(table[:, 0], np.arange(events.size), side="left")
        self.slots = base


def _rows(event: np.ndarray, *columns: Any) -> np.ndarray:
    """Rows of the action table; missing columns are zero."""
    rows = np.zeros((event.size, 7), dtype=np.int64)
    for i, column in enumerate((event, *columns)):
        rows[:, i] = column
    return rows


def _last_of_equal(numbers: np.ndarray) -> np.ndarray:
    """For numbers in ascending order, where the last one of each value is."""
    last: np.ndarray = np.searchsorted(numbers, numbers, side="right") == np.arange(1, numbers.size + 1)
    return last


def _taken_by(take: np.ndarray, arrive: np.ndarray) -> np.ndarray:
    """For each arrival, one more than the last sample that has been taken by then.

    Samples are numbered by arrival, so those on their way are the ones behind; with delays that change,
    some in between may not have been taken yet.
    """
    earliest = np.minimum.accumulate(take[::-1])[::-1]
    return np.searchsorted(earliest, arrive, side="right")
