"""Members whose seed moves or drops the samples of their only output: their tables, for many of them at once.

Those with as many samples go through the same events, at other times and perhaps in another order between kinks of
functions of time: of each such kind one member is tabulated in full, and the others have its actions at their times.
So that nothing is taken for granted, that member and the last one are compared with what has been made at once; where a
single bit differs, all of the kind are prepared one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hgorun.engine.methods import METHODS
from hgorun.engine.plan import Plan
from hgorun.ensemble.found import Floats, Integers
from hgorun.measurement.chance import OfSeeds
from hgorun.measurement.noise import is_relative
from hgorun.measurement.sampling import samples_by_chance
from hgorun.measurement.schedule import Schedule, clipped, inward_of, nearest_event, tolerances
from hgorun.simulation.checks.checks import longest_step
from hgorun.simulation.passes.passes import as_given, plan_of
from hgorun.simulation.plant_alone import plant_kinks
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.timeline.steps import steps_needed, steps_of_a_piece
from hgorun.simulation.timeline.tabulated import rows_in_last_steps

_APART = 4.0  # times how near events are one: so far apart they have to be


def is_plain(run: PreparedRun) -> bool:
    """Whether all that happens in a run are samples of one output, by chance, and kinks of functions of time."""
    if len(run.channels) != 1 or len(run.channels[0].stretches) != 1 or not isinstance(run.schedule, Schedule):
        return False
    (channel,), (stretch,), system = run.channels, run.channels[0].stretches, run.structure.system
    held = any(item.hold is not None for one in channel.noise for item in one.random)
    sampled = stretch.sampled_by_chance and stretch.undelayed and not is_relative(stretch) and not held
    more = system.stepped or system.corrections or system.remembers or run.treatments or run.closed
    return sampled and not more and run.schedule.acting is None and not run.solver.controlled


@dataclass(frozen=True, eq=False)
class Retimed:
    """Members that differ from a run in their seeds alone.

    Attributes
    ----------
    run : PreparedRun
        The first of them, which :func:`is_plain`.
    seeds : ndarray of int64, shape (N,)
    chance : OfSeeds
        Their random numbers.
    full : callable
        Prepares a member in full, by its place; None where that cannot be.
    """

    run: PreparedRun
    seeds: Integers
    chance: OfSeeds
    full: Callable[[int], PreparedRun | None]

    def plans(self) -> Iterator[tuple[PreparedRun, dict[int, Plan]]]:
        """For each kind of members a run of it, and the plans of those of them, by their places, that are certain.

        Raises
        ------
        Problem
            Where a member that is prepared in full cannot be carried out.
        """
        if not self._kinks_are_events:
            return
        for which, arrival, v in self._kinds():
            ends = [(place, self.full(int(which[place]))) for place in sorted({0, which.size - 1})]
            run = ends[0][1]
            if run is None or any(other is None or other.structure is not run.structure for _, other in ends):
                continue
            sound, plans = self._with_times(plan_of(run, as_given(run))[0], arrival, v)
            expected = {place: plan_of(other, as_given(run))[0] for place, other in ends if other is not None}
            made = dict(zip(sound.tolist(), plans, strict=True))
            if all(place in made and _equal(made[place], plan) for place, plan in expected.items()):
                yield run, {int(which[place]): plan for place, plan in made.items()}

    def _kinds(self) -> Iterator[tuple[Integers, Floats, Floats]]:
        """Members with as many samples in order, of which as many lie at the ends: places, arrivals and noise."""
        channel = self.run.channels[0]
        times, kept = samples_by_chance(channel.stretches[0], self.chance.uniform, channel.name)
        many = channel.of_many(self.seeds.size, self.seeds, {}).noise[0]
        noise = many.sampled_each(times, np.arange(times.shape[1]))
        at_ends = [kept & (times == end) for end in (self.run.time.start, self.run.time.end)]
        numbers = np.stack([of.sum(axis=1) for of in (kept, *at_ends)], axis=1)
        _, kind = np.unique(numbers, axis=0, return_inverse=True)
        order = np.argsort(kind.ravel(), kind="stable")
        for which in np.split(order, np.flatnonzero(np.diff(kind.ravel()[order])) + 1):
            count, own = int(numbers[which[0], 0]), kept[which]
            if count and np.all(np.isfinite(noise[which])):
                yield which, times[which][own].reshape(-1, count), noise[which][own].reshape(-1, count)

    @cached_property
    def _tolerance(self) -> float:
        return tolerances(self.run.channels, self.run.step)[1]

    @cached_property
    def _kinks(self) -> Floats:
        return plant_kinks(self.run.plant, self.run.time, self.run.origin).times

    @cached_property
    def _fixed(self) -> Floats:
        """The events that are no samples."""
        return clipped(self._kinks, self.run.time, self._tolerance)

    @property
    def _kinks_are_events(self) -> bool:
        """Whether kinks are so far apart that each is an event, or as good as at one."""
        away = np.abs(self._kinks - self._fixed[nearest_event(self._fixed, self._kinks)])
        return bool(np.all(away <= self._tolerance) and np.all(np.diff(self._fixed) > _APART * self._tolerance))

    def _with_times(self, full: Plan, arrival: Floats, v: Floats) -> tuple[Integers, list[Plan]]:
        """A plan with the samples of other members, and which of them these are: nothing may be too near.

        Parameters
        ----------
        full : Plan
            Of the first member.
        arrival, v : ndarray, shape (n, Nk)
            When samples arrive, and their noise.
        """
        fixed, (start, end) = self._fixed, (self.run.time.start, self.run.time.end)
        early, late = int(arrival[0, 0] == start), int(arrival[0, -1] == end)
        inside = arrival[:, early : arrival.shape[1] - late]
        times = np.concatenate([np.broadcast_to(fixed, (len(arrival), fixed.size)), inside], axis=1)
        order = np.argsort(times, axis=1, kind="stable")
        events = np.take_along_axis(times, order, axis=1)
        sound = np.all(np.diff(events) > _APART * self._tolerance, axis=1) & np.all(np.diff(arrival) > 0, axis=1)
        sound &= (events[:, 0] == start) & (events[:, -1] == end)
        steps = steps_needed(np.diff(events), longest_step(self.run, self.run.step))
        sound &= np.max(steps, axis=1) <= steps_of_a_piece(0)
        events, order, steps, v = events[sound], order[sound], steps[sound], v[sound]
        if len(full.counts) != events.shape[1] or len(full.actions) % arrival.shape[1]:
            return np.zeros(0, dtype=np.int64), []
        at_sample = order >= fixed.size
        at_sample[:, 0], at_sample[:, -1] = early, late
        spans, counts = self._segments(events, order, steps), np.empty((*events.shape, 7), dtype=np.int64)
        counts[:] = full.counts[-1]
        counts[:, :-1, 0] = counts[:, :-1, 2] = steps
        heard = np.maximum.accumulate(at_sample, axis=1)
        counts[:, :, 3] = np.where(heard, full.counts[-1, 3], full.counts[0, 3])
        each = len(full.actions) // arrival.shape[1]
        counts[:, :, 5] = each * np.cumsum(at_sample, axis=1)
        counts[:, :, 4] = counts[:, :, 5] - each * at_sample
        counts[:, :-1, 6] = 1
        if not METHODS[as_given(self.run).method].error:  # those always need the slope
            segment = events[:, :-1].ravel(), events[:, 1:].ravel(), steps.ravel()
            counts[:, :-1, 6] = rows_in_last_steps(*segment, full.grid).reshape(steps.shape)
        multiplicative = self.run.channels[0].stretches[0].multiplicative
        gain, bias = (1 + v, np.zeros_like(v)) if multiplicative else (np.ones_like(v), v)
        numbers = zip(spans, counts, gain, bias, strict=True)
        plans = [replace(full, spans=s, counts=c, gain=g, bias=b) for s, c, g, b in numbers]
        return np.flatnonzero(sound), plans

    def _segments(self, events: Floats, order: Integers, steps: Floats) -> Floats:
        """The times of all segments, shape (n, events, 4); the last one is the end."""
        fixed = self._fixed
        inward = np.zeros(order.shape[1])
        inward[: fixed.size] = inward_of(fixed, self._kinks, self.run.step)
        inward = inward[order]
        spans = np.empty((*events.shape, 4))
        spans[:, :-1, 0], spans[:, :-1, 1] = events[:, :-1], events[:, 1:]
        spans[:, :-1, 2], spans[:, :-1, 3] = events[:, :-1] + inward[:, :-1], events[:, 1:] - inward[:, 1:]
        spans[:, -1] = events[:, -1:]
        return spans


def _equal(plan: Plan, other: Plan) -> bool:
    """Whether two plans are the same to the last bit."""
    sizes = [(of.slots, of.reach, of.origin, of.snapshots) for of in (plan, other)]
    names = "spans", "counts", "actions", "grid", "gain", "bias", "holds"
    arrays = [(getattr(plan, name), getattr(other, name)) for name in names]
    return sizes[0] == sizes[1] and all(a.shape == b.shape and a.tobytes() == b.tobytes() for a, b in arrays)
