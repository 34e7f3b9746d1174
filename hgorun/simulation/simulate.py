"""Run an experiment: from its symbolic description to trajectories."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from hgorun.engine.memory import Raw
from hgorun.errors import NoStep, PlantDiverged, SimulationError
from hgorun.result.records.data import Integration
from hgorun.result.result import Result
from hgorun.simulation.divergence.confirmation import confirmed, plant_lost
from hgorun.simulation.error_control.given import LaterEstimate
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.known import Known
from hgorun.simulation.outcome.measured import measured
from hgorun.simulation.outcome.outcome import record
from hgorun.simulation.passes import loss
from hgorun.simulation.passes.passes import Again, as_given, integrate
from hgorun.simulation.preparation.preparation import prepare
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.timeline.grid import LONG

__all__ = ["prepare", "simulate", "simulate_prepared"]


def simulate(
    experiment: Experiment, *, check_step: bool = False, progress: Callable[[float], None] | None = None
) -> Result:
    """Simulate the plant and all observers.

    Parameters
    ----------
    experiment : Experiment
    check_step : bool
        Estimate the integration error of a given step from shorter steps, which takes longer and tells more.
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
    run: PreparedRun,
    *,
    check_step: bool = False,
    progress: Callable[[float], None] | None = None,
    known: Known | None = None,
) -> Result:
    """Simulate a prepared run; see :func:`simulate`. Of what is ``known`` nothing is integrated again."""
    with located(run):
        if run.grid.size > LONG:
            from hgorun.simulation.long_run import simulated  # not for the short ones

            found = simulated(run, progress, check_step=check_step)
            if found is not None:
                return found
        if run.solver.controlled:
            from hgorun.simulation.error_control.control import controlled  # not for the short runs of a given step

            best = controlled(run, progress)
            return record(
                replace(run, remarks=best.run.remarks), best.raw, best.measured, best.integration, best.of_plant
            )
        how = as_given(run)
        again = Again(run, how, progress)
        try:
            raw = integrate(run, how, progress) if known is None else known.integrate(run, how)
        except PlantDiverged as error:
            raise plant_lost(run, error, again) from error
        except NoStep as error:
            from hgorun.simulation.divergence.escape import escaped, explained  # not for runs that can be followed

            raise escaped(run) or explained(run, error) from error
        return finished(run, raw, again, check_step=check_step)


def simulate_into(
    run: PreparedRun, path: Path, *, check_step: bool = False, progress: Callable[[float], None] | None = None
) -> Result:
    """Simulate a prepared run and write its result, whose trajectories are written as they come where they are long.

    Parameters
    ----------
    path : Path
        The file, see :meth:`hgorun.result.result.Result.save`.

    Returns
    -------
    Result
        Without points of trajectories where they were written as they came.

    Raises
    ------
    SimulationError
        When the plant diverges.
    HgorunError
        When the file cannot be written.
    """
    if run.grid.size > LONG:
        from hgorun.simulation.long_run import written  # not for the short ones

        with located(run):
            found = written(run, path, progress, check_step=check_step)
        if found is not None:
            return found
    result = simulate_prepared(run, check_step=check_step, progress=progress)
    result.save(path)
    return result


def finished(run: PreparedRun, raw: Raw, again: loss.Again, *, check_step: bool = False) -> Result:
    """The result of a run whose step or tolerances are given, from the engine's arrays; to be called :func:`located`.

    Parameters
    ----------
    raw : Raw
        What the run has given with the engine's bound.
    again : Again
        The same run once more, where that is needed to tell what has become of an observer.
    """
    how = as_given(run)
    raw, verdicts = confirmed(run, raw, again)
    if verdicts and how.tolerance:
        from hgorun.simulation.divergence.stopped import crossed  # not for runs in which nothing is lost

        verdicts = crossed(run, raw, verdicts)
    found = measured(run, raw, verdicts)
    integration = Integration(
        method=how.method,
        step=None if how.tolerance else how.step,
        rtol=how.tolerance.rtol if how.tolerance else None,
        evaluations=raw.tries * how.evaluations_of_a_step,
        error=LaterEstimate(run, found, finer=check_step),
        longest_gap=run.longest_gap,
    )
    return record(run, raw, found, integration)


@contextmanager
def located(run: PreparedRun) -> Iterator[None]:
    """Say where in the file a problem is, and which plant it was that could not be followed."""
    try:
        with run.experiment.located():
            yield
    except SimulationError as error:
        file, line = run.experiment.source.where(("plant",))
        where = f"{file}:{line}: " if file else ""
        raise SimulationError(f"{where}plant: {error}") from error
