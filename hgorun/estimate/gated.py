"""Runs in which outliers are left out: whether a sample is one is decided when it enters.

An observer that is taken back to the time of a late sample goes on from there with what was known of its innovations
then. So each sample is judged at its place in the order of measurement, as if all had come in time, and once more
whenever an older one arrives: what counts is the last judgement.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hgorun.engine.layout import HybridSystem
from hgorun.engine.memory import Raw
from hgorun.engine.plan import Plan
from hgorun.engine.session import Session, with_stops
from hgorun.estimate.covariance import Covariance
from hgorun.estimate.gate import RunningDeviation
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import stated
from hgorun.measurement.late import HeardOtherwise, Order
from hgorun.measurement.schedule import nearest_event
from hgorun.simulation.experiment import Experiment
from hgorun.symbolic.evaluate import Floats


@dataclass(frozen=True, kw_only=True)
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


def gated_run(prepared: PreparedEstimate, plan: Plan, *, uneven: bool, used: np.ndarray) -> Raw:
    """Carry a run out.

    Parameters
    ----------
    prepared : PreparedEstimate
    plan : Plan
        Of the whole run.
    uneven : bool
        Whether it has two segments from each event to the next.
    used : ndarray of bool, shape (samples, m)
        Which samples each observer takes; outliers become False.
    """
    return _GatedRun(prepared, plan, uneven, used).carried_out()


class _GatedRun:
    """A run that stops wherever samples enter, or observers are taken back."""

    def __init__(self, prepared: PreparedEstimate, plan: Plan, uneven: bool, used: np.ndarray) -> None:
        self._prepared, self._used = prepared, used
        self._gate = Gate(prepared.experiment, [one.gate for one in prepared.samples], prepared.covariances())
        self._entering: dict[int, list[Entering]] = {}
        for place, one in _entering(prepared):
            self._entering.setdefault(place, []).append(one)
        schedule = prepared.run.schedule
        self._order, self._events = schedule.order, schedule.events
        self._saved: dict[int, tuple[list[list[list[float]]], Floats, Floats]] = {}  # by event: what is gone back to
        self._until = np.zeros(0, dtype=int) if self._order is None else _needed_until(prepared)
        self._begins = set() if self._order is None else set(self._order.begins.tolist())
        self._members = tuple(j for j in range(used.shape[1]) if prepared.treatment(j) == "replay")
        self._places = sorted({*self._entering, *self._begins, *self._saving()})
        first_steps = np.flatnonzero(plan.counts[:, 1] == 0)[:: 2 if uneven else 1]  # of what follows each event
        plan, self._stops = with_stops(plan, first_steps[self._places])
        self._session = Session(prepared.program(), plan, prepared.start())

    def _saving(self) -> Iterator[int]:
        """Where observers will be taken back to."""
        if self._order is not None:
            yield from np.flatnonzero(self._until[self._order.event] > self._order.now).tolist()

    def carried_out(self) -> Raw:
        """All of it."""
        session = self._session
        saving = set(self._saving())
        for place, stop in zip(self._places, self._stops.tolist(), strict=True):
            event = place if self._order is None else int(self._order.event[place])
            session.advance(stop)
            z, w = session.z.copy(), session.w.copy()
            if place in self._begins:
                known, z, w = self._saved[event]
                for row, kept in zip(self._gate.deviations, known, strict=True):
                    for j in self._members:
                        row[j].restore(kept[j])
            if place in saving:
                self._saved[event] = [[one.state() for one in row] for row in self._gate.deviations], z, w
            self._enter(place, stop, float(self._events[event]), z, w)
        return session.finish()

    def _enter(self, place: int, stop: int, t: float, z: Floats, w: Floats) -> None:
        """Let samples enter, and take back what outliers have done."""
        session, entering = self._session, self._entering.get(place, [])
        slots = [one.slot for one in entering]
        first = session.innovations[slots]  # what is kept is what was thought at first
        session.innovations[slots] = np.nan
        session.advance(stop + 1)
        now = session.innovations[slots]
        session.innovations[slots] = np.where(np.isnan(first), now, first)
        system, out = self._prepared.run.structure.system, dict[int, list[tuple[int, int]]]()
        for one, innovations in zip(entering, now, strict=True):
            found = self._gate.outliers(one.output, innovations, t, z, w, one.members)
            self._used[one.used, list(one.members)] = [j not in found for j in one.members]
            for j in found:
                out.setdefault(j, []).append((one.channel, one.slot))
                leave_out(system, session, one.channel, j, z, w)
        for j, samples in out.items():
            start, stop, _ = system.blocks[j]
            if jumps_by_several(system, start):
                session.z[start:stop] = session.happened_without(samples, z, w)[start:stop]


def _entering(prepared: PreparedEstimate) -> Iterator[tuple[int, Entering]]:
    """Every sample that may be an outlier, with the places in the order of events where it enters."""
    schedule, slots, q = prepared.run.schedule, prepared.slots, len(prepared.samples)
    order, first = schedule.order, 0
    for number, channel in enumerate(prepared.run.heard):
        start, output, samples = first, number % q, channel.samples
        first += samples.arrival.size
        members = tuple(j for j in range(len(prepared.run.observers)) if prepared.group(j) == number // q)
        if prepared.samples[output].gate is None or not members:
            continue
        which = channel.which if isinstance(channel, HeardOtherwise) else np.arange(samples.arrival.size)
        at = nearest_event(schedule.events, samples.arrival)
        items = np.flatnonzero(samples.used)
        places = at[items] if order is None else order.first[at[items]]
        if order is not None and isinstance(channel, HeardOtherwise) and channel.known is not None:
            items, places = _as_known(order, at, nearest_event(schedule.events, channel.known))
        for k, place in zip(items.tolist(), places.tolist(), strict=True):
            own = slots[output].start + int(which[k])
            yield place, Entering(output=output, channel=number, slot=start + k, used=own, members=members)


def _as_known(order: Order, taken: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Samples and the places where they enter observers that are taken back, in the order of places."""
    items, places = order.places(taken)
    there = known[items] <= order.now[places]
    items, places = items[there], places[there]
    by_place = np.lexsort((items, places))
    return items[by_place], places[by_place]


