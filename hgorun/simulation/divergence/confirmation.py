"""Whether an observer that seems to have diverged has: runs without a bound and with shorter steps decide.

The engine stops following an observer once one of its states is beyond a bound, which a high gain may reach on its
way to the truth. That is a suspicion. It is confirmed by the rule of :mod:`hgorun.simulation.divergence.verdict` on
the same run without that bound, and on runs with shorter steps. A run without suspicion costs nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from hgorun.engine.memory import Raw
from hgorun.errors import PlantDiverged, Problem, SimulationError
from hgorun.observers.capabilities import Switching
from hgorun.result.evaluation.estimated import Estimated
from hgorun.result.records.status import OK, Verdict
from hgorun.simulation.divergence.following import Finely, may_not_follow, near, no_longer_follows
from hgorun.simulation.divergence.verdict import ends, estimates_near, grow_alike, left_for_good, may_have_left, swamped
from hgorun.simulation.passes.loss import Again, at_times, of_estimate, why_lost
from hgorun.simulation.prepared import PreparedRun
from hgorun.symbolic.evaluate import Floats

_SHORTER = (4, 16)
_CHEAP = 2e6  # steps


def confirmed(run: PreparedRun, raw: Raw, again: Again) -> tuple[Raw, dict[str, Verdict]]:
    """What is to be said of the observers of a run, and its numbers where that changes them.

    An observer that comes back from beyond the bound has the numbers of the run without bound. One that is lost with
    these steps, but not with shorter ones, is inaccurate. Of the others nothing is left from their end on.

    Parameters
    ----------
    run : PreparedRun
    raw : Raw
        What the run has given with the engine's bound.
    again : Again

    Returns
    -------
    Raw
        The same where no observer is suspect.
    dict of str to Verdict
        Of those that are not ok.
    """
    suspects = suspects_of(run, raw)
    if not suspects:
        return raw, {}
    if run.solver.divergence is not None:
        left = [j for j in suspects if np.isfinite(raw.diverged[j, 0])]
        return raw, {run.observers[j].label: _beyond_given(run, raw, j) for j in left}
    bounded = any(np.isfinite(raw.diverged[j, 0]) for j in suspects)
    free = (_free(run, raw, suspects, again) if bounded else None) or raw
    said = {j: judged(run, free, j, again, partial(at_times, again, j)) for j in suspects}
    back = [j for j, verdict in said.items() if not verdict.lost]
    enough = _enough(run, free, again, [j for j in suspects if j not in back])
    for j, verdict in said.items():
        at = float(raw.diverged[j, 0])
        if verdict.status == "diverged" and np.isfinite(at):
            verdict = replace(verdict, at=at)  # there its numbers end
        if verdict.status == "diverged" and j not in enough:
            from hgorun.simulation.divergence.why_diverged import given_up, with_reason  # where one is lost only

            verdict = with_reason(run, free, j, verdict, again, controlled=run.adaptive)
            verdict = given_up(run, free, j, verdict, again) if run.adaptive else verdict
        said[j] = _inaccurate(run, free, j, verdict, enough[j], again) if j in enough else verdict
    raw = _with_blocks(run, raw, free, back)
    raw = _ended(run, raw, {j: verdict for j, verdict in said.items() if verdict.lost or j in enough})
    return raw, {run.observers[j].label: verdict for j, verdict in said.items() if verdict != OK}


def _free(run: PreparedRun, raw: Raw, suspects: list[int], again: Again) -> Raw | None:
    """The run without a bound, where it can be finished: adaptive steps may become too small for that.

    Once all suspects have overflowed, it has nothing that the run with the bound does not have.
    """
    with_them = ends_with_suspects(run)
    try:
        free = again.integrate(again.plan(), suspects if with_them else ())
    except SimulationError:
        return None
    return _with_blocks(run, raw, free, suspects) if with_them else free


def ends_with_suspects(run: PreparedRun) -> bool:
    """Whether a run without a bound tells nothing new when all its suspects have overflowed: they cannot come back."""
    return not run.closed and not run.structure.system.jumps and not run.adaptive


def ended(
    run: PreparedRun, raw: Raw, again: Again | None = None, same: Again | None = None
) -> tuple[Raw, dict[str, Verdict]]:
    """What is to be said of the observers of a run without bound, and its numbers up to where they are lost.

    Parameters
    ----------
    again : Again, optional
        The run once more, which tells what is undefined where an observer is lost.
    same : Again, optional
        The run once more, which tells whether an observer follows its outputs between points that are far apart.

    Returns
    -------
    Raw
        The same where no observer is lost.
    dict of str to Verdict
        Of those that are not ok.
    """
    suspects = suspects_of(run, raw)
    if run.solver.divergence is not None:
        left = [j for j in suspects if np.isfinite(raw.diverged[j, 0])]
        return raw, {run.observers[j].label: _beyond_given(run, raw, j) for j in left}
    said = {j: judged(run, raw, j, again, None if same is None else partial(at_times, same, j)) for j in suspects}
    lost = {j: verdict for j, verdict in said.items() if verdict.lost}
    verdicts = {run.observers[j].label: verdict for j, verdict in said.items() if verdict != OK}
    if not lost:
        return raw, verdicts
    diverged = raw.diverged.copy()
    diverged[list(lost)] = np.inf  # numbers end where the estimate has left, not where they overflow
    rows = _ended(run, replace(raw, diverged=diverged), lost).rows
    return replace(raw, rows=rows), verdicts


def plant_lost(run: PreparedRun, error: PlantDiverged, again: Again) -> SimulationError:
    """What is to be said of a plant that could not be followed: whether it can be, and shorter steps can."""
    from hgorun.simulation.divergence.escape import escaped, explained  # not for runs that can be followed

    escape = escaped(run)
    if escape is not None or run.adaptive or run.plant.block.discretise:
        return escape or explained(run, error)
    for shorter in _attempts(run, np.inf):
        try:
            again.integrate(again.plan(shorter))
        except (Problem, SimulationError):
            continue
        step = _longest(run)
        return SimulationError(
            f"it diverges with steps of {step:.3g}, but not with shorter ones: give a step of at most "
            f"{step / shorter:.3g}, or solver: {{method: rodas5p}} if its equations are stiff"
        )
    return explained(run, error)


def judged(run: PreparedRun, raw: Raw, j: int, again: Again | None = None, finely: Finely | None = None) -> Verdict:
    """What is to be said of an observer of a run without bound.

    It is undefined if some operation was undefined for its arguments before the estimate had left for good; what
    operation that was is found by carrying out the run ``again``, where that is given.
    """
    xhat = run.structure.estimates[j].along(run.grid, run.numbers.p, raw.rows[:, :, 0])
    left = _left(run, raw, j, xhat)
    overflow = float(raw.diverged[j, 0])
    if left is None and not np.isfinite(overflow):
        astray = _chatter(run, raw, j, xhat) or no_longer_follows(run, raw, j, xhat, finely)
        return astray or of_estimate(run, raw, j, xhat)
    missing = np.flatnonzero(~np.all(np.isfinite(xhat), axis=1))
    if left is not None and (not missing.size or left < missing[0]):
        return Verdict("diverged", float(run.grid[left]))
    if not np.isfinite(overflow):
        return of_estimate(run, raw, j, xhat)
    reason = None if again is None or run.adaptive else why_lost(run, again, j, overflow)
    return Verdict("diverged" if reason is None else "undefined", overflow, reason)


def _chatter(run: PreparedRun, raw: Raw, j: int, xhat: Floats) -> Verdict | None:
    """Of an observer that switches in every step and has nothing of a state but its switching."""
    observer = run.observers[j].observer
    if not (isinstance(observer, Switching) and observer.switches):
        return None
    state = swamped(raw.rows[:, run.structure.truths[j], 0], xhat)
    if state is None:
        return None
    name = run.plant.model.states[state]
    return Verdict(
        "inaccurate",
        reason=f"it switches in every step, and its error of {name} is more than 1e6 times {name}: "
        "its gains are too large for the step, or for the period of the samples",
    )


def suspects_of(run: PreparedRun, raw: Raw) -> list[int]:
    """The observers that were given up, or whose estimates may have left for good."""
    if not run.observers:
        return []
    points, structure = ends(run.grid.size, run.experiment.grid[2]), run.structure
    rows = raw.rows[points, :, 0]
    estimates = structure.estimates_along(run.grid[points], run.numbers.p, rows)
    truths = Estimated(rows, structure.truths)
    driven = Estimated.same(rows[:, : run.plant.model.n], len(run.observers))
    suspect = [at < np.inf for at in raw.diverged[:, 0].tolist()]
    if not near(run, truths, estimates):
        suspect = [lost or may_not_follow(run, points, rows, j, estimates.of(j)) for j, lost in enumerate(suspect)]
    if estimates_near(truths, estimates) and (not run.closed or estimates_near(driven, truths)):
        return np.flatnonzero(suspect).tolist()
    left = may_have_left(_ends(truths), _ends(estimates))
    if run.closed:
        left |= may_have_left(_ends(driven), _ends(truths))
    return np.flatnonzero(left | suspect).tolist()


def _ends(of: Estimated) -> Floats:
    """At the first and the last point, shape (2, n, m)."""
    return of.stack()[[0, -1]].swapaxes(1, 2)


def _left(run: PreparedRun, raw: Raw, j: int, xhat: Floats) -> int | None:
    """The first point from which on an observer's estimate has left the truth, or its plant that of the true state."""
    rows = raw.rows[:, :, 0]
    x = rows[:, run.structure.truths[j]]
    found = [left_for_good(x, xhat)]
    if run.closed:
        found.append(left_for_good(rows[:, : run.plant.model.n], x))
    return min((point for point in found if point is not None), default=None)


