"""Automatic steps that an error estimate controls, side by side: the search of each member, with the passes of many.

A member looks for the method that finishes with few steps, and makes its tolerance tighter until two passes agree, as
:meth:`hgorun.simulation.error_control.search.Search.controlled` does for it alone. Members with the same method and
tolerance make a pass together. Who is lost, passes something that is narrow in a state, or needs more than that is
carried out alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from hgorun.config.models import Method
from hgorun.engine.loose_adaptive import controllable
from hgorun.ensemble.found import Block, Floats, Integers
from hgorun.ensemble.preparation.lot import Lot
from hgorun.ensemble.side_by_side.differences import differences
from hgorun.ensemble.side_by_side.lanes import Passed, carry_out, write_down
from hgorun.errors import Problem, SimulationError
from hgorun.result.metrics.base import all_metrics
from hgorun.simulation.error_control.ladder import steps_left
from hgorun.simulation.error_control.search import MORE, TIGHTEST, TRIES, first_tolerance, next_tolerance, to_tolerance
from hgorun.simulation.passes.between_steps import may_miss
from hgorun.simulation.passes.lanes import control_of
from hgorun.simulation.passes.passes import Pass
from hgorun.simulation.prepared import PreparedRun


def may_be_controlled(run: PreparedRun) -> bool:
    """Whether the steps of such runs can be controlled side by side."""
    return controllable(run.structure.system) and not run.unknown


@dataclass(frozen=True, eq=False)
class _Members:
    """Members that make the same passes.

    Attributes
    ----------
    lot : Lot
    spent : ndarray of int64, shape (N,)
        Evaluations of the right-hand side so far.
    how : Pass, optional
        The last pass that all of them have finished.
    passed : Passed, optional
        What it gave.
    """

    lot: Lot
    spent: Integers
    how: Pass | None = None
    passed: Passed | None = None

    def some(self, among: np.ndarray) -> _Members:
        passed = None if self.passed is None else self.passed.some(among)
        return replace(self, lot=self.lot.some(among), spent=self.spent[among], passed=passed)


@dataclass(frozen=True, eq=False)
class _Work:
    """Where the numbers go, and who is left to be carried out alone."""

    block: Block
    threads: int
    alone: list[Integers]

    def leave(self, members: _Members, which: np.ndarray) -> None:
        self.alone.append(members.lot.which[which])

    def carry_out(self, members: _Members, how: Pass) -> Passed | None:
        """A pass; None where there is no memory for it."""
        metrics = list(all_metrics(closed=members.lot.run.closed).values())
        try:
            return carry_out(members.lot, how, metrics, rows=True, threads=self.threads)
        except (Problem, SimulationError):
            self.leave(members, np.ones(members.spent.size, dtype=bool))
            return None


def controlled_steps(lot: Lot, spent: Integers, block: Block, *, threads: int = 1) -> Integers:
    """Carry out members whose every step is controlled, and write down what they give.

    Parameters
    ----------
    spent : ndarray of int64, shape (N,)
        Evaluations of the right-hand side that went into other steps.

    Returns
    -------
    ndarray of int64
        The members that have to be carried out alone.
    """
    method = lot.run.solver.method
    methods: tuple[Method, ...] = ("dopri5", "rodas5p") if method == "auto" else (method,)
    work = _Work(block, threads, [np.zeros(0, dtype=np.int64)])
    waiting = list(_cheapest(work, _Members(lot, spent), methods))
    while waiting:
        waiting += _tighter(work, waiting.pop())
    return np.concatenate(work.alone)


def _allowed(members: _Members, method: Method) -> Floats:
    """How many steps of a method each of them can pay for."""
    most = members.lot.run.solver.max_evaluations
    return np.array([steps_left(method, most, int(spent)) for spent in members.spent])


def _cheapest(work: _Work, members: _Members, methods: tuple[Method, ...]) -> Iterator[_Members]:
    """Those that finish a first pass, by the method that does so; they take turns, each time with more steps."""
    run, limit = members.lot.run, TRIES
    tolerance = first_tolerance(run.solver.accuracy)
    while members.spent.size:
        for method in methods:
            able = _allowed(members, method) >= limit
            work.leave(members, ~able)
            members = members.some(able)
            how = to_tolerance(run, method, tolerance, limit)
            control = control_of(how)
            passed = work.carry_out(members, how) if members.spent.size else None
            if passed is None or control is None:
                return
            members = replace(members, spent=members.spent + passed.steps * how.evaluations_of_a_step)
            yield replace(members, how=how, passed=passed).some(passed.sound)
            more = passed.unfinished & (passed.steps == limit)  # else no step was small enough, or so many are hopeless
            work.leave(members, ~passed.sound & ~more)
            members = members.some(more)
        limit *= MORE


def _tighter(work: _Work, members: _Members) -> Iterator[_Members]:
    """A pass with a tighter tolerance, compared with the one before; those whose numbers are not accurate by then."""
    before, coarse, run = members.how, members.passed, members.lot.run
    if not members.spent.size:
        return
    assert before is not None
    assert before.tolerance is not None
    assert coarse is not None
    tolerance, allowed = before.tolerance.rtol / 10, _allowed(members, before.method)
    how = to_tolerance(run, before.method, tolerance, np.inf)
    fine = work.carry_out(members, how)
    if fine is None:
        return
    members = replace(members, spent=members.spent + fine.steps * how.evaluations_of_a_step, how=how, passed=fine)
    errors = differences(members.lot, fine, coarse)
    worst, sound = np.max(errors, axis=0), fine.sound & (fine.steps <= allowed)
    done = sound & (worst <= run.solver.accuracy)
    assert fine.rows is not None
    doubtful = done.copy()
    doubtful[done] = may_miss(run, members.lot.numbers.p[:, done], run.grid, fine.rows[:, :, done])
    done &= ~doubtful
    write_down(members.lot, work.block, fine.metrics, done, how, members.spent, errors)
    on = sound & ~done & ~doubtful & (tolerance >= 10 * TIGHTEST)
    work.leave(members, ~done & ~on)
    following = np.zeros(worst.size)
    following[on] = [next_tolerance(tolerance, excess) for excess in worst[on] / run.solver.accuracy]
    for one in np.unique(following[on]):
        own = to_tolerance(run, how.method, float(one), np.inf)  # a tenth of it comes next
        yield replace(members.some(on & (following == one)), how=own)