def _needed_until(prepared: PreparedEstimate) -> np.ndarray:
    """Up to which event observers may be taken back to each."""
    events = prepared.run.schedule.events
    until = np.full(events.size, -1)
    for channel in prepared.run.heard:
        if isinstance(channel, HeardOtherwise) and channel.known is not None:
            taken, known = (nearest_event(events, times) for times in (channel.samples.taken, channel.known))
            np.maximum.at(until, taken, known)
    return until


class Gate:
    """Which samples are outliers to which observers, one sample after the other.

    Parameters
    ----------
    experiment : Experiment
    limits : sequence of float or None
        Of every output the standard deviations beyond which a sample is an outlier.
    covariances : sequence of Covariance or None
        Of every observer.
    """

    def __init__(
        self, experiment: Experiment, limits: Sequence[float | None], covariances: Sequence[Covariance | None]
    ) -> None:
        self._model, self._limits, self._covariances = experiment.plant.model, limits, covariances
        known = stated(experiment)
        self.deviations = [
            [RunningDeviation(known.get(output, 0.0)) for _ in experiment.observers] for output in self._model.outputs
        ]

    def outliers(
        self,
        output: int,
        innovations: Floats,
        t: float,
        z: Floats,
        w: Floats,
        members: Sequence[int] | None = None,
    ) -> list[int]:
        """The observers to which a sample of an output is an outlier, from the innovation of each, shape (m,).

        Parameters
        ----------
        t : float
        z, w : ndarray
            The states, and what was held, before the sample arrived.
        members : sequence of int, optional
            The observers that are asked, where these are not all.
        """
        limit, found = self._limits[output], []
        wrapped = self._model.wrapped(output, innovations).tolist()
        for j in range(len(wrapped)) if members is None else members:
            one, deviation, covariance = wrapped[j], self.deviations[output][j], self._covariances[j]
            size = deviation.value
            if covariance is not None:
                known = float(covariance.variance(np.array([t]), z[None], w)[0, output])
                size = known**0.5 if known >= 0 else size
            if limit is not None and abs(one) > limit * size:
                found.append(j)
            deviation.add(one)
        return found


class Running(Protocol):
    """A run that can be looked at between events."""

    @property
    def z(self) -> Floats:
        """All states."""
        ...

    @property
    def w(self) -> Floats:
        """What is held."""
        ...


def jumps_by_several(system: HybridSystem, start: int) -> bool:
    """Whether the observer that begins there is corrected by all samples that arrive at once, of several outputs."""
    return any(system.jumps[number][0] == start and last - first > 1 for number, first, last in system.corrections)


def leave_out(system: HybridSystem, live: Running, output: int, j: int, z: Floats, w: Floats) -> None:
    """Let an observer go on as if a sample that has just arrived had not.

    Its innovation stays what it was; what it has jumped to is taken back.

    Parameters
    ----------
    j : int
        The observer's number.
    z, w : ndarray
        The states, and what was held, before the sample arrived.
    """
    layout = system.held
    place, y = layout.s(output, j), layout.output(output)
    if system.has_alpha:
        alpha = system.alpha[output][j]
        before = w[place] + z[alpha] - w[y]
        live.w[place] = before + live.w[y] - live.z[alpha]
    start, stop, _ = system.blocks[j]
    live.z[start:stop] = z[start:stop]