def _beyond_given(run: PreparedRun, raw: Raw, j: int) -> Verdict:
    bound = f"a state is beyond solver.divergence = {run.solver.divergence:g}, or not a number"
    return Verdict("diverged", float(raw.diverged[j, 0]), bound)


def _enough(run: PreparedRun, free: Raw, again: Again, lost: list[int]) -> dict[int, int]:
    """With how many times shorter steps each of the observers is not lost; those are left out that always are.

    So are those whose growth the shorter steps repeat: it is that of their equations, and no step ends it.
    """
    enough: dict[int, int] = {}
    if run.adaptive or not lost:
        return enough
    rates = [run.observers[j].observer.fastest_rate(run.observers[j].form) or 0.0 for j in lost]  # 0: not known
    left = lost
    for shorter in _attempts(run, max(rates)):
        try:
            other = again.integrate(again.plan(shorter), left)
        except (Problem, SimulationError):  # there is no time or no memory for so many steps
            break
        followed = [j for j in left if not np.isfinite(other.diverged[j, 0])]  # to the end of the run
        finely = {j: partial(at_times, again, j, shorter=shorter) for j in followed}
        enough |= {j: shorter for j in followed if judged(run, other, j, finely=finely[j]) == OK}
        left = [j for j in left if j not in enough and not _repeats(run, free, other, j)]
        if not left:
            break
    return enough


