"""Runs with so many output points that their trajectories are better not held in memory.

Whether steps are short enough, and what has become of the observers, is told from a run with fewer points: some
hundred thousand say of it what ten million do. Then the run is carried out with the steps that were found, and its
rows are taken as they come: twice, since some metrics need a number that is known at the end (see
:mod:`hgorun.result.evaluation.running`). What cannot be made so is left to be made of whole trajectories.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hgorun.errors import PlantDiverged
from hgorun.measurement.noise import StretchNoise
from hgorun.observers.treatment import treatment_of
from hgorun.result.evaluation.columns import Windows
from hgorun.result.evaluation.estimated import Estimated
from hgorun.result.evaluation.running import LONGEST_MEAN, RunningMetrics
from hgorun.result.file.parts import ResultInParts, Trajectories
from hgorun.result.metrics.base import Metric, all_metrics
from hgorun.result.records.data import Integration
from hgorun.result.records.status import OK, Verdict
from hgorun.result.result import Result
from hgorun.result.windows import MetricSettings, points_in
from hgorun.simulation.divergence.confirmation import confirmed, plant_lost
from hgorun.simulation.error_control.control import controlled
from hgorun.simulation.error_control.given import LaterEstimate
from hgorun.simulation.outcome.measured import Measured, measured
from hgorun.simulation.outcome.outcome import (
    continuous_measurements,
    inputs_of,
    internal,
    measured_at_once,
    noise_along,
    outputs_of,
    record,
)
from hgorun.simulation.passes.passes import Again, Pass, as_given, integrate
from hgorun.simulation.prepared import PreparedRun

Progress = Callable[[float], None] | None

_LOOKED_AT = 1 << 18  # points
_OF_A_WINDOW = 1 << 12  # of them, at least, in each window of the metrics that has so many


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Look:
    """What a run with fewer output points tells.

    Attributes
    ----------
    run : PreparedRun
        The run with all its points, and with the events that it has been found to need.
    how : Pass
        How it is to be carried out.
    verdicts : dict of str to Verdict
        Of observers that are not ok, though they have numbers all the time.
    integration : Integration
    of_plant : Verdict
    """

    run: PreparedRun
    how: Pass
    verdicts: dict[str, Verdict]
    integration: Integration
    of_plant: Verdict


def simulated(run: PreparedRun, progress: Progress = None, *, check_step: bool = False) -> Result | None:
    """The result of a long run, with its trajectories in memory; None where more has to be known to tell.

    Arguments as of :func:`hgorun.simulation.simulate.simulate_prepared`.
    """
    look = look_at(run, progress, check_step=check_step)
    if look is None:
        return None
    raw = integrate(look.run, look.how, progress)
    found = measured(run, raw, look.verdicts)
    return record(run, raw, found, look.integration, look.of_plant)


def written(run: PreparedRun, path: Path, progress: Progress = None, *, check_step: bool = False) -> Result | None:
    """Write the result of a long run while it is carried out; None where its trajectories are needed as a whole.

    Arguments as of :func:`hgorun.simulation.simulate.simulate_into`.

    Returns
    -------
    Result or None
        Without points of its trajectories.
    """
    running = None if run.closed else _running(run)
    if running is None or not _in_rows(run):
        return None
    look = look_at(run, progress, check_step=check_step)
    if look is None:
        return None
    of_output, of_metrics = _Every(run.experiment.grid[1]), _Every(run.experiment.grid[2])
    n, structure, p = run.plant.model.n, run.structure, run.numbers.p

    def measure(times: np.ndarray, rows: np.ndarray) -> None:
        points = of_metrics.of(times.size)
        running.take(structure.estimates_along(times[points], p, rows[points]).values, rows[points, :n])

    integrate(look.run, look.how, progress, measure)
    if not running.finite:
        return None
    running.again()
    of_metrics.again()
    noises = noise_along(run)
    points = run.grid[:: run.experiment.grid[1]].size
    passed = 0
    with ResultInParts(path, len(run.observers)) as file:

        def both(times: np.ndarray, rows: np.ndarray) -> None:
            nonlocal passed
            measure(times, rows)
            shown = of_output.of(times.size)
            part = _trajectories(run, noises, times[shown], rows[shown])
            for name, values in part.along_time(np.arange(passed, passed + part.time.size)):
                file.append(name, values, points)
            passed += part.time.size

        raw = integrate(look.run, look.how, progress, both)
        metrics = running.metrics(run.grid[:: run.experiment.grid[2]])
        grid, rows = run.grid[:0], np.zeros((0, structure.system.states))
        found = _measured(run, look, grid, rows, metrics)
        result = record(run, raw, found, look.integration, look.of_plant, grid=grid)
        result = replace(result, last=run.origin + float(run.grid[:: run.experiment.grid[1]][-1]))
        file.finish(result)
    return result


def look_at(run: PreparedRun, progress: Progress, *, check_step: bool) -> Look | None:
    """What a run with fewer points tells; None where an observer may be lost, of which each point is told."""
    fewer = run.looked_at(_every(run))
    if run.solver.controlled:
        best = controlled(fewer, progress)
        verdicts = {b.label: v for b, v in zip(run.observers, best.measured.verdicts, strict=True) if v != OK}
        if any(verdict.lost or verdict.at is not None for verdict in verdicts.values()):  # or its numbers end
            return None
        whole = replace(best.run, experiment=run.experiment)
        return Look(run=whole, how=best.how, verdicts=verdicts, integration=best.integration, of_plant=best.of_plant)
    how = as_given(run)
    again = Again(fewer, how, progress)
    try:
        raw = integrate(fewer, how, progress)
    except PlantDiverged as error:
        raise plant_lost(fewer, error, again) from error
    same, verdicts = confirmed(fewer, raw, again)
    if same is not raw or any(verdict.lost for verdict in verdicts.values()):
        return None
    found = measured(fewer, raw, verdicts)
    integration = Integration(
        method=how.method,
        step=None if how.tolerance else how.step,
        rtol=how.tolerance.rtol if how.tolerance else None,
        evaluations=raw.tries * how.evaluations_of_a_step,
        error=LaterEstimate(fewer, found, finer=check_step)(),
        longest_gap=run.longest_gap,
    )
    return Look(run=run, how=how, verdicts=verdicts, integration=integration, of_plant=OK)


def _every(run: PreparedRun) -> int:
    """How many points of the metrics' grid there are for each that is looked at."""
    points = run.grid[:: run.experiment.grid[2]]
    settings = MetricSettings.of(run.experiment.blocks.metrics, run.experiment.blocks.time).since(run.origin)
    inside = [points_in(points, window) for window in (settings.steady, settings.transient)]
    fewest = min(int(window.stop - window.start) for window in inside)
    return max(1, min(points.size // _LOOKED_AT, fewest // _OF_A_WINDOW))


def _running(run: PreparedRun) -> RunningMetrics | None:
    """The metrics of a run whose rows pass; None where they need all of them at once."""
    n = run.plant.model.n
    settings = MetricSettings.of(run.experiment.blocks.metrics, run.experiment.blocks.time)
    windows = Windows.of(run.grid[:: run.experiment.grid[2]], settings.since(run.origin))
    if n < 2 or not run.observers or windows is None or windows.numbers[-1] > LONGEST_MEAN:
        return None
    if not set(all_metrics().values()) <= windows.known:
        return None
    first = run.structure.estimates_along(run.grid[:1], run.numbers.p, run.numbers.z0[None])
    return RunningMetrics(first.places, windows)


def _in_rows(run: PreparedRun) -> bool:
    """Whether everything in the result follows from one row after the other."""
    replayed = any(treatment_of(observer) == "replay" for observer in run.experiment.observers.values())
    sampled = not any(s.continuous for c in run.channels for s in c.stretches)
    return (sampled or measured_at_once(run)) and not (replayed and run.treatments)


def _measured(
    run: PreparedRun, look: Look, grid: np.ndarray, rows: np.ndarray, metrics: dict[Metric, np.ndarray]
) -> Measured:
    """What is known of some rows, beside the metrics of all of them."""
    n, truths = run.plant.model.n, Estimated(rows, run.structure.truths)
    return Measured(
        rows=rows,
        x=rows[:, :n],
        truths=truths,
        estimates=run.structure.estimates_along(grid, run.numbers.p, rows),
        verdicts=tuple(look.verdicts.get(b.label, OK) for b in run.observers),
        metrics={name: metrics[metric] for name, metric in all_metrics().items() if metric in metrics},
        settings=MetricSettings.of(run.experiment.blocks.metrics, run.experiment.blocks.time),
        steady=truths,
    )


def _trajectories(
    run: PreparedRun, noises: list[list[StretchNoise]], grid: np.ndarray, rows: np.ndarray
) -> Trajectories:
    """Some rows as the result has them; ``noises`` as of :func:`continuous_measurements`."""
    estimates = run.structure.estimates_along(grid, run.numbers.p, rows)
    y = outputs_of(run, grid, rows)
    return Trajectories(
        time=run.origin + grid,
        x=rows[:, : run.plant.model.n],
        u=inputs_of(run, grid),
        y=y,
        measured=continuous_measurements(run, noises, grid, y) if measured_at_once(run) else None,
        xhat={b.label: estimates.of(j) for j, b in enumerate(run.observers)},
        internal={b.label: internal(b, rows) for b in run.observers},
    )


class _Every:
    """Every so many points of those that come some at a time."""

    def __init__(self, every: int) -> None:
        self._every, self._passed = every, 0

    def of(self, count: int) -> slice:
        """Which of the next ones."""
        first = -self._passed % self._every
        self._passed += count
        return slice(first, count, self._every)

    def again(self) -> None:
        """From the first one."""
        self._passed = 0
