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
from dataclasses import dataclass, replace

import numpy as np

from hgorun.config.models import Method
from hgorun.engine.memory import Raw
from hgorun.engine.methods import METHODS
from hgorun.errors import PlantEnded, Problem
from hgorun.result.records.data import PLANT, Integration
from hgorun.result.records.status import OK, Verdict
from hgorun.simulation.divergence.confirmation import ended
from hgorun.simulation.divergence.stopped import crossed
from hgorun.simulation.error_control.ladder import first_stage
from hgorun.simulation.error_control.search import Attempt, Budget, Finished, Progress, Search
from hgorun.simulation.outcome.measured import Measured
from hgorun.simulation.passes.between_steps import SMOOTH, Missed, jumping, jumps_of, missed
from hgorun.simulation.passes.passes import Again, Pass, integrate
from hgorun.simulation.preparation.scheduling import with_events
from hgorun.simulation.prepared import PreparedRun

_AGAIN, _ADVANCE = 4, 1e-6  # times that a search is repeated whatever comes; of the run, a later feature then
_MOST_EVENTS = 5_000
_MUCH = 1_000_000  # evaluations: seconds
_ADVICE = f"write {SMOOTH}, or compare with a run of a given, shorter solver.step"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Controlled:
    """A run as accurate as asked for, or as it could be made.

    Attributes
    ----------
    run : PreparedRun
        The run, with the events that it has been found to need.
    how : Pass
        The most accurate pass.
    raw, measured
        What it has given.
    integration : Integration
    of_plant : Verdict
        Whether the plant is as accurate as it should be.
    """

    run: PreparedRun
    how: Pass
    raw: Raw
    measured: Measured
    integration: Integration
    of_plant: Verdict


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
    search = Search(run=run, budget=Budget(run=run, progress=progress, left=run.solver.max_evaluations))
    _search(search, run)
    unseen = _followed(search)
    found = search.best
    if found is None or not found.error.relative.get(PLANT, 0.0) <= run.solver.accuracy:
        from hgorun.simulation.divergence.escape import escaped, explained  # not for runs that can be followed

        escape = escaped(run)
        if escape is not None:
            raise escape
        if found is None:
            failure = search.failure or search.lost or _not_enough(run)
            raise explained(run, failure) if isinstance(failure, PlantEnded) else failure
    how, known, tolerance = found.finished.how, found.finished.measured, found.finished.how.tolerance
    integration = Integration(
        method=how.method,
        step=None if tolerance else how.step,
        rtol=tolerance.rtol if tolerance else None,
        evaluations=search.budget.spent,
        error=found.error.without(found.finished.verdicts),
    )
    late = {label: error for label, error in found.error.relative.items() if not error <= run.solver.accuracy}
    verdicts = {label: _doubt(error, run, search.budget.spent) for label, error in late.items()}
    verdicts |= _not_seen(run, how, found.finished.raw) | unseen | _lost(run, found.finished, progress)
    observers = tuple(verdicts.get(b.label, v) for b, v in zip(run.observers, known.verdicts, strict=True))
    said = _many(run, search.budget.spent, verdicts)
    return Controlled(
        run=replace(search.run, remarks=(*search.run.remarks, *said)) if said else search.run,
        how=how,
        raw=found.finished.raw,
        measured=replace(known, verdicts=observers),
        integration=integration,
        of_plant=verdicts.get(PLANT, OK),
    )


def _not_enough(run: PreparedRun) -> Problem:
    return Problem(
        ("solver", "max_evaluations"),
        f"{run.solver.max_evaluations:g} evaluations of the right-hand side are not enough to follow this run with "
        "any step",
    )


def _lost_sooner(found: Attempt | None, before: Attempt, slack: float) -> bool:
    """Whether an observer is lost that was not before, or clearly sooner."""
    lost = {} if found is None else found.finished.verdicts
    earlier = before.finished.verdicts
    return any(_when(verdict) < _when(earlier.get(label)) - slack for label, verdict in lost.items())


def _lost_from(verdicts: Mapping[str, Verdict], before: Mapping[str, float]) -> dict[str, float]:
    """From when on it does not matter what observers pass that are lost: of those that were ``before``, all along."""
    lost = {label: verdict.at for label, verdict in verdicts.items() if verdict.lost and verdict.at is not None}
    return {label: -np.inf if label in before else at for label, at in lost.items()}


def _when(verdict: Verdict | None) -> float:
    """When an observer is lost; never, where nothing says so."""
    if verdict is None:
        return np.inf
    return -np.inf if verdict.at is None else verdict.at


def _search(search: Search, run: PreparedRun, *, fixed: bool = True) -> None:
    """Search for the steps of a run, which may have other events than before; ``fixed``: fixed ones, too."""
    search.run = search.budget.run = run
    search.best, search.tried = None, False
    for stage in _stages(search) if fixed else [lambda: search.controlled(("dopri5", "rodas5p"))]:
        if stage():
            break


def _followed(search: Search) -> dict[str, Verdict]:
    """Repeat a search where its steps may have passed over something; what is said where they still may.

    The times at which a trajectory passes what is narrow in a state become events. What follows the first of them
    changes with it, so that others are met at other times. Jumps are left to steps that errors control. An observer
    that is lost sooner with these events is not given up for it: it may be the steps between them that fail. What one
    passes after its loss is nothing to the others, and one that is lost a second time is lost for certain.
    """
    known, before, rounds = np.zeros(0), -np.inf, 0
    lost: dict[str, float] = {}
    while search.best is not None and search.enough():
        kept = search.best
        lost = _lost_from(kept.finished.verdicts, lost)
        found = missed(search.run, kept.finished.how, lost)
        auto = search.run.solver.method == "auto"
        if found.nothing:
            break
        times = np.concatenate([known, *found.narrow.values()])
        first = min((float(np.min(when)) for when in found.narrow.values()), default=np.inf)
        late = rounds > _AGAIN and not first > before + _ADVANCE * search.run.span
        if found.countless or late or times.size > _MOST_EVENTS or not (auto or found.narrow):
            return _passed(search.run, found)
        rounds, known, before = rounds + 1, times, max(before, first)
        fixed = not auto or search.run.structure.system.decides
        _search(search, with_events(search.run, known), fixed=fixed)
        if not search.enough() or _lost_sooner(search.best, kept, _ADVANCE * search.run.span):
            search.best = kept
            return _passed(search.run, found)
    return {}


