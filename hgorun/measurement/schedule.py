"""All events of a run: samples, the times they were measured, noise changes, kinks, and what delays make of them."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.config.models import Time
from hgorun.errors import Problem
from hgorun.measurement.availability import Stretch
from hgorun.measurement.channels import Channel, continuous_delays
from hgorun.measurement.events import LEVELS, merge, repeated
from hgorun.measurement.late import HeardOtherwise, Order, order_of
from hgorun.measurement.sizes import EVENT_BYTES
from hgorun.measurement.variants import FROZEN, Variant
from hgorun.memo import Memo
from hgorun.native.places import moved_up
from hgorun.pieces import distinct

_SHORT = 1e-9  # events closer than this part of a step are one


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Schedule:
    """When something happens in a run.

    Attributes
    ----------
    events : ndarray
        Times between which everything is smooth.
    inward : ndarray
        Where a function of time, or what is delayed, has a kink or a jump at an event: how far from the
        event it is evaluated, so that it shows the side of the segment. Zero elsewhere.
    variants : tuple of Variant
        Every combination of what the outputs are.
    variant : ndarray of int
        Which of them holds from each event on (the last event has none), or from each place of ``order`` on.
    order : Order, optional
        In which events are carried out, where some of them are repeated.
    acting : ndarray of int, optional
        The events at which a controller acts, where it does so at instants.
    alike : hashable, optional
        What all that happens at its events follows from: where two parts of a run are equal in it, it is the same.
    """

    events: np.ndarray
    inward: np.ndarray
    variants: tuple[Variant, ...]
    variant: np.ndarray
    order: Order | None = None
    acting: np.ndarray | None = None
    alike: Hashable | None = None

    @property
    def size(self) -> int:
        """How many events there are."""
        return int(self.events.size)

    @property
    def longest_gap(self) -> float:
        """The longest time between two events."""
        return float(np.max(np.diff(self.events)))

    @property
    def every(self) -> int:
        """A result keeps the samples 0, every, 2 every ...."""
        return 1


def build_schedule(
    channels: list[Channel],
    time: Time,
    kinks: np.ndarray,
    step: float,
    extremes: np.ndarray | None = None,
    instants: np.ndarray | None = None,
) -> Schedule:
    """Collect all events of a run.

    Parameters
    ----------
    kinks : ndarray
        Kinks of the functions of time.
    extremes : ndarray, optional
        Where they are smooth, but should be looked at.
    instants : ndarray, optional
        At which a controller acts.
    step : float
        Events much closer to each other than such a step are one.
    """
    rounding, tolerance = tolerances(channels, step)
    times = [np.array([time.start, time.end]), kinks, *(more for more in (extremes, instants) if more is not None)]
    for c in channels:
        times += [c.samples.arrival, np.array([s.start for s in c.stretches])]
        if c.samples.taken is not c.samples.arrival:
            times.append(c.samples.taken)
        for s, noise in zip(c.stretches, c.noise, strict=True):
            if s.continuous:
                changes = noise.change_times()
                times.append(changes[(changes > s.start) & (changes < s.end)])
    events = clipped(np.concatenate(times), time, tolerance)
    newest, sharp = events, [kinks]
    for _ in range(LEVELS if continuous_delays(channels) else 0):
        found = [repeated(newest, s.delay, s.start, s.end, s.origin).times for s in continuous_delays(channels)]
        sharp += found  # a jump of an output comes back as a jump
        fresh = merge(np.concatenate(found), tolerance)
        near = np.searchsorted(events, fresh)
        away = np.minimum(
            np.abs(fresh - events[np.clip(near, 0, events.size - 1)]),
            np.abs(fresh - events[np.clip(near - 1, 0, None)]),
        )
        newest = fresh[away > tolerance]
        events = clipped(np.concatenate([events, newest]), time, tolerance)
        if events.size * EVENT_BYTES > time.max_memory:
            raise Problem(
                continuous_delays(channels)[0].paths["delay"],
                f"samples and noise that come back after the delay make {events.size} events, about "
                f"{events.size * EVENT_BYTES / 2**30:.3g} GiB; time.max_memory allows "
                f"{time.max_memory / 2**30:.3g} GiB",
            )
    sides = np.concatenate(sharp)
    pulses = pulses_of(sides, tolerance, rounding, step)
    if pulses.size:
        events = clipped(np.concatenate([events, pulses]), time, rounding)
    inward = inward_of(events, sides, step)
    heard = [c for c in channels if not (isinstance(c, HeardOtherwise) and c.known is not None)]
    kinds = np.concatenate([kinds_of(heard, events[k : k + _PIECE + 1]) for k in range(0, events.size - 1, _PIECE)])
    order, kinds = _in_order(channels, events, kinds, time)
    variants, variant = variants_of(kinds)
    acting = None if instants is None else nearest_event(events, instants)
    return Schedule(
        events=events, inward=inward, variants=variants, variant=variant.ravel(), order=order, acting=acting
    )


def tolerances(channels: Sequence[Channel], step: float) -> tuple[float, float]:
    """How far apart times may be by rounding, and how far events that are one."""
    return tolerances_of([c.stretches for c in channels], step)


def tolerances_of(stretches: Iterable[Sequence[Stretch]], step: float) -> tuple[float, float]:
    """The same, of the stretches of every output."""
    rounding = 4 * max(s.spacing for of in stretches for s in of)
    return rounding, max(_SHORT * step, rounding)


def away_from(times: np.ndarray, events: np.ndarray, tolerance: float) -> np.ndarray:
    """Those of some times that are no events already, as far as rounding can tell; events ascend."""
    return np.asarray(times[np.abs(times - events[nearest_event(events, times)]) > tolerance])


def inward_of(events: np.ndarray, sides: np.ndarray, step: float) -> np.ndarray:
    """How far from every event functions of time are evaluated, some of which have kinks or jumps at ``sides``."""
    inward, at = np.zeros(events.size), nearest_event(events, sides)
    margin = 4 * np.spacing(np.maximum(np.abs(sides), step))
    np.maximum.at(inward, at, np.abs(sides - events[at]) + margin)
    return inward


def _in_order(
    channels: list[Channel], events: np.ndarray, kinds: np.ndarray, time: Time
) -> tuple[Order | None, np.ndarray]:
    """The order of events where late samples are replayed, and what all outputs are in it."""
    replayed = [(c, c.known) for c in channels if isinstance(c, HeardOtherwise) and c.known is not None]
    if not replayed:
        return None, kinds
    samples = [(nearest_event(events, c.samples.taken), nearest_event(events, known)) for c, known in replayed]
    order = order_of(events.size, samples)
    if order.event.size * _REPEATED_BYTES > time.max_memory:
        raise Problem(
            replayed[0][0].stretches[0].paths["delay"],
            f"going back to the time of every late sample repeats {order.event.size} events, about "
            f"{order.event.size * _REPEATED_BYTES / 2**30:.3g} GiB; time.max_memory allows "
            f"{time.max_memory / 2**30:.3g} GiB",
        )
    others = kinds[order.event[:-1]].reshape(order.event.size - 1, -1, 2)
    others[order.again[:-1]] = FROZEN, 0
    own = [order.kinds(*one) for one in samples]
    return order, np.concatenate([others.reshape(len(others), -1), *own], axis=1).astype(np.int32)


_REPEATED_BYTES = 500  # of memory that the tables take for each event that is carried out


_PIECE = 1 << 15  # events at a time: there may be many of them


def kinds_of(channels: Sequence[Channel], events: np.ndarray) -> np.ndarray:
    """What every output is between any two events, and in which phase, shape (len(events) - 1, 2 q)."""
    # in the middle: what happens at an event may be written a rounding error later than the event
    middle = 0.5 * (events[:-1] + events[1:])
    return np.concatenate([c.kinds_at(middle) for c in channels], axis=1).astype(np.int32)


def variants_of(kinds: np.ndarray) -> tuple[tuple[Variant, ...], np.ndarray]:
    """Every combination of what the outputs are, and which of them holds between any two events."""
    distinct, variant = _distinct(kinds)
    return tuple(tuple((int(a), int(b)) for a, b in row.reshape(-1, 2)) for row in distinct), variant


def _distinct(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct rows of small numbers in lexical order, and which of them each row is."""
    sizes = rows.max(axis=0) + 1
    if np.prod(sizes.astype(float)) > len(rows) + 1000:
        present, which = np.unique(rows, axis=0, return_inverse=True)
        return present, which.ravel()
    codes = np.ravel_multi_index(tuple(rows.T), tuple(sizes))  # sorting takes longer than all the rest
    present = np.flatnonzero(np.bincount(codes))
    return np.stack(np.unravel_index(present, tuple(sizes)), axis=1), np.searchsorted(present, codes)


