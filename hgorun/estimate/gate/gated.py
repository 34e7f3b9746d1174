"""Runs in which outliers are left out: whether a sample is one is decided when it enters.

An observer that is taken back to the time of a late sample goes on from there with what was known of its innovations
then. So each sample is judged at its place in the order of measurement, as if all had come in time, and once more
whenever an older one arrives: what counts is the last judgement. An observer that takes late samples into its
innovation is offered those that are newer than all that it has used: what it has left out is as if it had never come.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np

from hgorun.engine.again import Again
from hgorun.engine.memory import Raw
from hgorun.engine.plan import Integers, Plan
from hgorun.engine.turns import in_turns, with_stops, without
from hgorun.estimate.gate.entering import Entering, SteppedRows, innovations_by_slot, needed_until, where_entering
from hgorun.estimate.gate.gate import Gate, Known, variances_along
from hgorun.estimate.gate.leaving_out import jumps_by_several, leave_out
from hgorun.estimate.gate.own_steps import OwnSteps, stepping
from hgorun.estimate.gate.turns import Turns
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import same_time
from hgorun.estimate.sessions import session_of
from hgorun.estimate.start.left_at_start import AtStart
from hgorun.symbolic.evaluate import Floats

_AHEAD, _MOST = 4, 512  # places with samples that are passed at once, as long as none is an outlier


class GatedRun:
    """A run that stops wherever samples enter, or observers are taken back.

    Parameters
    ----------
    prepared : PreparedEstimate
    plan : Plan
        Of the whole run.
    uneven : bool
        Whether it has two segments from each event to the next.
    used, offered : ndarray of bool, shape (samples, m)
        Which samples each observer takes if none is an outlier; afterwards which it has taken, and which were judged.
    again : Again, optional
        A flow that loses an observer is made again for it.
    """

    def __init__(
        self,
        prepared: PreparedEstimate,
        plan: Plan,
        uneven: bool,
        used: np.ndarray,
        offered: np.ndarray,
        again: Again | None,
    ) -> None:
        self._prepared, self._used, self._offered = prepared, used, offered
        self._newest = [[-np.inf] * used.shape[1] for _ in prepared.samples]  # that each observer has used
        self._taken = np.concatenate([one.taken for one in prepared.samples]).tolist()
        self._turns = Turns(prepared.run.structure.system, self._taken)
        self._equal = same_time(prepared.run.origin, prepared.run.time.end)
        self._covariances = prepared.covariances()
        self._stepping = stepping(prepared.experiment, [block.label for block in prepared.run.observers])
        self._rows = SteppedRows.of(prepared)
        self._own = OwnSteps(prepared.run.structure.system, self._rows.channels)
        self._start = AtStart.of(prepared)
        self._gate = Gate(prepared.experiment, [one.gate for one in prepared.samples], self._covariances)
        self._entering: dict[int, list[Entering]] = {}
        for place, one in where_entering(prepared):
            self._entering.setdefault(place, []).append(one)
        schedule = prepared.run.schedule
        self._order, self._events = schedule.order, schedule.events
        self._saved: dict[int, tuple[Known, Floats, Floats]] = {}  # by event: what is gone back to
        self._until = np.zeros(0, dtype=int) if self._order is None else needed_until(prepared)
        self._begins = set() if self._order is None else set(self._order.begins.tolist())
        self._members = tuple(j for j in range(used.shape[1]) if prepared.treatment(j) == "replay")
        self._places = sorted({*self._entering, *self._begins, *self._where_saved()})
        self._in_order = np.concatenate([one.used for one in prepared.samples])
        self._saving = set(self._where_saved())
        self._single = [k for k, place in enumerate(self._places) if self._is_single(place)]
        first_steps = np.flatnonzero(plan.counts[:, 1] == 0)[:: 2 if uneven else 1]  # of what follows each event
        plan, self._stops = with_stops(plan, first_steps[self._places])
        self._session = session_of(prepared, plan, again)

    def _where_saved(self) -> Iterator[int]:
        """Where observers will be taken back to."""
        if self._order is not None:
            yield from np.flatnonzero(self._until[self._order.event] > self._order.now).tolist()

    def _is_single(self, place: int) -> bool:
        """Whether a place is not passed with others.

        There observers are taken back or will be taken back to, or a sample comes after a newer one, which not every
        observer may have used, or after one that was taken at the same time, or the start has judged it.
        """
        entering = self._entering.get(place, [])
        known = any(one.used in self._start.left or one.used in self._start.near for one in entering)
        older = known or any(not self._in_order[one.used] and not self._goes_back(one) for one in entering)
        again = len(entering) > 1 and any(self._turns.again(entering))
        return not entering or older or again or place in self._begins or place in self._saving

    def carried_out(self) -> Raw:
        """All of it."""
        session, stops = self._session, self._stops.tolist()
        number, ahead = 0, _AHEAD
        while number < len(stops):
            some = slice(number, min(number + ahead, self._next_single(number, len(stops))))
            asked = 0 if self._own.last else len(stops[some])
            passed = self._pass(self._places[some], stops[some]) if asked else 0
            number += passed
            if passed and passed == asked:
                ahead = min(2 * ahead, _MOST)
                continue
            ahead = max(ahead // 2, _AHEAD) if asked else ahead
            place, stop = self._places[number], stops[number]
            number += 1
            event = place if self._order is None else int(self._order.event[place])
            session.advance(stop)
            z, w = session.z.copy(), session.w.copy()
            if place in self._begins:
                known, z, w = self._saved[event]
                for row, kept in zip(self._gate.deviations, known, strict=True):
                    for j in self._members:
                        row[j].restore(kept[j])
            if place in self._saving:
                self._saved[event] = self._gate.state(), z, w
            self._enter(place, stop, float(self._events[event]), z, w)
        return session.finish()

    def _next_single(self, number: int, end: int) -> int:
        """The next place that is not passed with others."""
        which = bisect_left(self._single, number)
        return self._single[which] if which < len(self._single) else end

    def _pass(self, places: Sequence[int], stops: Sequence[int]) -> int:
        """Let the samples of some places enter as if there were no outliers: how many places there are before one."""
        session, gate = self._session, self._gate
        mark, known = session.mark(stops[-1] + 1), gate.state()
        entering = [self._entering[place] for place in places]
        slots = [one.slot for several in entering for one in several]
        first = session.innovations[slots]  # what is kept is what was thought at first
        session.innovations[slots] = np.nan
        times = self._events[list(places) if self._order is None else self._order.event[list(places)]]
        variances = variances_along(self._covariances, session, stops, times)
        session.advance(stops[-1] + 1)
        model, every = self._prepared.run.plant.model, [one for several in entering for one in several]
        innovations = innovations_by_slot(every, model, session.innovations)
        together = zip(entering, variances, strict=True)
        count = next(
            (k for k, (some, own) in enumerate(together) if not gate.passed(some, innovations, own)), len(places)
        )
        for one in (one for several in entering[:count] for one in several):
            self._used[one.used, list(one.members)] = self._offered[one.used, list(one.members)] = True
            self._use(one, one.members)
        if count < len(places):
            gate.restore(known)
            for several, own in zip(entering[:count], variances, strict=False):
                gate.passed(several, innovations, own)
            session.innovations[slots] = np.nan
            session.go_back(mark)
            if count:
                session.advance(stops[count - 1] + 1)
        session.innovations[slots] = np.where(np.isnan(first), session.innovations[slots], first)
        return count

    def _enter(self, place: int, stop: int, t: float, z: Floats, w: Floats) -> None:
        """Let samples enter, those of one channel one after the other where they enter its innovation."""
        session = self._session
        session.advance(stop)
        entering = self._entering.get(place, [])
        turns = self._turns.of(entering)
        named = [[(one.channel, one.slot) for one in some] for some in turns]
        held = self._prepared.run.structure.system.held
        flags = range(held.fresh(0), held.fresh(held.outputs)) if held.flags else range(0)
        rows = in_turns(session.actions, named, flags) if len(turns) > 1 else [session.actions]
        for number, (some, actions) in enumerate(zip(turns, rows, strict=True), start=1):
            self._enter_together(some, actions, number < len(turns), t, z, w)
            if number < len(turns):
                z, w = session.z.copy(), session.w.copy()

    def _goes_back(self, one: Entering) -> bool:
        """Whether the observers of a channel go back to where each sample is the newest."""
        return one.channel >= len(self._newest)

    def _enter_together(
        self, entering: Sequence[Entering], actions: Integers, again: bool, t: float, z: Floats, w: Floats
    ) -> None:
        """Let samples enter by some actions, and take back what outliers have done.

        What is older than all that has been used is noted only, as in a stream: what is taken back is rounded.
        """
        session, slots = self._session, [one.slot for one in entering]
        first = session.innovations[slots]  # what is kept is what was thought at first
        session.innovations[slots] = np.nan
        several = {one.channel for one, other in pairwise(entering) if one.channel == other.channel}
        arriving = dict(zip(slots, session.arriving(slots), strict=True)) if several else {}
        noted = [one for one in entering if not self._offered_to(one)]
        held = self._prepared.run.structure.system.held
        flags = [held.fresh(one.channel) for one in noted]
        actions = without(actions, [(one.channel, one.slot) for one in noted], flags) if noted else actions
        session.happen(actions, again=again)
        now = session.innovations[slots]
        session.innovations[slots] = np.where(np.isnan(first), now, first)
        out = dict[int, list[Entering]]()
        for one, innovations in zip(entering, now, strict=True):
            for j in () if one in noted else self._left_out(one, innovations, t, z, w):
                out.setdefault(j, []).append(one)
        for one in noted:
            self._used[one.used, list(one.members)] = False
        for j, samples in out.items():
            self._leave_out(j, samples, several, z, w, arriving)
        self._step_apart(entering, out, z, w)

    def _step_apart(self, entering: Sequence[Entering], out: Collection[int], z: Floats, w: Floats) -> None:
        """Let observers that step from sample to sample do so without those that they have left out.

        A step takes the samples of all outputs: where one of them is an outlier, all are left out.

        Parameters
        ----------
        entering : sequence of Entering
            What has just entered.
        out : collection of int
            The observers to which some of it is an outlier.
        z, w : ndarray
            What there was before.
        """
        session, system = self._session, self._prepared.run.structure.system
        entering = [one for one in entering if one.channel in self._rows.channels]
        for j in self._stepping if entering else ():
            row = self._rows.row(entering[0])
            if j in out:
                before = float(self._taken[self._rows.used(row - 1)[0]]) if row else None
                self._own.leave_out(j, session.w, before)
                self._used[self._rows.used(row), j] = False
            elif j in self._own.last:
                actions, held = self._own.take(j, session.happened, w, self._taken[self._rows.used(row)[0]])
                found, _ = session.happened_as(actions, z, held, {})
                start, stop, _ = system.blocks[j]
                session.z[start:stop] = found[start:stop]

    def _offered_to(self, one: Entering) -> Sequence[int]:
        """The observers that have used no newer sample."""
        if self._goes_back(one):
            return one.members
        newest, taken = self._newest[one.output], self._taken[one.used] + self._equal
        return [j for j in one.members if newest[j] <= taken]

    def _left_out(self, one: Entering, innovations: Floats, t: float, z: Floats, w: Floats) -> set[int]:
        """The observers that do not take a sample."""
        members = self._offered_to(one)
        start, left = self._start, one.used in self._start.left
        known = start.observers.intersection(members) if left or one.used in start.near else set[int]()
        others = [j for j in members if j not in known]
        found = (known if left else set[int]()).union(self._gate.outliers(one.output, innovations, t, z, w, others))
        taking = [j for j in members if j not in found]
        self._offered[one.used, list(members)] = True
        self._used[one.used, list(one.members)] = [j in taking for j in one.members]
        self._use(one, taking)
        return {*one.members}.difference(taking)

    def _use(self, one: Entering, members: Sequence[int]) -> None:
        newest, taken = self._newest[one.output], self._taken[one.used]
        for j in members:
            newest[j] = max(newest[j], taken)

    def _leave_out(
        self,
        j: int,
        samples: Sequence[Entering],
        several: Collection[int],
        z: Floats,
        w: Floats,
        arriving: Mapping[int, Floats],
    ) -> None:
        """Let an observer go on as if some of the samples that have just arrived had not.

        Parameters
        ----------
        several : collection of int
            The channels in which more than one has arrived.
        z, w, arriving
            What there was before, as :meth:`~hgorun.engine.session.Session.happened_without` asks for it.
        """
        session, system = self._session, self._prepared.run.structure.system
        channels, before = {one.channel for one in samples}, (z, w)
        if j in self._stepping:
            channels = {*self._rows.channels}
        if jumps_by_several(system, system.blocks[j][0]) or not channels.isdisjoint(several):
            before = session.happened_without([(one.channel, one.slot) for one in samples], z, w, arriving)
        for channel in channels:
            leave_out(system, session, channel, j, *before)