def _not_seen(run: PreparedRun, how: Pass, raw: Raw) -> dict[str, Verdict]:
    """What is said where functions of time may have pulses that the steps do not see."""
    evaluations = raw.tries * len(METHODS[how.method].c)
    said: dict[str, Verdict] = {}
    for unknown in run.unknown:
        if not unknown.seen(evaluations):
            labels = [*([PLANT] if unknown.of_plant else []), *(block.label for block in run.observers)]
            said |= dict.fromkeys(labels, Verdict("inaccurate", reason=unknown.reason))
    return said


def _passed(run: PreparedRun, found: Missed) -> dict[str, Verdict]:
    """What is said of the plant and of observers that pass features between steps."""
    labels = [PLANT, *(block.label for block in run.observers)]
    if found.countless:
        reason = "there are too many jumps or kinks in its equations to tell whether its steps see all of them"
        return dict.fromkeys(labels, Verdict("inaccurate", reason=reason + _advice(run, _ADVICE)))
    reason = "at t = {:.6g} its steps pass over a part of the equations that is narrow in a state, which may matter"
    reason += _advice(run, "compare with a run of a given, shorter solver.step")
    first = {label: float(np.min(times)) for label, times in found.narrow.items()}
    first |= {label: min(first[PLANT], first.get(label, np.inf)) for label in labels if PLANT in first}
    said = {label: Verdict("inaccurate", reason=reason.format(run.origin + when)) for label, when in first.items()}
    reason = "its equations jump at t = {:.6g} shortly before or after those of the plant, within one step"
    reason += _advice(run, _ADVICE)
    lagging = {label: run.origin + float(np.min(times)) for label, times in found.lagging.items()}
    return {label: Verdict("inaccurate", reason=reason.format(when)) for label, when in lagging.items()} | said


def _lost(run: PreparedRun, found: Finished, progress: Progress) -> dict[str, Verdict]:
    """The observers that are lost, with reasons as far as they can be told."""
    if not found.verdicts or run.solver.divergence is not None:
        return found.verdicts
    from hgorun.simulation.divergence.why_diverged import no_step, with_reason  # not for runs in which nothing is lost

    raw = integrate(run, found.how, progress)
    again = Again(run, found.how, progress)
    _, verdicts = ended(run, raw, None if found.how.tolerance else again, again)
    for j, block in enumerate(run.observers):
        verdict = verdicts.get(block.label)
        if verdict is not None and verdict.status == "diverged":
            controlled_steps = found.how.tolerance is not None
            verdicts[block.label] = with_reason(run, raw, j, verdict, again, controlled=controlled_steps)
    return no_step(run, raw, crossed(run, raw, verdicts), again) if found.how.tolerance else verdicts


def _doubt(error: float, run: PreparedRun, spent: int) -> Verdict:
    """What is said of numbers that have not become accurate."""
    solver = run.solver
    size = f"about {error:.1g}" if error < 1 else "of the size of the numbers themselves, or larger"
    advice = _advice(run, _ADVICE) if PLANT in jumping(run) else ""
    return Verdict(
        "inaccurate",
        reason=f"the integration error is {size} where solver.accuracy allows {solver.accuracy:g}; "
        f"{spent:.2g} evaluations did not make it smaller (solver.max_evaluations: {solver.max_evaluations:g}){advice}",
    )


def _many(run: PreparedRun, spent: int, verdicts: Mapping[str, Verdict]) -> tuple[str, ...]:
    """What is said of a run that takes much longer since the plant's equations jump, where no reason says so."""
    told = any(verdict.status == "inaccurate" for verdict in verdicts.values())
    what = jumps_of(run, PLANT) if spent >= _MUCH and not told else ""
    if not what:
        return ()
    return (f"{spent:.2g} evaluations were needed, since the plant's equations jump ({what}); fewer are with {SMOOTH}",)


def _advice(run: PreparedRun, otherwise: str) -> str:
    """What may be done where the plant's equations jump, naming what does, or otherwise."""
    what = jumps_of(run, PLANT)
    return f"; the plant's equations jump ({what}): {_ADVICE}" if what else f": {otherwise}"


def _stages(search: Search) -> Iterator[Callable[[], bool]]:
    """What is tried, one after the other."""
    solver, first = search.run.solver, first_stage(search.run)
    if search.run.structure.system.decides:  # a tolerance says nothing of when something is decided
        alone: Method = "rk4" if solver.method == "auto" else solver.method
        yield lambda: search.fixed(alone, np.inf)
        yield lambda: search.something(alone)
        return
    if first is None:
        assert solver.method != "auto"
        chosen = solver.method
        yield lambda: search.controlled((chosen,))
        return
    method, limit = first
    yield lambda: search.fixed(method, limit)
    if solver.method == "auto":
        yield lambda: search.controlled(("dopri5", "rodas5p")) and search.across(method, limit)
        yield lambda: search.fixed(method, np.inf)
    yield lambda: search.something(method)
