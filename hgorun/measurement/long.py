"""The events of a long run part by part: times that follow from their numbers are arithmetic, not tables."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hgorun.config.models import Time
from hgorun.measurement.channels import Channel, ChannelPart, follows_from_numbers, part_of
from hgorun.measurement.events import merge
from hgorun.measurement.in_order import NoiseInOrder
from hgorun.measurement.schedule import (
    Schedule,
    build_schedule,
    inward_of,
    kinds_of,
    pulses_of,
    tolerances,
    variants_of,
)
from hgorun.measurement.sizes import COUNTABLE
from hgorun.measurement.variants import Variant

_PART = 1 << 15  # times of one kind in a part: its tables stay in the processor's cache
_FEW = 2 * _PART  # events for which no parts are made
_SEEN = 16  # times among which the middle of a gap is looked for
_KEPT = 0.05  # of time.max_memory: what a result keeps of samples


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Part:
    """Some events of a run one after the other, with what happens at them.

    Attributes
    ----------
    schedule : Schedule
        Its last event is the first of the next part, at which nothing happens here; but for the last part.
    channels : list of ChannelPart
    last : bool
    first : tuple of int
        For every output how many samples there are before.
    """

    schedule: Schedule
    channels: list[ChannelPart]
    last: bool
    first: tuple[int, ...]


@dataclass(frozen=True, eq=False, repr=False)
class _Piece:
    """The events from a time on and before another one."""

    start: float
    end: float
    events: np.ndarray
    inward: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class LongSchedule:
    """When something happens in a long run; attributes as of :class:`Schedule`, as arrays for whoever asks for them.

    Attributes
    ----------
    channels : list of Channel
        All that happens in them follows from numbers.
    time : Time
    kinks, extremes : ndarray
        As in :func:`build_schedule`, like the step.
    step : float
    """

    channels: list[Channel]
    time: Time
    kinks: np.ndarray
    extremes: np.ndarray
    step: float
    order: None = None
    acting: None = None

    @cached_property
    def whole(self) -> Schedule:
        """All events at once.

        Raises
        ------
        Problem
            Where they do not fit into memory.
        """
        return build_schedule(self.channels, self.time, self.kinks, self.step, self.extremes)

    @property
    def events(self) -> np.ndarray:
        return self.whole.events

    @property
    def inward(self) -> np.ndarray:
        return self.whole.inward

    @property
    def variant(self) -> np.ndarray:
        return self.whole.variant

    @cached_property
    def variants(self) -> tuple[Variant, ...]:
        """Every combination of what the outputs are."""
        changes = self._changes
        inside = changes[(changes > self.time.start) & (changes < self.time.end)]
        edges = merge(np.concatenate([[self.time.start], inside, [self.time.end]]), self._tolerance)
        return variants_of(kinds_of(self.channels, np.append(edges[edges < self.time.end], self.time.end)))[0]

    @cached_property
    def size(self) -> int:
        """How many events there are."""
        return sum(piece.events.size for piece in self._pieces())

    @cached_property
    def longest_gap(self) -> float:
        """The longest time between two events."""
        return max(float(np.max(gaps, initial=0.0)) for gaps in self.gaps())

    @cached_property
    def every(self) -> int:
        """A result keeps the samples 0, every, 2 every ... of an output: what takes no more than a part of memory."""
        outputs = len(self.channels)
        size = max(c.samples.size for c in self.channels) * 8 * (1 + 2 * outputs)
        return max(int(np.ceil(size / (_KEPT * self.time.max_memory))), 1)

    def gaps(self) -> Iterator[np.ndarray]:
        """The times between events, part by part."""
        last = self.time.start
        for piece in self._pieces():
            yield np.diff(piece.events, prepend=[] if piece.events[0] == last else last)
            last = float(piece.events[-1])

    def parts(self) -> Iterator[Part]:
        """The run from start to end."""
        codes = {variant: number for number, variant in enumerate(self.variants)}
        ordered = [[NoiseInOrder(noise) for noise in c.noise] for c in self.channels]
        first, variant = [0] * len(self.channels), np.zeros(1, dtype=np.int64)
        for piece, behind in _with_next(self._pieces()):
            events, inward = piece.events, piece.inward
            if behind is not None:
                events, inward = np.append(events, behind.events[0]), np.append(inward, behind.inward[0])
            channels = [part_of(c, own, piece.start, piece.end) for c, own in zip(self.channels, ordered, strict=True)]
            variant = self._variant(events, codes, variant)
            schedule = Schedule(events=events, inward=inward, variants=self.variants, variant=variant)
            yield Part(schedule=schedule, channels=channels, last=behind is None, first=tuple(first))
            first = [before + c.samples.size for before, c in zip(first, channels, strict=True)]

    def _variant(self, events: np.ndarray, codes: Mapping[Variant, int], before: np.ndarray) -> np.ndarray:
        """Which combination holds from each event on until the next one; ``before``: in the part before."""
        if events.size < 2:
            return before[-1:]
        if not np.any((self._changes > events[0]) & (self._changes < events[-1])):
            (only,), _ = variants_of(kinds_of(self.channels, events[:2]))
            return np.full(events.size - 1, codes[only])
        found, variant = variants_of(kinds_of(self.channels, events))
        return np.asarray(np.array([codes[one] for one in found])[variant])

    @cached_property
    def _changes(self) -> np.ndarray:
        """When outputs may become something else: where stretches start, and where samples are heard first in them."""
        starts = [s.start for c in self.channels for s in c.stretches]
        return np.concatenate([starts, *(c.heard_from for c in self.channels)])

    @cached_property
    def _tolerance(self) -> float:
        return tolerances(self.channels, self.step)[1]

    @cached_property
    def _ordered(self) -> list[list[NoiseInOrder]]:
        """Of whom times are asked, and no draws."""
        return [[NoiseInOrder(noise) for noise in c.noise] for c in self.channels]

    @cached_property
    def _others(self) -> np.ndarray:
        """Times that are no samples and no changes of noise."""
        starts = [s.start for c in self.channels for s in c.stretches]
        return np.sort(np.concatenate([self.kinks, self.extremes, starts]))

    def _pieces(self) -> Iterator[_Piece]:
        """The events of the run; no piece is without one."""
        time, (rounding, tolerance) = self.time, tolerances(self.channels, self.step)
        sides = np.sort(self.kinks)
        pulses = pulses_of(sides, tolerance, rounding, self.step)
        start = -np.inf
        while start < np.inf:
            end = self._cut(start)
            times = self._between(start, end)
            # the ends of the run are events, both exactly
            inside = times[(times > time.start + tolerance) & (times < time.end - tolerance)]
            events = merge_ordered(inside, tolerance)
            within = pulses[np.searchsorted(pulses, start) : np.searchsorted(pulses, end)]
            if within.size:
                within = within[(within > time.start + rounding) & (within < time.end - rounding)]
                events = merge(np.concatenate([events, within]), rounding)
            first, last = [time.start] if start == -np.inf else [], [time.end] if end == np.inf else []
            events = np.concatenate([first, events, last])
            if events.size:
                own = sides[np.searchsorted(sides, start) : np.searchsorted(sides, end)]
                yield _Piece(start, end, events, inward_of(events, own, self.step))
            start = end

    def _between(self, start: float, end: float) -> np.ndarray:
        """Where there may be events from a time on and before another one, in ascending order."""
        others = self._others
        times = [others[np.searchsorted(others, start) : np.searchsorted(others, end)]]
        known: set[Hashable] = set()
        for c, ordered in zip(self.channels, self._ordered, strict=True):
            if c.samples.identity not in known:  # outputs may be sampled alike
                times.append(c.samples.part(c.samples.before(start), c.samples.before(end)).arrival)
                known.add(c.samples.identity)
            for stretch, noise in zip(c.stretches, ordered, strict=True):
                if stretch.continuous and stretch.start < end and stretch.end > start:
                    changes = noise.changes_between(max(stretch.start, start), min(stretch.end, end))
                    times.append(changes)
        times = [one for one in times if one.size]
        return times[0] if len(times) == 1 else np.sort(np.concatenate([np.zeros(0), *times]), kind="stable")

    def _cut(self, start: float) -> float:
        """Where the part ends that begins at a time: in a gap between two events; infinity for the last one."""
        reached = [(c.samples.before(start), c.samples.size, c.samples.part) for c in self.channels]
        ends = [
            float(part(before + _PART, before + _PART + 1).arrival[0])
            for before, size, part in reached
            if before + _PART < size
        ]
        for c, ordered in zip(self.channels, self._ordered, strict=True):
            for stretch, noise in zip(c.stretches, ordered, strict=True):
                for train in noise.changes if stretch.continuous else ():
                    number = train.before(max(start, stretch.start)) + _PART
                    if number < train.size and train.at(np.array([number]))[0] < stretch.end:
                        ends.append(float(train.at(np.array([number]))[0]))
        if not ends:
            return np.inf
        return self._gap_before(min(ends), start)

    def _gap_before(self, end: float, start: float) -> float:
        """The middle of a wide gap among those before a time, the last one; infinity where no events are told apart."""
        begin = max(start, self.time.start)
        near = self._between(max(start, end - _SEEN / _PART * (end - begin)), end)
        if near.size < 2:
            near = self._between(start, end)
        gaps = np.diff(near)
        if not gaps.size or np.max(gaps) <= 4 * self._tolerance:
            return np.inf
        wide = int(np.flatnonzero(gaps > 0.5 * np.max(gaps))[-1])
        return float(near[wide] + 0.5 * gaps[wide])


AnySchedule = Schedule | LongSchedule


def merge_ordered(times: np.ndarray, tolerance: float) -> np.ndarray:
    """As :func:`merge` of times that ascend."""
    if times.size < 2:
        return times
    apart = np.diff(times) > tolerance
    return times if apart.all() else merge(times, tolerance)


def _with_next(pieces: Iterator[_Piece]) -> Iterator[tuple[_Piece, _Piece | None]]:
    """Every piece with the one behind it."""
    before: _Piece | None = None
    for piece in pieces:
        if before is not None:
            yield before, piece
        before = piece
    if before is not None:
        yield before, None


def is_long(channels: Sequence[Channel]) -> bool:
    """Whether so much happens that it is better not tabulated, and all of it follows from numbers."""
    stretches = [(s, noise) for c in channels for s, noise in zip(c.stretches, c.noise, strict=True)]
    if not all(follows_from_numbers(s) for s, _ in stretches):
        return False
    changes = sum((s.end - s.start) / hold for s, noise in stretches if s.continuous for hold in noise.holds)
    return bool(_FEW < sum(c.samples.size for c in channels) + changes < COUNTABLE)
