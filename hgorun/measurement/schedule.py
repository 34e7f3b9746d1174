"""From availability to the engine's plan: all events of a run and what happens at each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hgorun.config.models import Time
from hgorun.engine.layout import (
    ARRIVE,
    CONTINUOUS,
    DELAYED,
    HELD,
    JUMP,
    NOISE,
    REBASE,
    RECORD,
    SET,
    SILENT,
    TAKE,
    Structure,
    Variant,
)
from hgorun.engine.plan import Plan
from hgorun.errors import Problem
from hgorun.measurement.availability import Stretch
from hgorun.measurement.events import LEVELS, merge, repeated
from hgorun.measurement.noise import RandomNoise, sampled_noise
from hgorun.measurement.sampling import Samples, find_samples

_PIECE = 1 << 14  # steps that native code makes at most between two looks at the keyboard
_SHORT = 1e-9  # events closer than this part of a step are one


@dataclass
class Channel:
    """One output: its stretches, its samples, its random noise."""

    name: str
    stretches: list[Stretch]
    samples: Samples
    random: list[RandomNoise]

    def stretch_at(self, times: np.ndarray) -> np.ndarray:
        """Index of the stretch that starts at or before each time."""
        starts = np.array([s.start for s in self.stretches])
        return np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(starts) - 1)

    def kinds_at(self, times: np.ndarray) -> np.ndarray:
        """What the output is to the observers at each time, and in which phase, shape (len(times), 2)."""
        stretch = self.stretch_at(times)
        late = np.array([DELAYED if not s.undelayed else CONTINUOUS for s in self.stretches])
        continuous = np.array([s.continuous for s in self.stretches])
        # the start of the unbroken run of sampled stretches that each one belongs to
        starts = [s.start for s in self.stretches]
        for i in range(1, len(starts)):
            if not continuous[i] and not continuous[i - 1]:
                starts[i] = starts[i - 1]
        arrivals = np.concatenate([[-np.inf], self.samples.arrival[self.samples.used]])
        newest = arrivals[np.searchsorted(arrivals, times, side="right") - 1]
        heard = newest >= np.array(starts)[stretch]
        kind = np.where(continuous[stretch], late[stretch], np.where(heard, HELD, SILENT))
        return np.column_stack([kind, np.where(continuous[stretch], stretch, 0)])


@dataclass(frozen=True)
class Schedule:
    """All that the measurement does in a run.

    Attributes
    ----------
    channels : list of Channel
        One an output.
    events : ndarray
        Times between which everything is smooth.
    inward : ndarray
        Where a function of time, or what is delayed, has a kink or a jump at an event: how far from the
        event it is evaluated, so that it shows the side of the segment. Zero elsewhere.
    variants : list of Variant
        Every combination of what the outputs are.
    variant : ndarray of int
        Which of them holds from each event on (the last event has none).
    """

    channels: list[Channel]
    events: np.ndarray
    inward: np.ndarray
    variants: list[Variant]
    variant: np.ndarray
    step: float


def find_channels(
    resolved: list[list[Stretch]],
    outputs: tuple[str, ...],
    time: Time,
    seed: int,
    mean_square: Callable[[int], float],
) -> list[Channel]:
    """Samples and random noise of every output."""
    most = int(time.max_memory / 64)
    channels = []
    for i, (name, stretches) in enumerate(zip(outputs, resolved, strict=True)):
        for stretch in stretches:
            for j, item in enumerate(stretch.noise):
                hold = getattr(item, "hold", None)
                if hold is not None and (time.end - time.start) / hold > most:
                    raise Problem(
                        (*stretch.paths["noise"], j, "hold"), "more draws than time.max_memory allows"
                    )
        samples = find_samples(stretches, time.start, seed, name, most)
        random = [
            RandomNoise(s, seed, f"{name}/{k}", time.start, time.end, lambda i=i: mean_square(i))
            for k, s in enumerate(stretches)
        ]
        channels.append(Channel(name, stretches, samples, random))
    return channels


def continuous_delays(channels: list[Channel]) -> list[Stretch]:
    """The stretches with a continuous, late output."""
    return [s for c in channels for s in c.stretches if s.continuous and not s.undelayed]


def check_delays(channels: list[Channel], points: int) -> tuple[float, float]:
    """The smallest positive and the largest continuous delay; (inf, 0) without any.

    Raises
    ------
    Problem
        Where a delay is negative or not a number.
    """
    smallest, largest = np.inf, 0.0
    for s in continuous_delays(channels):
        times = np.linspace(s.start, s.end, points)
        delays = s.delay_at(times)
        if not np.all(np.isfinite(delays)) or np.any(delays < 0):
            where = times[np.argmin(np.where(np.isfinite(delays), delays, -np.inf))]
            raise Problem(
                s.paths["delay"], f"the delay must be a number >= 0, found {delays.min():g} at t = {where:g}"
            )
        smallest, largest = min(smallest, float(delays.min())), max(largest, float(delays.max()))
    return smallest, largest


def build_schedule(
    channels: list[Channel], time: Time, kinks: np.ndarray, step: float, points: int
) -> Schedule:
    """Collect all events of a run.

    Parameters
    ----------
    kinks : ndarray
        Kinks of the functions of time.
    step : float
        Nominal step: events much closer than it are one.
    points : int
        How finely delays are searched for repeated events.
    """
    tolerance = max(_SHORT * step, 4 * np.spacing(max(abs(time.start), abs(time.end))))
    times = [np.array([time.start, time.end]), kinks]
    for c in channels:
        times += [c.samples.arrival, c.samples.taken, np.array([s.start for s in c.stretches])]
        for s, noise in zip(c.stretches, c.random, strict=True):
            if s.continuous:
                changes = noise.change_times()
                times.append(changes[(changes > s.start) & (changes < s.end)])
    events = _clipped(np.concatenate(times), time, tolerance)
    newest, sharp = events, [kinks]
    for _ in range(LEVELS if continuous_delays(channels) else 0):
        found = [
            repeated(newest, s.delay_at, s.delay_is_constant, s.start, s.end, points)
            for s in continuous_delays(channels)
        ]
        sharp += found  # a jump of an output comes back as a jump
        fresh = merge(np.concatenate(found), tolerance)
        near = np.searchsorted(events, fresh)
        away = np.minimum(
            np.abs(fresh - events[np.clip(near, 0, events.size - 1)]),
            np.abs(fresh - events[np.clip(near - 1, 0, None)]),
        )
        newest = fresh[away > tolerance]
        events = _clipped(np.concatenate([events, newest]), time, tolerance)
    sides = np.concatenate(sharp)
    inward, at = np.zeros(events.size), _nearest(events, sides)
    margin = 4 * np.spacing(np.maximum(np.abs(sides), step))
    np.maximum.at(inward, at, np.abs(sides - events[at]) + margin)
    # in the middle: what happens at an event may be written a rounding error later than the event
    middle = 0.5 * (events[:-1] + events[1:])
    kinds = np.concatenate([c.kinds_at(middle) for c in channels], axis=1)
    distinct, variant = np.unique(kinds, axis=0, return_inverse=True)
    variants = [tuple((int(a), int(b)) for a, b in row.reshape(-1, 2)) for row in distinct]
    return Schedule(channels, events, inward, variants, variant.ravel(), step)


def _clipped(times: np.ndarray, time: Time, tolerance: float) -> np.ndarray:
    """Sorted events from start to end, both exactly."""
    inside = times[(times > time.start + tolerance) & (times < time.end - tolerance)]
    return np.concatenate([[time.start], merge(inside, tolerance), [time.end]])


def _nearest(events: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Index of the event nearest to each time."""
    right = np.clip(np.searchsorted(events, times), 1, events.size - 1)
    return np.where(times - events[right - 1] <= events[right] - times, right - 1, right)


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
    steps = np.ones(gaps.size, dtype=np.int64)
    if np.isfinite(longest):
        steps = np.maximum(np.ceil(gaps / longest * (1 - 1e-9)), 1).astype(np.int64)
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
    spans, counts = _split(spans, counts, _PIECE)
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


