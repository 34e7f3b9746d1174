"""What a program of Python may give where an experiment is expected: a file, a mapping, an experiment."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from hgorun.config.types import describe
from hgorun.errors import ConfigError
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.simulate import simulate as simulated
from hgorun.study.loading import load

Given = Experiment | Mapping[str, Any] | str | Path


def experiment_of(given: Given, run: str | None = None, seed: int | None = None) -> Experiment:
    """The experiment that is meant.

    Parameters
    ----------
    given : Experiment, mapping or path
        An experiment, the blocks of one, or its YAML file.
    run : str, optional
        Which, of a file with several ``runs``.
    seed : int, optional
        In place of its own.

    Raises
    ------
    ConfigError
        When it is none of these, or something in it is wrong.
    """
    if isinstance(given, (str, Path)):
        if not str(given).strip():
            raise ConfigError("experiment: expected a file, a mapping or an Experiment, found an empty text")
        if "\n" in str(given):
            raise ConfigError(
                "experiment: expected the path of a file, found text of several lines; give a mapping, "
                "such as yaml.safe_load(text), or write it to a file"
            )
        return load(given, seed=seed, run=run)
    if isinstance(given, Mapping):
        return load(given, seed=seed, run=run)
    if run is not None:
        raise ConfigError("run names one of the runs of a file")
    if isinstance(given, Experiment):
        return given if seed is None else given.varied({}, seed=seed)
    raise ConfigError(f"experiment: expected a file, a mapping or an Experiment, found {describe(given)}")


def simulate(
    experiment: Given,
    *,
    seed: int | None = None,
    run: str | None = None,
    check_step: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Result:
    """Simulate the plant and all observers.

    Parameters
    ----------
    experiment : Experiment, mapping or path
        An experiment, the blocks of one as they stand in a YAML file, or the file.
    seed : int, optional
        Overrides the seed of the experiment.
    run : str, optional
        Which, of a file with several ``runs``.
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
        When the configuration does not fit together: what is wrong, where, and what would be right.
    SimulationError
        When the plant diverges.

    Examples
    --------
    >>> plant = {"states": ["x1", "x2"], "dynamics": {"x1": "x2", "x2": "-sin(x1)"}, "output": "x1"}
    >>> plant["initial"], observers = {"x1": 1, "x2": 0}, {"SHGO": {"type": "shgo", "theta": 5}}
    >>> time = {"end": 5, "output_step": 0.1}
    >>> hgorun.simulate({"time": time, "plant": plant, "observers": observers}).status
    'ok'
    """
    return simulated(experiment_of(experiment, run, seed), check_step=check_step, progress=progress)
