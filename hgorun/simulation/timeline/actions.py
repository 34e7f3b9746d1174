"""What happens at the events of a run: rows of the engine's action table, for all events or for some of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from hgorun.engine.layout import ACTION_WORDS, ARRIVE, HEAR, JUMP, REBASE, RECORD, RETAKE, SET, TAKE, HybridSystem
from hgorun.measurement.channels import Channel
from hgorun.measurement.late import HeardOtherwise, stepped_between
from hgorun.measurement.schedule import Schedule, nearest_event
from hgorun.simulation.timeline.kinds import Kind, Numbered
from hgorun.simulation.timeline.recorded_inputs import RecordedInputs
from hgorun.simulation.timeline.replay import ROUND, Replay, Replayed
from hgorun.simulation.timeline.rounds import corrections, in_rounds, rounds_of

_FIRST = -5  # the smallest rank of what happens at one event
_ACTS, _KEEPS = 5, 6  # those of a controller's action, and of inputs that are kept


class Actions:
    """The action table: samples taken and arriving, noise changing, alpha counted from zero again, jumps.

    At one event the inputs change first, then the plant is stepped, then samples are taken, then they arrive,
    then alpha is counted anew, the discrete-time observers jump and others are corrected; last a controller acts.
    Only samples of one output that are taken and arrive then go one after the other, each through all of this.

    Parameters
    ----------
    kept : int
        Tables that are kept, in case that they are asked for once more.

    Attributes
    ----------
    slots : int
        Samples on their way, over all outputs.
    values : ndarray
        What is set beside noise: the times between samples, for what jumps at them, and flags.
    snapshots : int
        States that are kept at a time, to go back to them.
    """

    def __init__(
        self,
        schedule: Schedule,
        channels: Sequence[Channel],
        system: HybridSystem,
        inputs: RecordedInputs | None,
        kept: int = 1,
    ) -> None:
        events, order, acting = schedule.events, schedule.order, schedule.acting
        layout = system.held
        rebase = system.has_alpha and not system.compares_with_past
        kinds: list[Kind] = []
        arrivals: list[list[np.ndarray]] = []  # of every output by rounds
        base, held, self.snapshots = 0, 0, 0
        replayed: list[Replayed] = []
        known: dict[int, np.ndarray] = {}  # by the clocks that outputs share

        def event_of(times: np.ndarray) -> np.ndarray:
            if id(times) not in known:
                known[id(times)] = nearest_event(events, times)
            return known[id(times)]

        for i, c in enumerate(channels):
            s = c.samples
            if isinstance(c, HeardOtherwise) and c.known is not None:
                replayed.append(Replayed(i, base, nearest_event(events, s.taken), nearest_event(events, c.known)))
                base += s.arrival.size
                continue
            arrive, take = event_of(s.arrival), event_of(s.taken)
            corrects = any(first <= i < stop for _, first, stop in system.corrections)
            rounds = rounds_of(take, arrive, s.used) if corrects or rebase else None
            if isinstance(c, HeardOtherwise) and c.retaken:
                kinds.append(Kind.of(arrive, 0, RETAKE, i, Numbered(base)))
            if rounds is None:
                kinds.append(Kind.of(take, 0, TAKE, i, Numbered(base)))
                heard = s.used & _last_of_equal(arrive) if corrects or system.stepped else s.used
                arrivals.append([arrive if heard.all() else arrive[heard]])
                what = ARRIVE if heard.all() else np.where(heard, ARRIVE, RECORD).astype(np.int8)
                kinds.append(Kind.of(arrive, 1, what, i, Numbered(base)))
                if rebase:
                    kinds.append(_counted_anew(take, arrive, s.used, i, base))
            else:
                kinds += in_rounds(i, base, take, arrive, rounds)
                arrivals.append([arrive[rounds == number] for number in range(int(rounds.max()) + 1)])
                if rebase:
                    for number in range(-1, int(rounds.max()) + 1):
                        again = _counted_anew(take, arrive, s.used & (rounds == number), i, base)
                        kinds.append(replace(again, rank=again.rank + ROUND * max(number, 0)))
            base += s.arrival.size
            times = c.held_changes[0]
            kinds.append(Kind.of(nearest_event(events, times), 0, SET, layout.noise(i), Numbered(held)))
            held += times.size
        self.values = np.zeros(0)
        behind = ROUND * (max(map(len, arrivals), default=1) - 1)
        if system.stepped:
            stepped_by = stepped_between(channels)
            samples = stepped_by.samples
            event = event_of(samples.arrival)
            heard = samples.used & _last_of_equal(event)  # from one sample to the next time passes
            before = stepped_by.before
            at = event[heard]
            self.values = np.diff(samples.arrival[heard], prepend=np.nan if before is None else before)
            if before is None:  # there is none before the first
                at, self.values = at[1:], self.values[1:]
            kinds.append(Kind.of(at, -2, SET, layout.interval, Numbered(held)))
            held += at.size
            kinds += [Kind.of(event[heard], behind + _KEEPS, JUMP, number) for number in system.keeping]
            for number, (start, _, _) in enumerate(system.stepped):
                kinds.append(Kind.of(at, -1 if start < system.plant_states else 3, JUMP, number))
        if system.corrections:
            kinds += corrections(arrivals, system, held)
            self.values = np.concatenate([self.values, _FLAGS])
            held += _FLAGS.size
        if acting is not None:
            kinds += [Kind.of(acting, behind + _ACTS, JUMP, number) for number in system.acting]
        stepped = bool(system.stepped)
        lines = [] if inputs is None else list(inputs.actions(events, channels, layout, held, before=stepped))
        if order is not None:
            kinds = [replace(kind, event=order.first[kind.event]) for kind in kinds]
            lines = [kind.at(*order.places(kind.event)) for kind in lines]
            replay = Replay(order, replayed, system, held - _FLAGS.size)
            self.snapshots = replay.snapshots
            kinds += replay.kinds()
        self.slots, self._kinds, self._size = base, [kind for kind in kinds + lines if kind.event.size], events.size
        self._kept, self._hears = kept, system.hears
        self._known: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}
        self._ranks = max((kind.rank for kind in self._kinds), default=0) - _FIRST + 1

    def at(self, first: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """What happens at the events from ``first`` to ``stop`` - 1, or at those places of the order of events.

        Returns
        -------
        rows : ndarray of int64, shape (actions, 5)
        places : ndarray of int64, shape (stop - first + 1,)
            Where the rows of each event begin, and the end of the last ones.
        """
        key = first, stop
        found = self._known.get(key)  # which another thread may forget meanwhile
        if found is None:
            found = self._rows(first, stop)
            if len(self._known) >= self._kept:
                self._known.clear()
            self._known[key] = found
        return found

    @cached_property
    def repeated(self) -> tuple[np.ndarray, np.ndarray] | None:
        """What happens at the first event, and how the rows of each further one differ from those of the one before.

        Two tables of rows; None where not the same happens at every event but the last, with numbers one after the
        other.
        """
        kinds = sorted(self._kinds, key=lambda kind: kind.rank)
        if any(isinstance(column, np.ndarray) for kind in kinds for column in kind.columns):
            return None
        every = np.arange(self._size - 1)
        if not kinds or not all(np.array_equal(kind.event, every) for kind in kinds):
            return None
        rows = np.empty((2, len(kinds), ACTION_WORDS), dtype=np.int64)
        for kind, first, second in zip(kinds, *rows, strict=True):
            kind.write(first[None], slice(0, 1))
            kind.write(second[None], slice(1, 2))
        first, advance = rows[0], rows[1] - rows[0]
        return heard_at_once(first, advance) if self._hears else (first, advance)

    def take_from(self, other: Actions) -> None:
        """Take the tables of another part of the run, where the same happens, as often and in the same order."""
        if len(self._kinds) == len(other._kinds) and all(map(Kind.equals, self._kinds, other._kinds)):
            self._known = other._known

    def _rows(self, first: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        found = [(kind, slice(*np.searchsorted(kind.event, (first, stop)).tolist())) for kind in self._kinds]
        found = [(kind, items) for kind, items in found if items.start < items.stop]
        if found and _alike(found):
            return _interleaved(found, first, stop)
        sizes = [items.stop - items.start for _, items in found]
        rows, keys = np.empty((sum(sizes), 5), dtype=np.int64), np.empty(sum(sizes), dtype=np.int64)
        end = 0
        for (kind, items), size in zip(found, sizes, strict=True):
            own = slice(end, end := end + size)
            kind.write(rows[own], items)
            keys[own] = (kind.event[items] - first) * self._ranks + (kind.rank - _FIRST)
        order = np.argsort(keys, kind="stable")
        count = np.bincount(keys // self._ranks, minlength=stop - first)
        return rows[order], np.concatenate([[0], np.cumsum(count)])


def _alike(found: Sequence[tuple[Kind, slice]]) -> bool:
    """Whether everything happens once at each of the same events, as where samples arrive when they are taken."""
    (kind, items), *others = found
    events = kind.event[items]
    return bool(np.all(events[1:] > events[:-1])) and all(
        np.array_equal(other.event[own], events) for other, own in others
    )


def _interleaved(found: Sequence[tuple[Kind, slice]], first: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
    """What :meth:`Actions.at` gives of what is alike: nothing has to be sorted."""
    kind, items = found[0]
    events = kind.event[items]
    rows = np.empty((events.size, len(found), 5), dtype=np.int64)
    ordered = sorted(found, key=lambda each: each[0].rank)
    rows[:] = [own.constants for own, _ in ordered]  # at once, since the table is larger than caches
    for j, (own, which) in enumerate(ordered):
        own.write(rows[:, j], which, constants=False)
    count = len(found) * np.bincount(events - first, minlength=stop - first)
    return rows.reshape(-1, 5), np.concatenate([[0], np.cumsum(count)])


def heard_at_once(rows: np.ndarray, advance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Actions with one for each sample, where all are taken first, then all arrive, and none is on its way.

    Parameters
    ----------
    rows, advance : ndarray of int64, shape (actions, 5)
        As those of :attr:`Actions.repeated`.
    """
    count = int(np.count_nonzero(rows[:, 0] == TAKE))
    stages = [TAKE] * count + [ARRIVE] * count + [REBASE] * count
    if rows[-3 * count :, 0].tolist() != stages:
        return rows, advance
    for table, behind in ((rows, 1), (advance, 0)):
        taken, arriving, counted = table[-3 * count :].reshape(3, count, ACTION_WORDS)
        one_by_one = np.array_equal(taken[:, 1:3], arriving[:, 1:3]) and np.array_equal(taken[:, 1:3], counted[:, 1:3])
        if not one_by_one or np.any(counted[:, 3:] != counted[:, 2:3] + behind):
            return rows, advance
    found = rows[: -2 * count].copy()
    found[-count:, 0] = HEAR
    return found, advance[: -2 * count]


