"""Automatic steps side by side: every member goes down the ladder as it does alone.

Members on the same rung make a pass together, and those that need shorter steps go on to the rung that their own error
asks for, or to steps that errors control (:mod:`hgorun.ensemble.side_by_side.tolerances`). Who is lost, or may pass
something that is narrow in a state, is carried out alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from hgorun.ensemble.found import Block, Floats, Integers
from hgorun.ensemble.preparation.lot import Lot
from hgorun.ensemble.side_by_side.differences import differences
from hgorun.ensemble.side_by_side.lanes import carry_out, write_down
from hgorun.ensemble.side_by_side.tolerances import controlled_steps, may_be_controlled
from hgorun.errors import Problem, SimulationError
from hgorun.result.metrics.base import all_metrics
from hgorun.simulation.error_control.ladder import (
    UNEVEN,
    finest_rung,
    first_stage,
    further_down,
    order_of,
    rung,
    step_counts,
    steps_left,
)
from hgorun.simulation.passes.between_steps import may_miss
from hgorun.simulation.passes.passes import Pass, part_of_error
from hgorun.simulation.prepared import PreparedRun


@dataclass(frozen=True, eq=False)
class _Climber:
    """Members on one rung.

    Attributes
    ----------
    lot : Lot
    k : int
        Their rung.
    spent : ndarray of int64, shape (N,)
        Evaluations of the right-hand side so far.
    before, rungs : ndarray, shape (N,)
        The error on the rung before, infinite where there was none, and how far that is above.
    """

    lot: Lot
    k: int
    spent: Integers
    before: Floats
    rungs: Integers

    def some(self, among: np.ndarray) -> _Climber:
        return replace(
            self,
            lot=self.lot.some(among),
            spent=self.spent[among],
            before=self.before[among],
            rungs=self.rungs[among],
        )


def found_steps(lot: Lot, block: Block, *, threads: int = 1) -> Integers:
    """Carry out members whose step is found by error control, and write down what they give.

    Returns
    -------
    ndarray of int64
        The members that have to be carried out alone.
    """
    count, alone = lot.which.size, [np.zeros(0, dtype=np.int64)]
    spent = np.zeros(count, dtype=np.int64)
    if first_stage(lot.run) is None:
        return controlled_steps(lot, spent, block, threads=threads)
    start = rung(lot.run)
    waiting = [_Climber(lot, start, spent, np.full(count, np.inf), np.ones(count, dtype=int))]
    while waiting:
        climber = waiting.pop()
        able = _affordable(climber)
        if climber.lot.run.solver.method == "auto" and may_be_controlled(climber.lot.run):
            dear = climber.some(~able)
            alone.append(controlled_steps(dear.lot, dear.spent, block, threads=threads))
        else:
            alone.append(climber.lot.which[~able])
        if able.any():
            further, lost = _one_rung(climber.some(able), block, threads)
            waiting += further
            alone.append(lost)
    return np.concatenate(alone)


def _affordable(climber: _Climber) -> np.ndarray:
    """Which members can make the two passes of their rung."""
    run = climber.lot.run
    stage = first_stage(run)
    if stage is None or run.unknown or climber.k > finest_rung(run):
        return np.zeros(climber.spent.size, dtype=bool)
    method, limit = stage
    count, other = step_counts(run, run.span / 2.0**climber.k)
    left = [steps_left(method, run.solver.max_evaluations, int(spent)) for spent in np.unique(climber.spent)]
    enough = dict(zip(np.unique(climber.spent).tolist(), left, strict=True))
    return np.array([count <= limit and count + other <= enough[int(spent)] for spent in climber.spent], dtype=bool)


def _one_rung(climber: _Climber, block: Block, threads: int) -> tuple[list[_Climber], Integers]:
    """Two passes; the members that go on, and those that have to be carried out alone."""
    lot, run = climber.lot, climber.lot.run
    stage = first_stage(run)
    assert stage is not None
    how = Pass(method=stage[0], step=run.span / 2.0**climber.k, bounded=False)
    other, metrics = replace(how, uneven=UNEVEN), list(all_metrics(closed=run.closed).values())
    try:
        fine, coarse = (carry_out(lot, one, metrics, rows=True, threads=threads) for one in (how, other))
    except (Problem, SimulationError):  # there is no memory for so many steps
        return [], lot.which
    spent = climber.spent + (fine.steps + coarse.steps) * how.evaluations_of_a_step
    sound = fine.sound & coarse.sound
    errors = part_of_error(run, other) * differences(lot, fine, coarse)
    worst = np.max(errors, axis=0)
    done = sound & (worst <= run.solver.accuracy)
    assert fine.rows is not None
    doubtful = done.copy()
    doubtful[done] = may_miss(run, lot.numbers.p[:, done], run.grid, fine.rows[:, :, done])
    done &= ~doubtful
    write_down(lot, block, fine.metrics, done, how, spent, errors)
    order = order_of(how.method, worst, climber.before, climber.rungs)
    down = further_down(worst / run.solver.accuracy, order)
    after = replace(climber, spent=spent, before=worst, rungs=down)
    return list(_apart(after, sound & ~done & ~doubtful)), lot.which[~sound | doubtful]


def _apart(climber: _Climber, which: np.ndarray) -> Iterator[_Climber]:
    """Members by the rung that they go on to."""
    for down in np.unique(climber.rungs[which]):
        own = climber.some(which & (climber.rungs == down))
        yield replace(own, k=climber.k + int(down))


def searched_in_lanes(run: PreparedRun) -> bool:
    """Whether the search for a step begins with passes that can be made side by side."""
    return first_stage(run) is not None or may_be_controlled(run)
