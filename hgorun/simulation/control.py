"""The step of a run, found by error control.

A run is carried out with fixed steps, and again with other steps that have no simple ratio to them; what its metrics
differ by tells their error. While that is more than the accuracy asked for, steps are made shorter, on the ladder
span / 2^k, as the method's order predicts. Where that would take too many of them, since only a part of the run is
fast, every step is controlled by the method's own error estimate, and two tolerances are compared; where steps stay
short although nothing is fast any more, the method for stiff systems takes over.

All that depends on the run alone and on counts, never on clocks: the same run takes the same steps everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from hgorun.config.models import Method
from hgorun.engine.memory import Raw, Tolerance
from hgorun.engine.methods import METHODS
from hgorun.engine.program import TooManySteps
from hgorun.errors import Problem, SimulationError
from hgorun.result.data import PLANT, Integration
from hgorun.result.status import OK, Verdict
from hgorun.simulation.between_steps import Missed, may_jump, missed
from hgorun.simulation.checks import longest_step
from hgorun.simulation.confirmation import ended
from hgorun.simulation.error_estimate import differences
from hgorun.simulation.measured import Measured, measured
from hgorun.simulation.passes import Again, Pass, fixed_steps, integrate, part_of_error
from hgorun.simulation.preparation import with_events
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.tables import uneven_steps
from hgorun.simulation.why_diverged import why_diverged

Progress = Callable[[float], None] | None

UNEVEN = 0.62  # steps of the run that is compared, for each step
_PRECISE = 1e-6  # below this accuracy the method of order five is cheaper
_STEEP = 4  # times 2: no further down the ladder at once, since the order may not be reached yet
_UNIFORM = 1 << 17  # fixed steps, before those of a controlled run are tried
_TRIES, _MORE = 20_000, 8  # controlled steps that a method may try at first, and how many times more next time
_TOLERANCE = 1e-3  # of the accuracy, to begin with
_TIGHTEST = 1e-13
_AGAIN, _ADVANCE = 4, 1e-6  # times that a search is repeated whatever comes; of the run, a later feature then
_MOST_EVENTS = 5_000
_FINEST = 200  # doubles: no step is shorter
_PART, _OTHER_PART = 1 / 100, 1 / 137  # of the run: the longest controlled steps of two passes


@dataclass(frozen=True, kw_only=True, eq=False)
class Controlled:
    """A run as accurate as asked for, or as it could be made.

    Attributes
    ----------
    raw, measured
        Of the most accurate pass.
    integration : Integration
    of_plant : Verdict
        Whether the plant is as accurate as it should be.
    """

    raw: Raw
    measured: Measured
    integration: Integration
    of_plant: Verdict


class _Exhausted(Exception):
    """No evaluations are left."""


@dataclass(kw_only=True, eq=False)
class _Budget:
    """Evaluations of the right-hand side that are left."""

    run: PreparedRun
    progress: Progress
    left: float
    spent: int = 0

    def steps(self, method: Method) -> float:
        """How many steps they are enough for."""
        return float(np.floor((self.left - self.spent) / Pass(method=method, step=1.0).evaluations_of_a_step))

    def carry_out(self, how: Pass) -> _Finished:
        """A pass, paid for."""
        try:
            raw = integrate(self.run, how, self.progress)
        except TooManySteps as error:
            self.spent += int(error.args[0]) * how.evaluations_of_a_step
            raise
        self.spent += raw.tries * how.evaluations_of_a_step
        raw, verdicts = ended(self.run, raw)
        return _Finished(how, raw, verdicts, measured(self.run, raw, verdicts))


@dataclass(frozen=True, eq=False)
class _Finished:
    """What a pass has given: its numbers, and the observers that are lost in it."""

    how: Pass
    raw: Raw
    verdicts: dict[str, Verdict]
    measured: Measured


@dataclass(frozen=True, eq=False)
class _Attempt:
    """A pass, and how far it may be from the exact solution."""

    finished: _Finished
    error: Mapping[str, float]

    @property
    def worst(self) -> float:
        """The largest error."""
        return max(self.error.values())


@dataclass(kw_only=True, eq=False)
class _Search:
    """The search for steps that are short enough.

    Attributes
    ----------
    best : _Attempt or None
        The last that could be finished.
    tried : bool
        Whether controlled steps have been tried.
    failure : SimulationError or None
        Why controlled steps could not.
    """

    run: PreparedRun
    budget: _Budget
    best: _Attempt | None = None
    tried: bool = False
    failure: SimulationError | None = field(default=None)

    @property
    def accuracy(self) -> float:
        return self.run.solver.accuracy

    def again(self, run: PreparedRun, *, fixed: bool = True) -> None:
        """Search for the steps of a run with other events; ``fixed``: not only for controlled ones."""
        self.run = self.budget.run = run
        self.best, self.tried = None, False
        for stage in _stages(self) if fixed else [lambda: self.controlled(("dopri5", "rodas5p"))]:
            if stage():
                break

    def enough(self) -> bool:
        """Whether what was found last is accurate, and no observer has been lost in it that must be looked at."""
        return self.best is not None and self.best.worst <= self.accuracy

    def fixed(self, method: Method, limit: float) -> bool:
        """Down the ladder with fixed steps, ``limit`` in number; whether that was enough."""
        k = rung(self.run)
        before: tuple[int, float] | None = None
        while True:
            step = self.run.span / 2.0**k
            if not self._affordable(method, step, limit) or k > finest_rung(self.run):
                return False
            how = Pass(method=method, step=step, bounded=False)
            error = self._compared(how, replace(how, uneven=UNEVEN))
            if before is None and self._jumps(how):
                return False
            if self.enough():
                return self._certain()
            order = float(METHODS[method].order)
            if before is not None and 0 < error < np.inf:
                order = float(np.clip(np.log2(before[1] / error) / (k - before[0]), 0.5, order))
            before = (k, error) if error < np.inf else None
            k += _down(error / self.accuracy, order)

    def _jumps(self, how: Pass) -> bool:
        """Whether controlled steps should be tried, since equations jump where the run passes."""
        asked = self.run.solver.method == "auto" and not self.tried and may_jump(self.run)
        return asked and missed(self.run, how).jumps

    def _affordable(self, method: Method, step: float, limit: float = np.inf) -> bool:
        count, other = _counts(self.run, step)
        return count <= limit and count + other <= self.budget.steps(method)

    def something(self, method: Method) -> bool:
        """Where nothing was affordable: the shortest fixed steps that are; whether that was enough."""
        k = rung(self.run)
        while self.best is None and k > 0:
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
        except SimulationError:
            return np.inf
        part = part_of_error(self.run, other)
        errors = {label: part * gap for label, gap in differences(self.run, finished.measured, beside.measured).items()}
        self.best = _Attempt(finished, errors)
        return self.best.worst

    def controlled(self, methods: tuple[Method, ...]) -> bool:
        """With controlled steps; whether that was enough."""
        self.tried = True
        tolerance = max(_TOLERANCE * self.accuracy, _TIGHTEST)
        first = self._cheapest(methods, tolerance)
        if first is None:
            return False
        method, before = first
        while True:
            tolerance = tolerance / 10
            try:
                finer = self.budget.carry_out(self._to_tolerance(method, tolerance, self.budget.steps(method)))
            except (SimulationError, TooManySteps):
                return False
            self.best = _Attempt(finer, differences(self.run, finer.measured, before.measured))
            before = finer
            if self.enough():
                return True
            if tolerance < 10 * _TIGHTEST:
                return False
            if np.isfinite(self.best.worst):  # errors are in proportion to tolerances
                excess = np.floor(np.log10(self.best.worst / self.accuracy))
                tolerance = max(tolerance / 10.0 ** float(np.clip(excess - 1, 0, 3)), 10 * _TIGHTEST)

    def _cheapest(self, methods: tuple[Method, ...], tolerance: float) -> tuple[Method, _Finished] | None:
        """The method that finishes a pass with the fewest steps, so far as that can be told in advance.

        They take turns, each time with more steps than before.
        """
        tries, left = float(_TRIES), list(methods)
        while left:
            for method in tuple(left):
                allowed = min(tries, self.budget.steps(method))
                if allowed < 1:
                    return None
                try:
                    finished = self.budget.carry_out(self._to_tolerance(method, tolerance, allowed))
                except TooManySteps:
                    continue
                except SimulationError as error:
                    self.failure = error
                    left.remove(method)
                    continue
                return method, finished
            tries *= _MORE
        return None

    def _to_tolerance(self, method: Method, tolerance: float, limit: float) -> Pass:
        """A pass with controlled steps; two tolerances do not share their longest steps."""
        part = _OTHER_PART if round(np.log10(tolerance)) % 2 else _PART
        longest = min(part * self.run.span, longest_step(self.run, self.run.step, adaptive=True))
        control = Tolerance(tolerance, None, longest, min(longest, self.run.step))
        return Pass(method=method, step=self.run.step, tolerance=control, limit=limit, bounded=False)


def controlled(run: PreparedRun, progress: Progress = None) -> Controlled:
    """Carry out a run whose step is automatic.

    Parameters
    ----------
    run : PreparedRun
    progress : callable, optional
        Called periodically with the completed fraction of a pass, 0 to 1.

    Returns
    -------
    Controlled
        Its errors are larger than ``solver.accuracy`` where that could not be reached with
        ``solver.max_evaluations``.

    Raises
    ------
    SimulationError
        When no pass could be finished: with controlled steps, too, the plant diverges.
    Problem
        When there are not enough evaluations for a single pass.
    """
    search = _Search(run=run, budget=_Budget(run=run, progress=progress, left=run.solver.max_evaluations))
    search.again(run)
    unseen = _followed(search)
    found = search.best
    if found is None:
        raise search.failure or Problem(
            ("solver", "max_evaluations"),
            f"{run.solver.max_evaluations:g} evaluations of the right-hand side are not enough to follow this run with "
            "any step",
        )
    how, known, tolerance = found.finished.how, found.finished.measured, found.finished.how.tolerance
    integration = Integration(
        method=how.method,
        step=None if tolerance else how.step,
        rtol=tolerance.rtol if tolerance else None,
        evaluations=search.budget.spent,
        error={label: error for label, error in found.error.items() if label not in found.finished.verdicts},
    )
    late = {label: error for label, error in found.error.items() if not error <= run.solver.accuracy}
    verdicts = {label: _doubt(error, run, search.budget.spent) for label, error in late.items()}
    verdicts |= unseen | _lost(run, found.finished, progress)
    observers = tuple(verdicts.get(b.label, v) for b, v in zip(run.observers, known.verdicts, strict=True))
    return Controlled(
        raw=found.finished.raw,
        measured=replace(known, verdicts=observers),
        integration=integration,
        of_plant=verdicts.get(PLANT, OK),
    )


def _followed(search: _Search) -> dict[str, Verdict]:
    """Repeat a search where its steps may have passed over something; what is said where they still may.

    The times at which a trajectory passes what is narrow in a state become events. What follows the first of them
    changes with it, so that others are met at other times. Jumps are left to steps that errors control.
    """
    known, before, rounds = np.zeros(0), -np.inf, 0
    while search.best is not None and search.enough():
        found, kept = missed(search.run, search.best.finished.how), search.best
        auto = search.run.solver.method == "auto"
        if found.nothing:
            break
        times = np.concatenate([known, *found.narrow.values()])
        first = min((float(np.min(when)) for when in found.narrow.values()), default=np.inf)
        late = rounds > _AGAIN and not first > before + _ADVANCE * search.run.span
        if found.countless or late or times.size > _MOST_EVENTS or not (auto or found.narrow):
            return _passed(search.run, found)
        rounds, known, before = rounds + 1, times, max(before, first)
        search.again(with_events(search.run, known), fixed=not auto)
        if not search.enough():
            search.best = kept
            return _passed(search.run, found)
    return {}


def _passed(run: PreparedRun, found: Missed) -> dict[str, Verdict]:
    """What is said of the plant and of observers that pass features between steps."""
    labels = [PLANT, *(block.label for block in run.observers)]
    if found.countless:
        reason = "there are too many jumps or kinks in its equations to tell whether its steps see all of them"
        return dict.fromkeys(labels, Verdict("inaccurate", reason=reason))
    reason = "at t = {:.6g} its steps pass over a part of the equations that is narrow in a state, which may matter"
    first = {label: float(np.min(times)) for label, times in found.narrow.items()}
    first |= {label: min(first[PLANT], first.get(label, np.inf)) for label in labels if PLANT in first}
    said = {label: Verdict("inaccurate", reason=reason.format(run.origin + when)) for label, when in first.items()}
    reason = "its equations jump at t = {:.6g} shortly before or after those of the plant, within one step"
    lagging = {label: run.origin + float(np.min(times)) for label, times in found.lagging.items()}
    return {label: Verdict("inaccurate", reason=reason.format(when)) for label, when in lagging.items()} | said


def _lost(run: PreparedRun, found: _Finished, progress: Progress) -> dict[str, Verdict]:
    """The observers that are lost, with reasons as far as they can be told."""
    if not found.verdicts or run.solver.divergence is not None:
        return found.verdicts
    raw = integrate(run, found.how, progress)
    again = None if found.how.tolerance else Again(run, found.how, progress)
    _, verdicts = ended(run, raw, again)
    for j, block in enumerate(run.observers):
        verdict = verdicts.get(block.label)
        if verdict is not None and verdict.status == "diverged" and verdict.reason is None:
            verdicts[block.label] = replace(verdict, reason=why_diverged(run, raw, j))
    return verdicts


def _doubt(error: float, run: PreparedRun, spent: int) -> Verdict:
    """What is said of numbers that have not become accurate."""
    solver = run.solver
    size = f"about {error:.1g}" if error < 1 else "of the size of the numbers themselves, or larger"
    return Verdict(
        "inaccurate",
        reason=f"the integration error is {size} where solver.accuracy allows {solver.accuracy:g}; "
        f"{spent:.2g} evaluations did not make it smaller (solver.max_evaluations: {solver.max_evaluations:g})",
    )


def _stages(search: _Search) -> Iterator[Callable[[], bool]]:
    """What is tried, one after the other."""
    solver = search.run.solver
    if solver.method == "auto":
        method: Method = "rk4" if solver.accuracy >= _PRECISE else "dopri5"
        limit = max(_UNIFORM, 8 * search.run.schedule.events.size)
        yield lambda: search.fixed(method, limit)
        yield lambda: search.controlled(("dopri5", "rodas5p"))
        yield lambda: search.fixed(method, np.inf)
        yield lambda: search.something(method)
    elif METHODS[solver.method].error:
        chosen = solver.method
        yield lambda: search.controlled((chosen,))
    else:
        given = solver.method
        yield lambda: search.fixed(given, np.inf)
        yield lambda: search.something(given)


def rung(run: PreparedRun) -> int:
    """The rung k of the ladder span / 2^k on which a run begins: the nominal step, or up to twice as long."""
    return round(float(np.log2(run.span / run.step)))


def finest_rung(run: PreparedRun) -> int:
    """The last rung with steps that are long beside the rounding of times."""
    finest = _FINEST * float(np.spacing(max(abs(run.origin + run.time.start), abs(run.origin + run.time.end))))
    return int(np.floor(np.log2(run.span / finest)))


def _down(excess: float, order: float) -> int:
    """How many rungs further down, where the error is so many times too large."""
    if not np.isfinite(excess):
        return 2
    return int(np.clip(np.ceil(np.log2(max(excess, 1.0) * 2) / order), 1, _STEEP))


def _counts(run: PreparedRun, step: float) -> tuple[float, float]:
    """Fixed steps of a run, and those of the pass beside it; infinite where there are too many to be counted."""
    try:
        steps = fixed_steps(run, step)
    except Problem:
        return np.inf, np.inf
    return float(np.sum(steps)), float(np.sum(uneven_steps(steps, UNEVEN)))
