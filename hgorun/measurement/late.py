"""What is done with samples that come late: other channels of the same outputs, and the order in which time passes.

Beside the common innovation, which compares a late sample with what had been estimated when it was taken, late
samples can be left out, or the observer can be taken back to the time of the sample and integrated again; or it lives
in the past itself, where no sample is late, and compares what arrives with what it estimates then. To its observers a
replayed output looks as if it were not late: its samples arrive when they are taken, but for those that are not known
yet.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from hgorun.measurement.channels import Channel
from hgorun.measurement.samples import Samples
from hgorun.measurement.variants import HELD, SILENT

Treatment = Literal["innovation", "received", "drop", "replay"]


@dataclass(frozen=True, eq=False, repr=False)
class HeardOtherwise(Channel):
    """Some of the samples of a channel, or all of them, as if they arrived at other times.

    Attributes
    ----------
    source : Channel
    which : ndarray of int, shape (Nk,)
        The samples among those of the source.
    known : ndarray or None, shape (Nk,)
        When each is known, where that is later than it seems.
    retaken : bool
        Whether each is compared with what is estimated when it arrives, not with what was when it was taken.
    """

    source: Channel
    which: np.ndarray
    known: np.ndarray | None
    retaken: bool = False

    @cached_property
    def gain_and_bias(self) -> tuple[np.ndarray, np.ndarray]:
        gain, bias = self.source.gain_and_bias
        return gain[..., self.which], bias[..., self.which]

    def of_many(
        self, count: int, seeds: np.ndarray, deviations: Mapping[tuple[int, int], np.ndarray]
    ) -> HeardOtherwise:
        source = self.source.of_many(count, seeds, deviations)
        return replace(self, source=source, noise=source.noise)


def are_late(channels: Sequence[Channel]) -> bool:
    """Whether any sample arrives later than it is taken."""
    return any(c.samples.late for c in channels)


def heard(channels: Sequence[Channel], treatments: Sequence[Treatment]) -> list[Channel]:
    """The channels, and behind them those of each further group of observers by its treatment of late samples."""
    of: Mapping[Treatment, Callable[[Channel], Channel]]
    of = {"innovation": _as_they_come, "received": _as_received, "drop": _in_time, "replay": _when_taken}
    return [*channels, *(of[treatment](c) for treatment in treatments for c in channels)]


def stepped_between(channels: Sequence[Channel]) -> Channel:
    """A channel of the samples from one to the next of which observers step: without the late ones, where these are."""
    in_time = (c for c in channels if isinstance(c, HeardOtherwise) and c.known is None and not c.retaken)
    return next(in_time, channels[0])


def _as_they_come(channel: Channel) -> Channel:
    return channel


def _as_received(channel: Channel) -> HeardOtherwise:
    """All samples as they are, for observers that live as far in the past as the samples are late."""
    every = np.arange(channel.samples.arrival.size)
    return HeardOtherwise(
        channel.name, channel.stretches, channel.samples, channel.noise, channel, every, None, retaken=True
    )


def _in_time(channel: Channel) -> HeardOtherwise:
    """Without the samples that come late."""
    samples = channel.samples
    return _some(channel, np.flatnonzero(samples.taken >= samples.arrival), samples.arrival, None)


def _when_taken(channel: Channel) -> HeardOtherwise:
    """With the samples where they were taken, also those that come after newer ones."""
    samples = channel.samples
    return _some(channel, np.argsort(samples.taken, kind="stable"), samples.taken, samples.arrival)


def _some(channel: Channel, which: np.ndarray, times: np.ndarray, known: np.ndarray | None) -> HeardOtherwise:
    s, at = channel.samples, times[which]
    samples = Samples(at, at, s.number[which], s.stretch[which], np.ones(which.size, dtype=bool))
    later = None if known is None else known[which]
    return HeardOtherwise(channel.name, channel.stretches, samples, channel.noise, channel, which, later)


@dataclass(frozen=True, eq=False, repr=False)
class Order:
    """How time passes where late samples are replayed: at each event that brings some, it begins again at the oldest.

    Attributes
    ----------
    event, now : ndarray of int, shape (N,)
        What is carried out, one after the other: the events, each with the time until the next one; and by which
        event samples are known then. Where ``now`` is later than ``event`` that is a repetition.
    first : ndarray of int, shape (events,)
        Where every event is carried out for the first time.
    """

    event: np.ndarray
    now: np.ndarray
    first: np.ndarray

    @cached_property
    def again(self) -> np.ndarray:
        """Which of it is a repetition, shape (N,)."""
        return self.now > self.event

    @cached_property
    def begins(self) -> np.ndarray:
        """Where repetitions begin: places in this order."""
        before = np.concatenate([[-1], np.where(self.again, self.now, -1)[:-1]])
        return np.flatnonzero(self.again & (before != self.now))

    @cached_property
    def _sorted(self) -> tuple[np.ndarray, np.ndarray]:
        by_event = np.argsort(self.event, kind="stable")
        return by_event, np.searchsorted(self.event[by_event], np.arange(self.first.size + 1))

    def places(self, events: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where some events are carried out: numbers in ``events``, each with a place in this order."""
        by_event, starts = self._sorted
        counts = starts[events + 1] - starts[events]
        items = np.repeat(np.arange(events.size), counts)
        offset = np.arange(items.size) - np.repeat(np.cumsum(counts) - counts, counts)
        return items, by_event[np.repeat(starts[events], counts) + offset]

    def kinds(self, taken: np.ndarray, known: np.ndarray) -> np.ndarray:
        """What a replayed output is to its observers after each place of this order, shape (N - 1, 2).

        Parameters
        ----------
        taken, known : ndarray of int
            The events at which its samples are taken, ascending, and known.
        """
        earliest = np.concatenate([[self.first.size], np.minimum.accumulate(known)])
        newest = np.searchsorted(taken, self.event[:-1], side="right")
        kind = np.where(earliest[newest] <= self.now[:-1], HELD, SILENT)
        return np.column_stack([kind, np.zeros_like(kind)])


def order_of(count: int, samples: Sequence[tuple[np.ndarray, np.ndarray]]) -> Order:
    """The order of so many events.

    Parameters
    ----------
    samples : sequence of (ndarray of int, ndarray of int)
        Of every replayed output the events at which its samples are taken and known.
    """
    oldest = np.arange(count)
    for taken, known in samples:
        np.minimum.at(oldest, known, taken)
    sizes = np.arange(count) - oldest + 1
    ends = np.cumsum(sizes)
    now = np.repeat(np.arange(count), sizes)
    event = now - (ends[now] - 1 - np.arange(now.size))
    return Order(event, now, ends - 1)
