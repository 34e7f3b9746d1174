"""What happens where observers are taken back to the time of a late sample, as actions of the engine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np

from hgorun.engine.layout import ARRIVE, JUMP, REBASE, RESTORE, RETAKE, SAVE, SET, TAKE, HybridSystem
from hgorun.measurement.late import Order
from hgorun.pieces import distinct
from hgorun.simulation.timeline.kinds import Kind

ROUND = 4  # ranks of what one of several samples makes happen


@dataclass(frozen=True, eq=False, repr=False)
class Replayed:
    """The samples of a replayed output.

    Attributes
    ----------
    output : int
    slot : int
        That of its first sample.
    taken, known : ndarray of int
        The events at which they are taken, ascending, and known.
    """

    output: int
    slot: int
    taken: np.ndarray
    known: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class Replay:
    """Actions of the observers that are taken back.

    Before anything happens at an event with samples that are on their way their states are saved; when one of these
    becomes known they are restored. Repeated are the samples that are known by then. Several samples of one output
    that were taken at the same time enter one after the other, in as many rounds, each compared with what is left then.

    Attributes
    ----------
    order : Order
    outputs : sequence of Replayed
    system : HybridSystem
    flags : int
        Place of the flags among all that is set.
    """

    order: Order
    outputs: Sequence[Replayed]
    system: HybridSystem
    flags: int

    def kinds(self) -> Iterator[Kind]:
        """What happens, by places in the order."""
        order, system = self.order, self.system
        rounds: dict[int, list[np.ndarray]] = {}
        for one in self.outputs:
            items, place = order.places(one.taken)
            again, known = order.again[place], one.known[items] <= order.now[place]
            early = ~again & ~known
            yield Kind.of(place[early], 0, TAKE, one.output, one.slot + items[early])
            items, place, turn = _in_turn(items[known], place[known])
            slot, again = one.slot + items, order.again[place]
            for number in range(int(turn.max(initial=-1)) + 1):
                own = turn == number
                rounds.setdefault(number, []).append(place[own])
                for what, which in ((TAKE, own & ~again), (RETAKE, own & again)):
                    yield Kind.of(place[which], number * ROUND, what, one.output, slot[which])
                yield from self._arriving(one.output, place[own], slot[own], number * ROUND)
        first = self.outputs[0].output
        for jump, start, _ in system.corrections:
            if start == first:
                for number, arrivals in rounds.items():
                    yield Kind.of(distinct(np.concatenate(arrivals)), 3 + number * ROUND, JUMP, jump)
        yield from self._snapshots()

    def _arriving(self, output: int, place: np.ndarray, slot: np.ndarray, rank: int) -> Iterator[Kind]:
        """What makes samples of an output known."""
        held = self.system.held
        yield Kind.of(place, rank + 1, ARRIVE, output, slot)
        if self.system.has_alpha:
            yield Kind.of(place, rank + 2, REBASE, output, slot + 1, slot + 1)
        if held.flags:
            yield Kind.of(place, rank + 2, SET, held.fresh(output), np.full(place.size, self.flags))
            yield Kind.of(place, rank + 4, SET, held.fresh(output), np.full(place.size, self.flags + 1))

    @property
    def snapshots(self) -> int:
        """How many snapshots are kept at a time."""
        return int(self._buffers.max(initial=-1)) + 1

    def _snapshots(self) -> Iterator[Kind]:
        buffers = self._buffers
        events = np.flatnonzero(buffers >= 0)
        items, place = self.order.places(events)
        needed = self._until[events[items]] > self.order.now[place]
        yield Kind.of(place[needed], -4, SAVE, 0, buffers[events[items[needed]]])
        begins = self.order.begins
        yield Kind.of(begins, -5, RESTORE, 0, buffers[self.order.event[begins]])

    @property
    def _until(self) -> np.ndarray:
        """Up to which event each event's snapshot is needed."""
        until = np.full(self.order.first.size, -1)
        for one in self.outputs:
            np.maximum.at(until, one.taken, one.known)
        return until

    @property
    def _buffers(self) -> np.ndarray:
        """Where every event's snapshot is kept, -1 for those without."""
        until = self._until
        found, free, taken = np.full(until.size, -1), list[int](), list[tuple[int, int]]()
        count = 0
        for event in np.flatnonzero(until > np.arange(until.size)).tolist():
            while taken and taken[0][0] < event:
                heappush(free, heappop(taken)[1])
            if free:
                buffer = heappop(free)
            else:
                buffer, count = count, count + 1
            found[event] = buffer
            heappush(taken, (int(until[event]), buffer))
        return found


def _in_turn(items: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples by place, and which of several at one place each is."""
    by_place = np.lexsort((items, place))
    items, place = items[by_place], place[by_place]
    number = np.arange(place.size)
    starts = np.concatenate([[True], place[1:] != place[:-1]]) if place.size else np.zeros(0, dtype=bool)
    return items, place, number - np.maximum.accumulate(np.where(starts, number, 0))
