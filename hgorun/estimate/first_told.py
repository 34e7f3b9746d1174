"""The start of a stream whose inputs come with its samples: what depends on them waits until they are known."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hgorun.config.paths import dotted
from hgorun.engine.live import Live
from hgorun.errors import Problem
from hgorun.estimate.bound import known_at
from hgorun.estimate.event import Event
from hgorun.estimate.live_system import LiveSystem
from hgorun.symbolic.evaluate import Floats


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
        Where observers cannot start and something follows from their states, and where a right-hand side is not a
        number when time goes on.
    """
    known = told | {number: value for number, value in event.inputs if event.t <= 0.0 or number not in told}
    if system.driven and not heard:
        z = system.start_with(known) if event.inputs else live.z
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
        raise ValueError(f"{dotted(problem.path)}: {problem.message}{why}") from problem


def _missing(system: LiveSystem, known: Mapping[int, float]) -> str:
    return ", ".join(name for name, number in system.inputs.items() if number not in known)
