"""The start of a stream whose inputs come with its samples: what depends on them waits until they are known."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hgorun.config.paths import dotted
from hgorun.engine.live import Live
from hgorun.errors import ConfigError, Problem
from hgorun.estimate.steps.bound import known_at
from hgorun.estimate.stream.event import Event
from hgorun.estimate.stream.live_system import LiveSystem
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.symbolic.evaluate import Floats


class NoStart(ValueError):
    """Observers cannot start where the configuration lets them, with the inputs that have come.

    Parameters
    ----------
    problem : Problem
        What is wrong, and at which key.
    experiment : Experiment
        Whose start it is.

    Attributes
    ----------
    located : ConfigError
        The same with file and line.
    """

    def __init__(self, problem: Problem, experiment: Experiment) -> None:
        super().__init__(f"{dotted(problem.path)}: {problem.message}")
        try:
            with experiment.located():
                raise problem
        except ConfigError as error:
            self.located = error


def begin(system: LiveSystem, live: Live, event: Event, told: dict[int, float], *, heard: bool) -> dict[int, float]:
    """Let observers start with the inputs that are known by now, before time goes on.

    Parameters
    ----------
    system : LiveSystem
    live : Live
        At the start; its states may change.
    event : Event
        What comes.
    told : dict of int to float
        The inputs that were known before, by their numbers.
    heard : bool
        Whether an output has had a sample, so that the states are no longer those of the start.

    Returns
    -------
    dict of int to float
        The inputs that are known now.

    Raises
    ------
    ValueError
        Where observers cannot start and something follows from their states.
    NoStart
        Where their equations have no numbers at their start, or a right-hand side is none when time goes on.
    """
    known = told | {number: value for number, value in event.inputs if event.t <= 0.0 or number not in told}
    if system.driven and not heard:
        z = live.z
        if event.inputs:
            try:
                z = system.start_with(known)
            except Problem as problem:
                raise NoStart(problem, system.experiment) from problem
        if event.samples or event.t > 0.0:
            _require_start(system, z, known)
        if event.inputs:
            live.begin_with(z, known_at(z))
    if event.t > 0.0:
        _check(system, told, known, live.w)
    return known


def _require_start(system: LiveSystem, z: Floats, known: Mapping[int, float]) -> None:
    if np.isnan(z).any():
        raise ValueError(
            f"{', '.join(system.driven)}: the derivatives of the output at the start depend on inputs, and "
            f"{_missing(system, known)} is not known yet: give inputs before the first sample, or with it"
        )


def _check(system: LiveSystem, told: Mapping[int, float], known: Mapping[int, float], w: Floats) -> None:
    """As of a file, whose inputs at the start are known."""
    try:
        system.check_start_with(known, w)
    except Problem as problem:
        missing = _missing(system, told)
        why = f"; {missing} is not known yet and counts as 0: give it at the start" if missing else ""
        raise NoStart(Problem(problem.path, problem.message + why), system.experiment) from problem


def _missing(system: LiveSystem, known: Mapping[int, float]) -> str:
    return ", ".join(name for name, number in system.inputs.items() if number not in known)