def pulses_of(kinks: np.ndarray, tolerance: float, rounding: float, step: float) -> np.ndarray:
    """Kinks closer to each other than other events may be, but not by rounding: a pulse can be that short."""
    ordered = merge(kinks, 4 * max(rounding, 4 * np.spacing(step)))
    short = np.flatnonzero(np.diff(ordered) <= tolerance)
    return np.asarray(ordered[distinct(np.concatenate([short, short + 1]))])


def clipped(times: np.ndarray, time: Time, tolerance: float) -> np.ndarray:
    """Sorted events from start to end, both exactly."""
    inside = times[(times > time.start + tolerance) & (times < time.end - tolerance)]
    return np.concatenate([[time.start], merge(inside, tolerance), [time.end]])


_KEPT = 1 << 17  # numbers one after the other that are kept in memory
_FOLLOWING: Memo[np.ndarray] = Memo(4, lambda numbers: numbers.size <= _KEPT)


def _following(first: int, count: int) -> np.ndarray:
    """So many numbers one after the other: the same array for stretches of a run that are alike; it is read only."""

    def made() -> np.ndarray:
        numbers = np.arange(first, first + count)
        numbers.flags.writeable = False
        return numbers

    return _FOLLOWING.get((first, count), made)


def at_events(times: np.ndarray, events: np.ndarray, tolerance: float) -> np.ndarray:
    """Times with those at events that lie before one by no more than a tolerance; events ascend."""
    if np.array_equal(times, events):
        return times
    moved = moved_up(events, times, tolerance)
    return times if np.array_equal(moved, times) else moved


def first_of(times: np.ndarray, events: np.ndarray) -> int | None:
    """Index of the first time among events, where times are events one after the other, as those of samples."""
    if not times.size or not events.size:
        return None
    first = int(np.searchsorted(events, times[0]))
    return first if np.array_equal(events[first : first + times.size], times) else None


def nearest_event(events: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Index of the event nearest to each time."""
    first = first_of(times, events)
    if first is not None:
        return _following(first, times.size)
    right = np.clip(np.searchsorted(events, times), 1, events.size - 1)
    return np.where(times - events[right - 1] <= events[right] - times, right - 1, right)
