"""Run an experiment: from its symbolic description to trajectories."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np

from hgorun.result.result import Result
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.recording import record
from hgorun.simulation.run import Run


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
        Told now and then which part of the run is done, 0 to 1.

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
    return perform(prepare(experiment), check_step=check_step, progress=progress)


def prepare(experiment: Experiment) -> Run:
    """Check all that can be checked without running: models, schedules, observers, figures.

    Once for an experiment: its compiled code is used again.

    Raises
    ------
    ConfigError
    """
    if experiment.prepared is None:
        with experiment.located():
            _check_figures(experiment)
            experiment.prepared = Run(experiment)
    return cast(Run, experiment.prepared)


def _check_figures(experiment: Experiment) -> None:
    if experiment.blocks.figures:
        from hgorun.figures import RunNames, check

        model, time = experiment.plant.model, experiment.blocks.time
        names = RunNames(model.states, model.outputs, tuple(experiment.observers), (time.start, time.end))
        check(experiment.blocks.figures, {experiment.name: names})


def perform(run: Run, *, check_step: bool = False, progress: Callable[[float], None] | None = None) -> Result:
    """Carry out a prepared run; see :func:`simulate`."""
    with run.experiment.located():
        result = record(run, run.execute(run.step, progress))
        if check_step and not run.adaptive:
            half = record(run, run.execute(run.step / 2, progress))
            result = replace(result, integration_error=_difference(result, half))
    return result


def _difference(a: Result, b: Result) -> dict[str, float]:
    """Largest difference of two runs, for the plant and for each observer that did not diverge."""
    found = {"plant": float(np.max(np.abs(a.x - b.x)))}
    for label, observer in a.observers.items():
        gap = np.abs(observer.xhat - b.observers[label].xhat)
        found[label] = float(np.max(gap)) if np.all(np.isfinite(gap)) else float("inf")
    return found
