"""Members that seem to have lost an observer: looked at as single runs are, with their passes made side by side.

What is said of such a member takes passes without a bound and with steps 4 and 16 times shorter, see
:mod:`hgorun.simulation.confirmation`. Each of these passes is made for several members when the first of them asks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hgorun.engine.ensemble import Outcome
from hgorun.engine.memory import Raw
from hgorun.engine.plan import Plan
from hgorun.ensemble.lot import Lot, Numbers
from hgorun.errors import PlantDiverged
from hgorun.simulation import passes
from hgorun.simulation.passes import Pass, as_given, plan_of
from hgorun.simulation.prepared import PreparedRun

_NUMBERS = 16_000_000  # doubles of the trajectories of members that are looked at together


def together(run: PreparedRun) -> int:
    """How many members like this one are looked at together."""
    return max(_NUMBERS // (run.grid.size * run.structure.system.states), 1)


@dataclass(frozen=True, eq=False)
class Suspects:
    """Members of one plan that are looked at together.

    Attributes
    ----------
    runs : sequence of PreparedRun
        A run for each.
    threads : int
    """

    runs: Sequence[PreparedRun]
    threads: int = 1
    _passes: dict[int, tuple[Outcome, int]] = field(default_factory=dict)

    @property
    def how(self) -> Pass:
        """The pass that has made them suspects."""
        return as_given(self.runs[0])

    def raw(self, i: int) -> Raw:
        """What a member has given, up to where it was stopped."""
        return self._raw(i, 0)

    def again(self, i: int) -> Again:
        """A member once more."""
        return Again(self, i, passes.Again(self.runs[i], self.how))

    def free(self, i: int, shorter: int) -> Raw:
        """What a member gives without a bound, with steps so many times shorter.

        Raises
        ------
        PlantDiverged
        """
        return self._raw(i, shorter)

    def _raw(self, i: int, shorter: int) -> Raw:
        found, steps = self._pass(shorter)
        if np.isfinite(found.plant_diverged[i]):
            raise PlantDiverged("the plant diverged", float(found.plant_diverged[i]))
        own, run = slice(i, i + 1), self.runs[i]
        assert found.rows is not None
        slots = sum(channel.samples.arrival.size for channel in run.channels)
        nothing = np.full((slots, 1), np.nan), np.full((run.structure.system.held.size, 1), np.nan)
        return Raw(found.rows[:, :, own], nothing[0], found.diverged[:, own], found.error[:, own], nothing[1], steps)

    def _pass(self, shorter: int) -> tuple[Outcome, int]:
        """The pass of all members: with the bound for 0, else without it and with steps so many times shorter."""
        if shorter not in self._passes:
            run, how = self.runs[0], self.how
            if shorter:
                longest = how.step if shorter == 1 else min(how.step, run.longest_gap) / shorter
                how = replace(how, step=longest, bounded=False)
            lot = Lot(run, np.arange(len(self.runs)), Numbers.of(self.runs))
            plan, start = plan_of(run, how)
            numbers = lot.numbers.beside(plan, start.bound)
            ensemble = run.structure.ensemble(how.method)
            self._passes[shorter] = ensemble.run(plan, numbers, rows=True, threads=self.threads), plan.steps
        return self._passes[shorter]


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
                return self.suspects.free(self.i, shorter)
        return self.alone.integrate(plan)
