"""Lots of members carried out side by side; who does not come out plainly well is left to be carried out alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hgorun.engine.loose_adaptive import controllable
from hgorun.engine.member_numbers import Outcome
from hgorun.ensemble.found import Block, Floats, Integers
from hgorun.ensemble.preparation.lot import Lot
from hgorun.errors import Problem, SimulationError
from hgorun.result.evaluation.measure import from_origin
from hgorun.result.metrics.base import Metric, all_metrics
from hgorun.result.windows import MetricSettings
from hgorun.simulation.divergence.verdict import enough_late, late_points, may_be_astray, may_have_left, size_of
from hgorun.simulation.passes.lanes import control_of, reduction_of
from hgorun.simulation.passes.passes import Pass, as_given, plan_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.symbolic.evaluate import evaluate


def fits(run: PreparedRun) -> bool:
    """Whether runs like this one can be carried out side by side."""
    readout = run.structure.outputs.places is not None  # else outputs are looked at along the whole run
    estimates = all(of.places is not None for of in run.structure.estimates) or run.experiment.grid[2] == 1
    alike = all(treatment == "innovation" for treatment in run.treatments)
    late = enough_late(run.grid.size, run.experiment.grid[2])  # else a run alone looks at more points than the metrics
    return (not run.adaptive or controllable(run.structure.system)) and alike and readout and estimates and late


@dataclass(frozen=True, kw_only=True, eq=False)
class Passed:
    """What a pass through the members of a lot has given.

    Attributes
    ----------
    metrics : dict of str to ndarray, shape (m, n, N)
    sound : ndarray of bool, shape (N,)
        False where something has to be looked at: a plant or an observer that seems lost.
    steps : ndarray of int64, shape (N,)
        Those that were made; where they are controlled, that were tried.
    unfinished : ndarray of bool, shape (N,)
        Where controlled steps could not be made to the end, or not as many as may be.
    rows : ndarray, shape (grid points, states, N), optional
    """

    metrics: dict[str, Floats]
    sound: np.ndarray
    steps: Integers
    unfinished: np.ndarray
    rows: Floats | None

    def some(self, among: np.ndarray) -> Passed:
        """Of some of the members."""
        return Passed(
            metrics={name: values[..., among] for name, values in self.metrics.items()},
            sound=self.sound[among],
            steps=self.steps[among],
            unfinished=self.unfinished[among],
            rows=None if self.rows is None else self.rows[:, :, among],
        )


def carry_out(lot: Lot, how: Pass, metrics: Sequence[Metric], *, rows: bool = False, threads: int = 1) -> Passed:
    """A pass through the members of a lot.

    Raises
    ------
    Problem, SimulationError
        Where it cannot be made with the memory that there is.
    """
    run, late = lot.run, _late_errors(lot.run)
    reduction = reduction_of(run, metrics if late in metrics else [*metrics, late]) if run.observers else None
    ensemble, control = run.structure.ensemble(how.method), control_of(how)
    if lot.own is None and lot.plans is None:
        plan, start = plan_of(run, how)
        numbers, steps = lot.numbers.beside(plan, start.bound), np.full(lot.which.size, plan.steps)
        found = ensemble.run(plan, numbers, reduction, rows=rows, threads=threads, control=control)
    else:
        plans = lot.plans or [plan_of(own, how)[0] for own in lot.own or ()]
        numbers, steps = lot.numbers.beside(plans[0], plan_of(run, how)[1].bound), np.array([p.steps for p in plans])
        found = ensemble.run_each(plans, numbers, reduction, rows=rows, threads=threads, control=control)
    nothing = np.empty((0, run.plant.model.n, lot.which.size))
    if control:
        steps = found.tries
    named = dict(reduction.named(found.reduced)) if reduction else {metric.name: nothing for metric in metrics}
    return Passed(
        metrics={metric.name: named[metric.name] for metric in metrics},
        sound=_sound(lot, found, named, late.name),
        steps=steps,
        unfinished=np.isneginf(found.plant_diverged),
        rows=found.rows,
    )


def _late_errors(run: PreparedRun) -> Metric:
    """The largest errors of a part of the run that its end belongs to: those of an observer that goes astray."""
    sup, late = all_metrics()["sup"], run.grid[late_points(run.grid.size)]
    first, last = MetricSettings.of(run.experiment.blocks.metrics, run.experiment.blocks.time).since(run.origin).steady
    return sup if first <= late[0] and late[-1] <= last else replace(sup, name="largest", window="run")


def _sound(lot: Lot, found: Outcome, metrics: dict[str, Floats], late: str) -> np.ndarray:
    """Of which members there is nothing to be said, by their metrics and the name of that of their late errors."""
    run = lot.run
    sound = np.isposinf(found.plant_diverged) & ~np.any(np.isfinite(found.diverged), axis=0)
    if run.observers:
        lost = np.all([np.all(np.isinf(values), axis=1) for values in metrics.values()], axis=0)  # as where it ends
        sound &= ~np.any(lost, axis=0)
    ends = np.stack([found.first, found.last])
    for j, truth in enumerate(run.structure.truths):
        x, xhat = ends[:, truth], _ends(lot, found, j)
        sound &= ~may_have_left(x, xhat)
        measured = run.structure.outputs.places or []
        sound &= ~may_be_astray(metrics[late][j, measured], size_of(x, xhat))
        if run.closed:
            sound &= ~may_have_left(ends[:, : run.plant.model.n], x)
    return np.asarray(sound)


def _ends(lot: Lot, found: Outcome, j: int) -> Floats:
    """The estimates of an observer at the first and the last point, shape (2, n, N)."""
    readout, times = lot.run.structure.estimates[j], lot.run.grid[[0, -1]]
    if readout.places is not None:
        return np.stack([found.first[readout.places], found.last[readout.places]])
    held = np.zeros(readout.function.size1_in(3))
    p = lot.numbers.p.T
    ends = [
        evaluate(readout.function, np.array([t]), p, rows.T, held)[0].T
        for t, rows in zip(times, (found.first, found.last), strict=True)
    ]
    return np.stack(ends)


def given_steps(lot: Lot, block: Block, *, threads: int = 1) -> Integers:
    """Carry out members whose step or tolerances are given, and write down what they give.

    Returns
    -------
    ndarray of int64
        The members that have to be carried out alone.
    """
    how, known = as_given(lot.run), all_metrics(closed=True)
    try:
        passed = carry_out(lot, how, [known[name] for name in block.metrics], threads=threads)
    except (Problem, SimulationError):
        return lot.which
    write_down(lot, block, passed.metrics, passed.sound, how, passed.steps * how.evaluations_of_a_step)
    return np.asarray(lot.which[~passed.sound])


def write_down(
    lot: Lot,
    block: Block,
    metrics: dict[str, Floats],
    which: np.ndarray,
    how: Pass,
    evaluations: Integers,
    errors: Floats | None = None,
) -> None:
    """Record some members of a lot.

    Parameters
    ----------
    which : ndarray of bool, shape (N,)
    evaluations : ndarray of int64, shape (N,)
    errors : ndarray, shape (1 + m, N), optional
    """
    chosen = {name: values[..., which] for name, values in metrics.items() if name in block.metrics}
    if lot.run.origin:
        chosen = from_origin(chosen, lot.run.origin)
    block.record_many(
        lot.which[which],
        chosen,
        method=how.method,
        step=None if how.tolerance else how.step,
        rtol=how.tolerance.rtol if how.tolerance else None,
        evaluations=evaluations[which],
        errors=None if errors is None else errors[:, which],
    )
