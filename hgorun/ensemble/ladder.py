"""Automatic steps side by side: every member goes down the ladder as it does alone.

Members on the same rung make a pass together, and those that need shorter steps go on to the rung that their own error
asks for. Who is lost, needs anything but fixed steps, or may pass something that is narrow in a state, is carried out
alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hgorun.config.models import Method
from hgorun.ensemble.found import Block, Floats, Integers
from hgorun.ensemble.lanes import Passed, carry_out, write_down
from hgorun.ensemble.lot import Lot
from hgorun.errors import Problem, SimulationError
from hgorun.result.metrics.base import all_metrics
from hgorun.result.windows import MetricSettings, points_in
from hgorun.simulation.between_steps import may_miss
from hgorun.simulation.error_estimate import Estimate, difference, plant_difference, size_of
from hgorun.simulation.ladder import (
    UNEVEN,
    finest_rung,
    first_stage,
    further_down,
    order_of,
    rung,
    step_counts,
    steps_left,
)
from hgorun.simulation.passes import Pass, part_of_error
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
    start = rung(lot.run)
    waiting = [_Climber(lot, start, np.zeros(count, dtype=np.int64), np.full(count, np.inf), np.ones(count, dtype=int))]
    while waiting:
        climber = waiting.pop()
        able = _affordable(climber)
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
    errors = part_of_error(run, other) * _differences(lot, fine, coarse)
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


def _differences(lot: Lot, fine: Passed, coarse: Passed) -> Floats:
    """How far two passes are apart, for the plant and every observer: shape (1 + m, N)."""
    run, n = lot.run, lot.run.plant.model.n
    assert fine.rows is not None
    assert coarse.rows is not None
    shown = slice(None, None, run.experiment.grid[1])
    found = [plant_difference(fine.rows[shown, :n], coarse.rows[shown, :n])]
    of_truth: dict[int, tuple[Floats, Floats, Floats]] = {}
    for j, truth in enumerate(run.structure.truths):
        if truth[0] not in of_truth:  # of an open loop all observers have the same
            x = fine.rows[shown, truth[0] : truth[-1] + 1]
            apart = plant_difference(x, coarse.rows[shown, truth[0] : truth[-1] + 1])
            of_truth[truth[0]] = size_of(x), _moved(run, fine.rows, truth), apart
        size, moved, apart = of_truth[truth[0]]
        ours, theirs = (
            Estimate(
                xhat=_estimates(lot, one.rows, j)[shown],
                metrics={name: values[j] for name, values in one.metrics.items()},
            )
            for one in (fine, coarse)
            if one.rows is not None
        )
        own = difference(run, ours, theirs, size, moved)
        found.append(np.maximum(own, apart) if run.closed else own)
    return np.array(found)


def _estimates(lot: Lot, rows: Floats, j: int) -> Floats:
    """The estimates of an observer along the run, shape (grid points, n, N)."""
    run = lot.run
    readout = run.structure.estimates[j]
    if readout.places is not None:
        return rows[:, readout.places]
    own = [readout.along(run.grid, lot.numbers.p[:, i], rows[:, :, i]) for i in range(rows.shape[2])]
    return np.stack(own, axis=2)


def _moved(run: PreparedRun, rows: Floats, truth: Sequence[int]) -> Floats:
    """The total variation of a truth in the steady window, shape (n, N), added as for a single run."""
    blocks, every, n = run.experiment.blocks, run.experiment.grid[2], run.plant.model.n
    since = MetricSettings.of(blocks.metrics, blocks.time).since(run.origin)
    steady = rows[::every, truth[0] : truth[-1] + 1][points_in(run.grid[::every], since.steady)]
    ways = np.abs(np.diff(steady, axis=0))
    if n == 1:  # numpy adds a single column pairwise, several row by row
        return np.asarray(np.ascontiguousarray(np.moveaxis(ways, 0, -1)).sum(axis=-1))
    return np.asarray(ways.sum(axis=0))


def steps_in_lanes(run: PreparedRun) -> Method | None:
    """The method with which the search for a step begins; None where it does not begin with fixed steps."""
    stage = first_stage(run)
    return None if stage is None else stage[0]
