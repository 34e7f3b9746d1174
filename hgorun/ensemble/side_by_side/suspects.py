"""Members that seem to have lost an observer: looked at as single runs are, with their passes made side by side.

What is said of such a member takes passes without a bound and with steps 4 and 16 times shorter, see
:mod:`hgorun.simulation.divergence.confirmation`. Each of these passes is made for several members when the first of
them asks, and ends when nothing is left of the suspect observers of all that are side by side.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hgorun.engine.member_numbers import MemberNumbers, Outcome
from hgorun.engine.memory import Raw, Start
from hgorun.engine.plan import Plan
from hgorun.ensemble.preparation.lot import Lot, Numbers, times_of
from hgorun.errors import PlantDiverged, Problem, SimulationError
from hgorun.simulation.divergence.confirmation import ends_with_suspects, suspects_of
from hgorun.simulation.passes import passes
from hgorun.simulation.passes.lanes import control_of
from hgorun.simulation.passes.passes import Pass, as_given, plan_of
from hgorun.simulation.prepared import PreparedRun

# what side by side a step of all lanes takes, alone it takes one; with one plan for all, and with one for each
_ALIKE, _OWN = 2.0, 2.5
_NUMBERS = 16_000_000  # doubles of the trajectories of members that are looked at together


class NotTogether(SimulationError):
    """A pass that has to be made alone."""


def together(run: PreparedRun) -> int:
    """How many members like this one are looked at together."""
    return max(_NUMBERS // (run.grid.size * run.structure.system.states), 1)


@dataclass(frozen=True, eq=False)
class Suspects:
    """Members that are looked at together, with one plan or each with its own.

    Attributes
    ----------
    runs : sequence of PreparedRun
        A run for each.
    threads : int
    """

    runs: Sequence[PreparedRun]
    threads: int = 1
    _passes: dict[int, _Made] = field(default_factory=dict)
    _lock: threading.RLock = field(default_factory=threading.RLock)  # a pass is made once, whoever asks first

    def raw(self, i: int) -> Raw:
        """What a member has given, up to where it was stopped."""
        raw = self._made(0).raw(self.runs[i], i)
        assert raw is not None  # that pass is made of all
        return raw

    def again(self, i: int) -> Again:
        """A member once more."""
        return Again(self, i, passes.Again(self.runs[i], as_given(self.runs[i])))

    def free(self, i: int, shorter: int, until: Sequence[int]) -> Raw | None:
        """What a member gives without a bound, with steps so many times shorter.

        None where that has not been found side by side with others, or not so far.

        Parameters
        ----------
        until : sequence of int
            As of :class:`hgorun.simulation.passes.loss.Again`.

        Raises
        ------
        PlantDiverged
        Problem
            Where there is no time or no memory for so many steps.
        """
        made = self._made(shorter)
        try:
            raw, awaited = made.raw(self.runs[i], i), made.awaited[i]
        except NotTogether:
            return None
        if raw is None:
            return None
        ended = bool(awaited) and _all_lost(raw, awaited)
        return None if ended and not (until and _all_lost(raw, until)) else raw

    def _made(self, shorter: int) -> _Made:
        with self._lock:
            if shorter not in self._passes:
                self._passes[shorter] = self._pass(shorter)
            return self._passes[shorter]

    def _pass(self, shorter: int) -> _Made:
        """The pass of all members: with the bound for 0, else without it and with steps so many times shorter."""
        plans: dict[int, tuple[Plan, Start]] = {}
        problems: dict[int, Problem] = {}
        for i, run in enumerate(self.runs):
            try:
                plans[i] = plan_of(run, _how(run, shorter))
            except Problem as problem:
                problems[i] = problem
        if not plans:
            raise problems[0]
        awaited = {i: self._awaited(i, shorter) for i in plans}
        one = self.runs[0]
        how = as_given(one)
        ensemble, control = one.structure.ensemble(how.method), control_of(how)
        alike = len({times_of(self.runs[i]) for i in plans}) == 1
        which = list(plans)
        if shorter:
            ends = {i: self._end(i, awaited[i]) for i in plans}
            which = side_by_side(ends, ensemble.lanes, _ALIKE if alike else _OWN)
        steps = {i: plan.steps for i, (plan, _) in plans.items()}
        if not which:
            return _Made(None, {}, steps, problems, awaited)
        own, runs, bound = [plans[i][0] for i in which], [self.runs[i] for i in which], plans[which[0]][1].bound
        found: Outcome
        if alike:
            numbers = _ending(Numbers.of(runs).beside(own[0], bound), [awaited[i] for i in which])
            found = ensemble.run(own[0], numbers, rows=True, threads=self.threads, control=control)
        else:
            numbers = _ending(Lot.of(which, runs).numbers.beside(own[0], bound), [awaited[i] for i in which])
            found = ensemble.run_each(own, numbers, rows=True, threads=self.threads, control=control)
        if control:
            steps = dict(zip(which, found.tries.tolist(), strict=True))
        return _Made(found, {i: place for place, i in enumerate(which)}, steps, problems, awaited)

    def _awaited(self, i: int, shorter: int) -> list[int]:
        """The observers of a member without which a pass need not go on: the suspects, as far as these overflow."""
        run = self.runs[i]
        if shorter == 0 or (shorter == 1 and not ends_with_suspects(run)):
            return []
        try:
            suspects = suspects_of(run, self.raw(i))
            free = self._passes[1].raw(run, i) if shorter > 1 and 1 in self._passes else None
        except SimulationError:
            suspects, free = [], None
        overflown = [] if free is None else [j for j in suspects if np.isfinite(free.diverged[j, 0])]
        return overflown or suspects or list(range(len(run.observers)))

    def _end(self, i: int, awaited: Sequence[int]) -> float:
        """About which part of a run it takes until nothing is left of some observers."""
        try:
            lost = self.raw(i).diverged[awaited, 0]
        except SimulationError:
            return 1.0
        run = self.runs[i]
        return min(float(np.max(lost, initial=0.0) - run.time.start) / run.span, 1.0) if lost.size else 1.0


def side_by_side(ends: Mapping[int, float], lanes: int, cost: float) -> list[int]:
    """Those of some runs that are better made side by side than alone, those that end together as neighbours.

    Parameters
    ----------
    ends : mapping
        Of each run how long it takes.
    lanes : int
        So many side by side go on until the last of them ends.
    cost : float
        What they take for a step, a run alone taking one.
    """
    order = sorted(ends, key=lambda i: -ends[i])
    lengths = [ends[i] for i in order]
    costs = [sum(lengths[:k]) + cost * sum(lengths[k::lanes]) for k in range(len(order) + 1)]
    return order[int(np.argmin(costs)) :]


def _ending(numbers: MemberNumbers, awaited: Sequence[Sequence[int]]) -> MemberNumbers:
    """The same, ending where nothing is left of what is awaited of each member."""
    if not any(awaited):
        return numbers
    flags = np.zeros((max(map(max, awaited)) + 1, len(awaited)))
    for place, which in enumerate(awaited):
        flags[which, place] = 1.0
    return replace(numbers, awaited=flags)


@dataclass(frozen=True, eq=False)
class _Made:
    """A pass of several members.

    Attributes
    ----------
    found : Outcome or None
        None where each is better off alone.
    places : dict
        Of those that have been carried out side by side.
    steps, awaited : dict
        The steps of each, and the observers without which it need not have gone on.
    problems : dict
        Why some could not be made.
    """

    found: Outcome | None
    places: dict[int, int]
    steps: dict[int, int]
    problems: dict[int, Problem]
    awaited: dict[int, list[int]]

    def raw(self, run: PreparedRun, i: int) -> Raw | None:
        """What a member has given; None where it has not been carried out.

        Raises
        ------
        PlantDiverged
        NotTogether
            Where no controlled step was small enough, or too many would have been needed.
        Problem
        """
        if i in self.problems:
            raise self.problems[i]
        if self.found is None or i not in self.places:
            return None
        found, place = self.found, self.places[i]
        if np.isneginf(found.plant_diverged[place]):
            raise NotTogether("its controlled steps have to be looked at alone")
        if np.isfinite(found.plant_diverged[place]):
            raise PlantDiverged("the plant diverged", float(found.plant_diverged[place]))
        own = slice(place, place + 1)
        assert found.rows is not None
        slots = sum(channel.samples.size for channel in run.heard)
        nothing = np.full((slots, 1), np.nan), np.full((run.structure.system.held.size, 1), np.nan)
        return Raw(
            found.rows[:, :, own], nothing[0], found.diverged[:, own], found.error[:, own], nothing[1], self.steps[i]
        )


def _all_lost(raw: Raw, which: Sequence[int]) -> bool:
    """Whether nothing is left of some observers of a member."""
    return bool(np.all(np.isfinite(raw.diverged[list(which), 0])))


def _how(run: PreparedRun, shorter: int) -> Pass:
    how = as_given(run)
    if not shorter:
        return how
    longest = how.step if shorter == 1 else min(how.step, run.longest_gap) / shorter
    return replace(how, step=longest, bounded=False)


@dataclass(frozen=True, eq=False)
class Again:
    """One member once more, see :class:`hgorun.simulation.passes.loss.Again`."""

    suspects: Suspects
    i: int
    alone: passes.Again
    _plans: list[tuple[Plan, int]] = field(default_factory=list)

    def plan(self, shorter: int = 1) -> Plan:
        """The tables, with steps so many times shorter."""
        plan = self.alone.plan(shorter)
        self._plans.append((plan, shorter))
        return plan

    def integrate(self, plan: Plan, until: Sequence[int] = ()) -> Raw:
        """What they give without a bound: that of all suspects together, but for tables that were changed."""
        for known, shorter in self._plans:
            if known is plan and (found := self.suspects.free(self.i, shorter, until)) is not None:
                return found
        return self.alone.integrate(plan, until)