def _repeats(run: PreparedRun, raw: Raw, other: Raw, j: int) -> bool:
    """Whether a run with other steps has the same growth of an observer's errors."""
    x = raw.rows[:, run.structure.truths[j], 0]
    along = run.structure.estimates[j].along
    one, two = (along(run.grid, run.numbers.p, of.rows[:, :, 0]) for of in (raw, other))
    return grow_alike(x, one, two)


def _attempts(run: PreparedRun, rate: float) -> Iterator[int]:
    """How many times shorter the steps are that are tried: more often where the rate needs it and it is cheap."""
    yield from _SHORTER
    shorter, steps = _SHORTER[-1], run.span / _longest(run)
    while rate * _longest(run) > shorter and 4 * shorter * steps < _CHEAP:
        shorter *= 4
        yield shorter


def _longest(run: PreparedRun) -> float:
    """The longest of its steps."""
    return min(run.step, run.longest_gap)


def _inaccurate(run: PreparedRun, free: Raw, j: int, verdict: Verdict, shorter: int, again: Again) -> Verdict:
    step = _longest(run)
    what = "diverges" if verdict.status == "diverged" else "is undefined"
    reason = f"{what} with steps of {step:.3g}, but not with shorter ones: give a step of at most {step / shorter:.3g}"
    from hgorun.simulation.divergence.why_diverged import singular  # not for runs in which nothing is lost

    cause = singular(run, free, j, again)
    return Verdict("inaccurate", verdict.at, reason if cause is None else f"{reason}; {cause}")


def _with_blocks(run: PreparedRun, raw: Raw, other: Raw, which: Iterable[int]) -> Raw:
    """A run with the numbers of some observers from another one."""
    rows, diverged = raw.rows.copy(), raw.diverged.copy()
    for j in which:
        start, _, end = run.structure.system.blocks[j]
        rows[:, start:end] = other.rows[:, start:end]
        diverged[j] = other.diverged[j]
    return replace(raw, rows=rows, diverged=diverged)


def _ended(run: PreparedRun, raw: Raw, verdicts: dict[int, Verdict]) -> Raw:
    """A run in which some observers have no numbers from a time on, as those have none that the engine gave up."""
    rows = raw.rows.copy()
    for j, verdict in verdicts.items():
        if np.isfinite(raw.diverged[j, 0]):
            continue
        start, _, end = run.structure.system.blocks[j]
        rows[run.grid >= verdict.at, start:end] = np.nan
    return replace(raw, rows=rows)
