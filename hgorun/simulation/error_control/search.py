"""The search for steps that are short enough: passes that are paid for out of a budget, compared two by two."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from hgorun.config.models import Method
from hgorun.engine.memory import Raw, Tolerance
from hgorun.engine.program import TooManySteps
from hgorun.errors import PlantDiverged, SimulationError
from hgorun.result.records.data import IntegrationError
from hgorun.result.records.status import Verdict
from hgorun.simulation.checks.checks import longest_step
from hgorun.simulation.divergence.confirmation import ended
from hgorun.simulation.divergence.stopped import stopped
from hgorun.simulation.error_control.error_estimate import differences
from hgorun.simulation.error_control.ladder import (
    UNEVEN,
    finest_rung,
    further_down,
    order_of,
    rung,
    step_counts,
    steps_left,
)
from hgorun.simulation.outcome.measured import Measured, measured
from hgorun.simulation.passes.between_steps import may_jump, missed
from hgorun.simulation.passes.passes import Again, Pass, integrate, part_of_error
from hgorun.simulation.prepared import PreparedRun

Progress = Callable[[float], None] | None

TRIES, MORE = 20_000, 8  # controlled steps that a method may try at first, and how many times more next time
_TOLERANCE = 1e-3  # of the accuracy, to begin with
TIGHTEST = 1e-13
_PART, _OTHER_PART = 1 / 100, 1 / 137  # of the run: the longest controlled steps of two passes


@dataclass(kw_only=True, eq=False, repr=False)
class Budget:
    """Evaluations of the right-hand side that are left."""

    run: PreparedRun
    progress: Progress
    left: float
    spent: int = 0

    def steps(self, method: Method) -> float:
        """How many steps they are enough for."""
        return steps_left(method, self.left, self.spent)

    def carry_out(self, how: Pass) -> Finished:
        """A pass, paid for."""
        try:
            raw = integrate(self.run, how, self.progress)
        except TooManySteps as error:
            self.spent += int(error.args[0]) * how.evaluations_of_a_step
            raise
        self.spent += raw.tries * how.evaluations_of_a_step
        raw, verdicts = ended(self.run, raw, same=Again(self.run, how))
        return Finished(how, raw, verdicts, measured(self.run, raw, verdicts))


@dataclass(frozen=True, eq=False, repr=False)
class Finished:
    """What a pass has given: its numbers, and the observers that are lost in it."""

    how: Pass
    raw: Raw
    verdicts: dict[str, Verdict]
    measured: Measured


@dataclass(frozen=True, eq=False, repr=False)
class Attempt:
    """A pass, and how far it may be from the exact solution."""

    finished: Finished
    error: IntegrationError

    @property
    def worst(self) -> float:
        """The largest error."""
        return max(self.error.relative.values())


@dataclass(kw_only=True, eq=False, repr=False)
class Search:
    """The search for steps that are short enough.

    Attributes
    ----------
    best : Attempt or None
        The last that could be finished.
    tried : bool
        Whether controlled steps have been tried.
    failure : SimulationError or None
        Why controlled steps could not.
    lost : PlantDiverged or None
        That the plant diverged in the pass with the shortest fixed steps.
    """

    run: PreparedRun
    budget: Budget
    best: Attempt | None = None
    tried: bool = False
    failure: SimulationError | None = field(default=None)
    lost: PlantDiverged | None = field(default=None)

    @property
    def accuracy(self) -> float:
        return self.run.solver.accuracy

    def enough(self) -> bool:
        """Whether what was found last is accurate, and no observer has been lost in it that must be looked at."""
        return self.best is not None and self.best.worst <= self.accuracy

    def fixed(self, method: Method, limit: float) -> bool:
        """Down the ladder with fixed steps, ``limit`` in number; whether that was enough."""
        k = rung(self.run)
        down, before = 1, np.inf
        while True:
            step = self.run.span / 2.0**k
            if not self._affordable(method, step, limit) or k > finest_rung(self.run):
                return False
            how = Pass(method=method, step=step, bounded=False)
            error = self._compared(how, replace(how, uneven=UNEVEN))
            if before == np.inf and self._jumps(how):
                return False
            if self.enough():
                return self._certain()
            order = order_of(method, np.array(error), np.array(before), np.array(down))
            down, before = int(further_down(np.array(error / self.accuracy), order)), error
            k += down

    def _jumps(self, how: Pass) -> bool:
        """Whether controlled steps should be tried, since equations jump where the run passes."""
        controllable = self.run.solver.method == "auto" and not self.run.structure.system.decides
        asked = controllable and not self.tried and may_jump(self.run)
        return asked and missed(self.run, how).jumps

    def _affordable(self, method: Method, step: float, limit: float = np.inf) -> bool:
        count, other = step_counts(self.run, step)
        return count <= limit and count + other <= self.budget.steps(method)

    def something(self, method: Method) -> bool:
        """Where nothing was affordable: the shortest fixed steps that are; whether that was enough.

        Not where the plant diverged: longer steps stay behind what grows so fast, and end before it overflows.
        """
        k = rung(self.run)
        while self.best is None and self.lost is None and k > 0:
            k -= 1
            step = self.run.span / 2.0**k
            if self._affordable(method, step):
                how = Pass(method=method, step=step, bounded=False)
                self._compared(how, replace(how, uneven=UNEVEN))
        return self.enough()

    def _certain(self) -> bool:
        """Whether no observer is lost: explicit steps that are too long lose one as well."""
        assert self.best is not None
        return self.run.solver.method != "auto" or not self.best.finished.verdicts

    def _compared(self, how: Pass, other: Pass) -> float:
        """Carry out two passes; the largest error of the first."""
        try:
            finished = self.budget.carry_out(how)
            beside = self.budget.carry_out(other)
        except SimulationError as error:
            self.lost = error if isinstance(error, PlantDiverged) else None
            return np.inf
        self.lost = None
        self.best = self._attempt(finished, beside, part_of_error(self.run, other))
        return self.best.worst

    def _attempt(self, finished: Finished, beside: Finished, part: float = 1.0) -> Attempt:
        """A pass, with that part of its difference to another one as its error."""
        gaps = differences(self.run, finished.measured, beside.measured)
        return Attempt(finished, gaps.error(part, tuple(gaps.relative), self.run.plant.model.states))

    def across(self, method: Method, limit: float) -> bool:
        """Where controlled steps give up an observer whose equations jump: with fixed steps, which cross a jump.

        What controlled steps gave is kept where so many fixed ones are not accurate, or lose an observer as well.
        """
        kept = self.best
        if kept is None or not kept.worst <= self.accuracy:
            return False
        if not stopped(self.run, kept.finished.raw, kept.finished.verdicts) or self.fixed(method, limit):
            return True
        self.best = kept
        return True

    def controlled(self, methods: tuple[Method, ...]) -> bool:
        """With controlled steps; whether that was enough."""
        self.tried = True
        tolerance = first_tolerance(self.accuracy)
        first = self._cheapest(methods, tolerance)
        if first is None:
            return False
        method, before = first
        while True:
            tolerance = tolerance / 10
            try:
                finer = self.budget.carry_out(to_tolerance(self.run, method, tolerance, self.budget.steps(method)))
            except (SimulationError, TooManySteps):
                return False
            self.best = self._attempt(finer, before)
            before = finer
            if self.enough():
                return True
            if tolerance < 10 * TIGHTEST:
                return False
            tolerance = next_tolerance(tolerance, self.best.worst / self.accuracy)

    def _cheapest(self, methods: tuple[Method, ...], tolerance: float) -> tuple[Method, Finished] | None:
        """The method that finishes a pass with the fewest steps, so far as that can be told in advance.

        They take turns, each time with more steps than before.
        """
        tries, left = float(TRIES), list(methods)
        while left:
            for method in tuple(left):
                allowed = min(tries, self.budget.steps(method))
                if allowed < 1:
                    return None
                try:
                    finished = self.budget.carry_out(to_tolerance(self.run, method, tolerance, allowed))
                except TooManySteps:
                    continue
                except SimulationError as error:
                    self.failure = error
                    left.remove(method)
                    continue
                return method, finished
            tries *= MORE
        return None


def first_tolerance(accuracy: float) -> float:
    """Of controlled steps, to begin with."""
    return max(_TOLERANCE * accuracy, TIGHTEST)


def next_tolerance(tolerance: float, excess: float) -> float:
    """Ten times the one that is tried next, where errors are so many times too large: they are in proportion to it."""
    if not np.isfinite(excess):
        return tolerance
    decades = float(np.clip(np.floor(np.log10(excess)) - 1, 0, 3))
    tighter: float = tolerance / 10.0**decades
    return max(tighter, 10 * TIGHTEST)


def to_tolerance(run: PreparedRun, method: Method, tolerance: float, limit: float) -> Pass:
    """A pass with controlled steps; two tolerances do not share their longest steps."""
    part = _OTHER_PART if round(np.log10(tolerance)) % 2 else _PART
    longest = min(part * run.span, longest_step(run, run.step, adaptive=True))
    control = Tolerance(tolerance, None, longest, min(longest, run.step))
    return Pass(method=method, step=run.step, tolerance=control, limit=limit, bounded=False)
