"""Where samples that may be outliers enter the observers of a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.engine.plan import Integers
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.measurement.channels import Channel
from hgorun.measurement.late import HeardOtherwise, Order, stepped_between
from hgorun.measurement.schedule import nearest_event
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.plant import PlantModel


@dataclass(frozen=True, kw_only=True, slots=True)
class Entering:
    """A sample that may be an outlier, where it enters some observers.

    Attributes
    ----------
    output : int
        Of the plant.
    channel : int
        In which these observers hear it.
    slot : int
        Among the samples of all channels.
    used : int
        Among the samples of all outputs.
    members : tuple of int
        The observers.
    """

    output: int
    channel: int
    slot: int
    used: int
    members: tuple[int, ...]


def innovations_by_slot(entering: Sequence[Entering], model: PlantModel, innovations: Floats) -> dict[int, list[float]]:
    """The innovations of some samples by their slots, of each observer.

    Parameters
    ----------
    model : PlantModel
        Whose outputs may be angles.
    innovations : ndarray, shape (slots, m)
    """
    of_outputs: dict[int, list[int]] = {}
    for one in entering:
        of_outputs.setdefault(one.output, []).append(one.slot)
    found: dict[int, list[float]] = {}
    for output, slots in of_outputs.items():
        found |= zip(slots, model.wrapped(output, innovations[slots]).tolist(), strict=True)
    return found


def where_entering(prepared: PreparedEstimate) -> Iterator[tuple[int, Entering]]:
    """Every sample that may be an outlier, with the places in the order of events where it enters."""
    schedule, slots, q = prepared.run.schedule, prepared.slots, len(prepared.samples)
    order, first = schedule.order, 0
    for number, channel in enumerate(prepared.run.heard):
        start, output, samples = first, number % q, channel.samples
        first += samples.arrival.size
        members = tuple(j for j in range(len(prepared.run.observers)) if prepared.group(j) == number // q)
        if prepared.samples[output].gate is None or not members:
            continue
        which = _which(channel)
        at = nearest_event(schedule.events, samples.arrival)
        items = np.flatnonzero(samples.used)
        places = at[items] if order is None else order.first[at[items]]
        if order is not None and isinstance(channel, HeardOtherwise) and channel.known is not None:
            items, places = _as_known(order, at, nearest_event(schedule.events, channel.known))
        for k, place in zip(items.tolist(), places.tolist(), strict=True):
            own = slots[output].start + int(which[k])
            yield place, Entering(output=output, channel=number, slot=start + k, used=own, members=members)


def _which(channel: Channel) -> Integers:
    """The samples of a channel among those of its output."""
    return channel.which if isinstance(channel, HeardOtherwise) else np.arange(channel.samples.arrival.size)


@dataclass(frozen=True, eq=False, repr=False)
class SteppedRows:
    """The samples of all outputs from one to the next of which observers step: without late ones that are left out.

    Attributes
    ----------
    channels : range
        In which these observers hear them.
    samples : ndarray of int, shape (q, rows)
        Their numbers among the samples of all outputs; rows of time.
    """

    channels: range
    samples: Integers

    @classmethod
    def of(cls, prepared: PreparedEstimate) -> SteppedRows:
        """Those of a recording; no rows where outputs are not sampled together, so that nothing steps."""
        heard = prepared.run.heard
        first = heard.index(stepped_between(heard))
        channels = range(first, first + len(prepared.samples))
        found = [slots.start + _which(heard[k]) for slots, k in zip(prepared.slots, channels, strict=True)]
        together = len({one.size for one in found}) == 1
        return cls(channels, np.array(found) if together else np.zeros((len(found), 0), dtype=int))

    def row(self, one: Entering) -> int:
        """That of a sample."""
        return int(np.searchsorted(self.samples[one.output], one.used))

    def used(self, row: int) -> list[int]:
        """The samples of a row, of every output."""
        return list(map(int, self.samples[:, row]))


def _as_known(order: Order, taken: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Samples and the places where they enter observers that are taken back, in the order of places."""
    items, places = order.places(taken)
    there = known[items] <= order.now[places]
    items, places = items[there], places[there]
    by_place = np.lexsort((items, places))
    return items[by_place], places[by_place]


def needed_until(prepared: PreparedEstimate) -> np.ndarray:
    """Up to which event observers may be taken back to each."""
    events = prepared.run.schedule.events
    until = np.full(events.size, -1)
    for channel in prepared.run.heard:
        if isinstance(channel, HeardOtherwise) and channel.known is not None:
            taken, known = (nearest_event(events, times) for times in (channel.samples.taken, channel.known))
            np.maximum.at(until, taken, known)
    return until