def _row_in_last_step(events: np.ndarray, steps: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Whether an output point lies strictly inside the last step before each event."""
    end = events[1:]
    h = np.diff(events) / steps
    snap = 1e-9 * h + 1e-15 * np.abs(end)
    first = np.searchsorted(grid, end - h + snap, side="right")
    return np.searchsorted(grid, end - snap, side="left") > first


def _split(spans: np.ndarray, counts: np.ndarray, piece: int) -> tuple[np.ndarray, np.ndarray]:
    """Long segments in pieces, so that the native code comes back soon; numbering of the steps goes on."""
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
        parts = [
            np.zeros((0, 7), dtype=np.int64)
        ]  # event, rank at the event, then the engine's five integers
        gain, bias, holds = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
        base, held = 0, 0
        for i, c in enumerate(schedule.channels):
            s = c.samples
            slot = base + np.arange(s.arrival.size)
            arrive, take = _nearest(events, s.arrival), _nearest(events, s.taken)
            parts.append(_rows(take, 0, TAKE, i, slot))
            parts.append(_rows(arrive, 1, np.where(s.used, ARRIVE, RECORD), i, slot))
            if rebase:
                pending = base + _taken_by(take, arrive)
                parts.append(
                    _rows(arrive, 2, REBASE, i, slot, slot + 1, np.maximum(pending, slot + 1))[s.used]
                )
            g, b = _measured(c)
            gain.append(g)
            bias.append(b)
            base += s.arrival.size
            times, values = _held_changes(c)
            place = i * structure.held_width + NOISE
            parts.append(_rows(_nearest(events, times), 0, SET, place, held + np.arange(times.size)))
            holds.append(values)
            held += times.size
        if structure.jumps:
            samples = schedule.channels[0].samples
            times = samples.arrival[samples.used]
            at, intervals = _nearest(events, times[1:]), np.diff(times)
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
    for i, (stretch, random) in enumerate(zip(c.stretches, c.random, strict=True)):
        mine = s.stretch == i
        if mine.any():
            times, numbers = s.arrival[mine], s.number[mine]
            v = sampled_noise(stretch, times, numbers) + random.sampled(times, numbers)
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
    if any(r.items for r in c.random):
        for stretch, random in zip(c.stretches, c.random, strict=True):
            if stretch.continuous:
                changes = random.change_times()
                inside = changes[(changes > stretch.start) & (changes < stretch.end)]
                times.append(np.concatenate([[stretch.start], inside]))
                values.append(random.held(times[-1]))
    return np.concatenate(times), np.concatenate(values)
