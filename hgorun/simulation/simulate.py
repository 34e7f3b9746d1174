"""Run an experiment: from its symbolic description to trajectories."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from hgorun.engine.methods import METHODS
from hgorun.engine.plan import Plan
from hgorun.engine.program import Raw, Start, Tolerance
from hgorun.errors import PlantDiverged, SimulationError
from hgorun.result.result import Result
from hgorun.simulation.checks import check_steps, longest_step
from hgorun.simulation.confirmation import confirmed, plant_lost
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.loss import UNBOUNDED
from hgorun.simulation.outcome import record
from hgorun.simulation.preparation import prepare
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.tables import build_plan

__all__ = ["integrate", "integrate_lanes", "prepare", "simulate", "simulate_prepared"]

_DEFAULT_RTOL = 1e-8


def simulate(
    experiment: Experiment, *, check_step: bool = False, progress: Callable[[float], None] | None = None
) -> Result:
    """Simulate the plant and all observers.

    Parameters
    ----------
    experiment : Experiment
    check_step : bool
        Run once more with half the step and report the largest difference as integration error.
    progress : callable, optional
        Called periodically with the completed fraction, 0 to 1.

    Returns
    -------
    Result

    Raises
    ------
    ConfigError
        When the configuration does not fit together.
    SimulationError
        When the plant diverges.
    """
    return simulate_prepared(prepare(experiment), check_step=check_step, progress=progress)


def simulate_prepared(
    run: PreparedRun, *, check_step: bool = False, progress: Callable[[float], None] | None = None
) -> Result:
    """Simulate a prepared run; see :func:`simulate`."""
    with _located(run), run.experiment.located():
        result = _result(run, run.step, progress)
        if check_step and not run.adaptive:
            half = _result(run, run.step / 2, progress)
            result = replace(result, integration_error=_difference(result, half))
    return result


def _result(run: PreparedRun, step: float, progress: Callable[[float], None] | None) -> Result:
    again = _Again(run, step, progress)
    try:
        raw = integrate(run, step, progress)
    except PlantDiverged as error:
        raise plant_lost(run, error, again) from error
    return record(run, *confirmed(run, raw, again))


@dataclass(frozen=True)
class _Again:
    """The same run once more, see :class:`hgorun.simulation.loss.Again`."""

    run: PreparedRun
    step: float
    progress: Callable[[float], None] | None

    def plan(self, shorter: int = 1) -> Plan:
        longest = min(self.step, float(np.max(np.diff(self.run.schedule.events))))
        return _plan(self.run, self.step if shorter == 1 else longest / shorter)[0]

    def integrate(self, plan: Plan) -> Raw:
        start = replace(_plan(self.run, self.step)[1], bound=UNBOUNDED)
        return _integrate(self.run, self.step, plan, start, self.progress)


@contextmanager
def _located(run: PreparedRun) -> Iterator[None]:
    """Say which plant it was that could not be followed."""
    try:
        yield
    except SimulationError as error:
        file, line = run.experiment.source.where(("plant",))
        raise SimulationError(f"{file}:{line}: plant: {error}") from error


def integrate(run: PreparedRun, step: float, progress: Callable[[float], None] | None = None) -> Raw:
    """One run with a nominal step, as the engine gives it."""
    return _integrate(run, step, *_plan(run, step), progress)


def _integrate(
    run: PreparedRun, step: float, plan: Plan, start: Start, progress: Callable[[float], None] | None
) -> Raw:
    solver, time, tolerance = run.solver, run.time, None
    if run.adaptive:
        span = time.end - time.start
        limit = min(solver.max_step or span, longest_step(run, step))
        first = min(1e-4 * span, limit) if solver.step == "auto" else min(solver.step, limit)
        tolerance = Tolerance(solver.rtol or _DEFAULT_RTOL, solver.atol, limit, first)
    program = run.structure.program(solver.method, adaptive=run.adaptive)
    return program.run(plan, start, tolerance, progress)


def integrate_lanes(runs: Sequence[PreparedRun]) -> Raw:
    """Runs of one structure, one step and one schedule side by side in vector registers, a lane each."""
    plans, starts = zip(*(_plan(run, runs[0].step) for run in runs), strict=True)
    numbers = {name: np.column_stack([getattr(p, name) for p in plans]) for name in ("gain", "bias", "holds")}
    start = Start(np.hstack([s.z for s in starts]), np.hstack([s.p for s in starts]), starts[0].bound)
    program = runs[0].structure.program(runs[0].solver.method, lanes=len(runs))
    return program.run(replace(plans[0], **numbers), start)


def _plan(run: PreparedRun, step: float) -> tuple[Plan, Start]:
    """The tables of a run, and where it starts."""
    check_steps(run, step)
    plan = build_plan(
        run.schedule,
        run.channels,
        run.grid,
        run.structure.system,
        always_slope=bool(METHODS[run.solver.method].error),
        longest=np.inf if run.adaptive else longest_step(run, step),
        reach=run.reach,
        origin=run.origin,
    )
    divergence = run.solver.divergence
    bound = (1e6, 1e6) if divergence is None else (divergence, 0.0)
    return plan, Start(run.numbers.z0[:, None], run.numbers.p[:, None], bound)


def _difference(a: Result, b: Result) -> dict[str, float]:
    """Largest difference of two runs, for the plant and for each observer that did not diverge."""
    largest = {"plant": float(np.max(np.abs(a.x - b.x)))}
    for label, observer in a.observers.items():
        gap = np.abs(observer.xhat - b.observers[label].xhat)
        largest[label] = float(np.max(gap)) if np.all(np.isfinite(gap)) else float("inf")
    return largest