_FLAGS = np.array([1.0, 0.0])  # a sample arrives just now, or does not


def _counted_anew(take: np.ndarray, arrive: np.ndarray, used: np.ndarray, output: int, base: int) -> Kind:
    """What counts alpha from zero again when a sample that is used arrives, also for those on their way."""
    if used.all() and _at_once(take, arrive):  # none is ever on its way
        return Kind.of(arrive, 2, REBASE, output, Numbered(base), Numbered(base + 1), Numbered(base + 1))
    pending = _taken_by(take, arrive)
    if used.all():
        number = np.arange(used.size)
        return Kind.of(
            arrive, 2, REBASE, output, Numbered(base), Numbered(base + 1), base + np.maximum(pending, number + 1)
        )
    number = np.flatnonzero(used)
    last = base + np.maximum(pending[used], number + 1)
    return Kind.of(arrive[used], 2, REBASE, output, base + number, base + number + 1, last)


def _last_of_equal(numbers: np.ndarray) -> np.ndarray:
    """For numbers in ascending order, where the last one of each value is."""
    last: np.ndarray = np.searchsorted(numbers, numbers, side="right") == np.arange(1, numbers.size + 1)
    return last


def _at_once(take: np.ndarray, arrive: np.ndarray) -> bool:
    """Whether every sample arrives when it is taken, one after the other."""
    return take is arrive and bool(np.all(take[1:] > take[:-1]))


def _taken_by(take: np.ndarray, arrive: np.ndarray) -> np.ndarray:
    """For each arrival, one more than the last sample that has been taken by then.

    Samples are numbered by arrival, so those on their way are the ones behind; with delays that change,
    some in between may not have been taken yet.
    """
    if _at_once(take, arrive):
        return np.arange(1, take.size + 1)
    earliest = np.minimum.accumulate(take[::-1])[::-1]
    return np.searchsorted(earliest, arrive, side="right")
