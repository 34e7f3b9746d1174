"""From a schedule to the engine's tables: segments between events, and what happens at each event."""

from __future__ import annotations

from typing import Any

import numpy as np

from hgorun.engine.layout import ARRIVE, JUMP, NOISE, REBASE, RECORD, SET, TAKE, Structure
from hgorun.engine.plan import Plan
from hgorun.errors import Problem
from hgorun.measurement.schedule import Channel, Schedule, nearest_event

_PIECE = 1 << 14  # steps between two looks at the keyboard, more only where there were too many pieces
_MOST_PIECES = 100_000
_MOST_STEPS = 1e10  # then a piece is still a matter of a second


def build_plan(
    schedule: Schedule,
    grid: np.ndarray,
    structure: Structure,
    *,
    always_slope: bool,
    longest: float,
    reach: float,
) -> Plan:
    """The engine's tables.

    Parameters
    ----------
    structure : Structure
        What the plan is for.
    always_slope : bool
        The method needs the slope at the end of every segment.
    longest : float
        No step is longer; infinity for adaptive steps, where a segment is one piece.
    reach : float
        The longest continuous delay.
    """
    events = schedule.events
    gaps = np.diff(events)
    steps = count_steps(gaps, longest)
    table = _Actions(schedule, structure)
    always = structure.remembers or always_slope
    slope = np.full(gaps.size, int(always))
    if not always:
        slope = _row_in_last_step(events, steps, grid).astype(int)
    inner = events[:-1] + schedule.inward[:-1], events[1:] - schedule.inward[1:]
    spans = np.column_stack([events[:-1], events[1:], *inner])
    counts = np.column_stack(
        [steps, np.zeros_like(steps), steps, schedule.variant, table.first[:-1], table.first[1:], slope]
    )
    spans, counts = in_pieces(spans, counts)
    # what happens at the very end: one more segment without steps
    last = np.array([[1, 0, 0, counts[-1, 3], table.first[-1], table.rows.shape[0], 0]])
    end = np.full((1, 4), events[-1])
    return Plan(
        np.concatenate([spans, end]),
        np.concatenate([counts, last]).astype(np.int64),
        table.rows,
        grid,
        table.slots,
        table.gain,
        table.bias,
        table.holds,
        reach,
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
    if not total <= _MOST_STEPS:
        raise Problem(
            ("solver", key),
            f"the run takes {total:.3g} steps of {longest:.3g}, at most {_MOST_STEPS:.0e} are possible: "
            f"give a longer solver.{key}",
        )
    return np.asarray(steps.astype(np.int64))


def _row_in_last_step(events: np.ndarray, steps: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Whether an output point lies strictly inside the last step before each event."""
    end = events[1:]
    h = np.diff(events) / steps
    snap = 1e-9 * h + 1e-15 * np.abs(end)
    first = np.searchsorted(grid, end - h + snap, side="right")
    return np.asarray(np.searchsorted(grid, end - snap, side="left") > first)


def in_pieces(spans: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Long segments in pieces, so that the native code comes back soon; numbering of the steps goes on.

    A piece has 16,384 steps. In runs of more than 1.6e9 steps it is longer, since the pieces themselves
    take memory: up to 100,000 steps, well below a second for all but the largest systems.
    """
    piece = max(_PIECE, -(-int(counts[:, 0].sum()) // _MOST_PIECES))
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


class _Actions:
    """The action table: samples taken and arriving, noise changing, alpha counted from zero again, jumps.

    At one event the plant is stepped first, then samples are taken, then they arrive, then alpha is
    counted anew, and last the discrete-time observers jump.
    """

    def __init__(self, schedule: Schedule, structure: Structure) -> None:
        events = schedule.events
        rebase = structure.has_alpha and not structure.remembers
        parts = [np.zeros((0, 7), dtype=np.int64)]  # event, rank at the event, then the engine's five integers
        gain, bias, holds = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
        base, held = 0, 0
        for i, c in enumerate(schedule.channels):
            s = c.samples
            slot = base + np.arange(s.arrival.size)
            arrive, take = nearest_event(events, s.arrival), nearest_event(events, s.taken)
            parts.append(_rows(take, 0, TAKE, i, slot))
            heard = s.used & _last_of_equal(arrive) if structure.jumps else s.used
            parts.append(_rows(arrive, 1, np.where(heard, ARRIVE, RECORD), i, slot))
            if rebase:
                pending = base + _taken_by(take, arrive)
                parts.append(_rows(arrive, 2, REBASE, i, slot, slot + 1, np.maximum(pending, slot + 1))[s.used])
            g, b = _measured(c)
            gain.append(g)
            bias.append(b)
            base += s.arrival.size
            times, values = _held_changes(c)
            place = i * structure.held_width + NOISE
            parts.append(_rows(nearest_event(events, times), 0, SET, place, held + np.arange(times.size)))
            holds.append(values)
            held += times.size
        if structure.jumps:
            samples = schedule.channels[0].samples
            event = nearest_event(events, samples.arrival)
            heard = samples.used & _last_of_equal(event)  # from one sample to the next time passes
            at, intervals = event[heard][1:], np.diff(samples.arrival[heard])
            parts.append(_rows(at, -2, SET, structure.held - 1, held + np.arange(at.size)))
            holds.append(intervals)
            for number, (start, _, _) in enumerate(structure.jumps):
                parts.append(_rows(at, -1 if start == 0 else 3, JUMP, number))
        table = np.concatenate(parts)
        table = table[np.lexsort((table[:, 1], table[:, 0]))]
        self.rows = np.ascontiguousarray(table[:, 2:])
        self.first = np.searchsorted(table[:, 0], np.arange(events.size), side="left")
        self.slots, self.holds = base, np.concatenate(holds)
        self.gain, self.bias = np.concatenate(gain), np.concatenate(bias)


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


def _measured(c: Channel) -> tuple[np.ndarray, np.ndarray]:
    """gain and bias of every sample: y_k = gain h + bias."""
    s = c.samples
    gain, bias = np.ones(s.arrival.size), np.zeros(s.arrival.size)
    for i, (stretch, noise) in enumerate(zip(c.stretches, c.noise, strict=True)):
        mine = s.stretch == i
        if mine.any():
            times, numbers = s.arrival[mine], s.number[mine]
            v = noise.sampled(times, numbers)
            if not np.all(np.isfinite(v)):
                first = times[np.argmin(np.isfinite(v))]
                raise Problem(stretch.paths["noise"], f"the noise is not a finite number at t = {first:g}")
            if stretch.multiplicative:
                gain[mine] = 1 + v
            else:
                bias[mine] = v
    return gain, bias


def _held_changes(c: Channel) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of the held noise in the continuous stretches; each of them starts with its own."""
    times, values = [np.zeros(0)], [np.zeros(0)]
    if any(noise.random for noise in c.noise):
        for stretch, noise in zip(c.stretches, c.noise, strict=True):
            if stretch.continuous:
                changes = noise.change_times()
                inside = changes[(changes > stretch.start) & (changes < stretch.end)]
                times.append(np.concatenate([[stretch.start], inside]))
                values.append(noise.held(times[-1]))
    return np.concatenate(times), np.concatenate(values)
