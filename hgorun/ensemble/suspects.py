"""Members that seem to have lost an observer: looked at as single runs are, with their passes made side by side.

What is said of such a member takes passes without a bound and with steps 4 and 16 times shorter, see
:mod:`hgorun.simulation.confirmation`. Each of these passes is made for several members when the first of them asks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hgorun.engine.member_numbers import Outcome
from hgorun.engine.memory import Raw
from hgorun.engine.plan import Plan
from hgorun.ensemble.lot import Lot, Numbers, times_of
from hgorun.errors import PlantDiverged, Problem, SimulationError
from hgorun.simulation import passes
from hgorun.simulation.lanes import control_of
from hgorun.simulation.passes import Pass, as_given, plan_of
from hgorun.simulation.prepared import PreparedRun

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

    def raw(self, i: int) -> Raw:
        """What a member has given, up to where it was stopped."""
        return self._raw(i, 0)

    def again(self, i: int) -> Again:
        """A member once more."""
        return Again(self, i, passes.Again(self.runs[i], as_given(self.runs[i])))

    def free(self, i: int, shorter: int) -> Raw:
        """What a member gives without a bound, with steps so many times shorter.

        Raises
        ------
        PlantDiverged
        NotTogether
            Where no controlled step was small enough, or too many would be needed.
        Problem
            Where there is no time or no memory for so many steps.
        """
        return self._raw(i, shorter)

    def _raw(self, i: int, shorter: int) -> Raw:
        if shorter not in self._passes:
            self._passes[shorter] = self._pass(shorter)
        made = self._passes[shorter]
        if i in made.problems:
            raise made.problems[i]
        place, found, run = made.places[i], made.found, self.runs[i]
        if np.isneginf(found.plant_diverged[place]):
            raise NotTogether("controlled steps that need a closer look")
        if np.isfinite(found.plant_diverged[place]):
            raise PlantDiverged("the plant diverged", float(found.plant_diverged[place]))
        own = slice(place, place + 1)
        assert found.rows is not None
        slots = sum(channel.samples.size for channel in run.heard)
        nothing = np.full((slots, 1), np.nan), np.full((run.structure.system.held.size, 1), np.nan)
        steps = made.steps[place]
        return Raw(found.rows[:, :, own], nothing[0], found.diverged[:, own], found.error[:, own], nothing[1], steps)

    def _pass(self, shorter: int) -> _Made:
        """The pass of all members: with the bound for 0, else without it and with steps so many times shorter."""
        plans, starts, problems = [], [], {}
        for i, run in enumerate(self.runs):
            try:
                plan, start = plan_of(run, _how(run, shorter))
            except Problem as problem:
                problems[i] = problem
                continue
            plans.append(plan)
            starts.append(start)
        if not plans:
            raise problems[0]
        which = [i for i in range(len(self.runs)) if i not in problems]
        runs = [self.runs[i] for i in which]
        how = as_given(runs[0])
        ensemble, control = runs[0].structure.ensemble(how.method), control_of(how)
        if len({times_of(run) for run in runs}) == 1:
            numbers = Numbers.of(runs).beside(plans[0], starts[0].bound)
            found = ensemble.run(plans[0], numbers, rows=True, threads=self.threads, control=control)
        else:
            numbers = Lot.of(which, runs).numbers.beside(plans[0], starts[0].bound)
            found = ensemble.run_each(plans, numbers, rows=True, threads=self.threads, control=control)
        places = {i: place for place, i in enumerate(which)}
        return _Made(found, places, found.tries.tolist() if control else [plan.steps for plan in plans], problems)


@dataclass(frozen=True, eq=False)
class _Made:
    """A pass of several members: the place and the steps of each, and why some could not be made."""

    found: Outcome
    places: dict[int, int]
    steps: list[int]
    problems: dict[int, Problem]


def _how(run: PreparedRun, shorter: int) -> Pass:
    how = as_given(run)
    if not shorter:
        return how
    longest = how.step if shorter == 1 else min(how.step, run.longest_gap) / shorter
    return replace(how, step=longest, bounded=False)


@dataclass(frozen=True, eq=False)
class Again:
    """One member once more, see :class:`hgorun.simulation.loss.Again`."""

    suspects: Suspects
    i: int
    alone: passes.Again
    _plans: list[tuple[Plan, int]] = field(default_factory=list)

    def plan(self, shorter: int = 1) -> Plan:
        """The tables, with steps so many times shorter."""
        plan = self.alone.plan(shorter)
        self._plans.append((plan, shorter))
        return plan

    def integrate(self, plan: Plan) -> Raw:
        """What they give without a bound: that of all suspects together, but for tables that were changed."""
        for known, shorter in self._plans:
            if known is plan:
                try:
                    return self.suspects.free(self.i, shorter)
                except NotTogether:
                    break
        return self.alone.integrate(plan)
