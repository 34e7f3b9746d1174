"""Observers of a stream that step from sample to sample: of all outputs, with the inputs of the sample before."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hgorun.engine.plan import Floats
from hgorun.errors import Problem
from hgorun.estimate.stream.event import Event
from hgorun.estimate.stream.gaps import Gaps
from hgorun.estimate.stream.live_system import LiveSystem
from hgorun.observers.base import CorrectedObserver
from hgorun.observers.sample_times import OnePeriod

_UNEVEN = 1e-6  # of a period


def require_whole(system: LiveSystem, event: Event, newest: Sequence[Sequence[float]], gaps: Gaps, number: int) -> int:
    """Refuse the next sample where one of another output is missing.

    Parameters
    ----------
    number : int
        How many times of samples there have been.
    newest : sequence of sequence of float
        Of every output when the newest sample was taken that each observer has used.

    Returns
    -------
    int
        How many there have been with this one.

    Raises
    ------
    ValueError
    """
    last = [taken[0] for taken in newest]
    for name, i in system.outputs.items():
        if last[i] == event.t and any(i == one for one, _, _ in event.samples):
            raise ValueError(
                f"{system.stepping} steps from sample to sample, and this is a second one of {name} at "
                f"t = {system.experiment.origin + event.t:.12g}: leave one of them out, or give their mean"
            )
    if event.t > max(last) > -np.inf:
        _require_period(system, event.t, max(last))
        gaps.require(event.t - max(last), number - 1, event.t)
    if event.t > max(last) > min(last):
        missing = ", ".join(name for name, i in system.outputs.items() if last[i] < max(last))
        raise ValueError(
            f"{system.stepping} steps from sample to sample of all outputs, and that of {missing} at "
            f"t = {system.experiment.origin + max(last):.12g} is missing: give those of one time together, or one "
            "after the other"
        )
    return number + int(event.t > max(last))


def _require_period(system: LiveSystem, t: float, before: float) -> None:
    """Refuse a gap that is not the period of an observer whose step is that of one."""
    experiment, gap = system.experiment, t - before
    for label, design in experiment.designs.items():
        if not isinstance(design.observer, OnePeriod):
            continue
        period = design.observer.one_period(design.form)
        if abs(gap - period) > _UNEVEN * period:
            raise ValueError(
                f"the step of {label} is that of one period, {period:.6g}, and the sample of "
                f"t = {experiment.origin + t:.12g} comes {gap:.6g} after the one before"
            )


def require_times(system: LiveSystem, event: Event, before: tuple[float, ...]) -> tuple[float, ...]:
    """Refuse samples at times that the gain of an observer is not for, as a file does.

    Parameters
    ----------
    before : tuple of float
        Of every output when its newest sample was taken.

    Returns
    -------
    tuple of float
        The same with these samples.

    Raises
    ------
    ValueError
    """
    now, origin = list(before), system.experiment.origin
    times = {name: [before[i]] if before[i] >= 0.0 else [] for name, i in system.outputs.items()}
    for name, i in system.outputs.items():
        if any(i == one for one, _, _ in event.samples):
            times[name].append(event.t)
            now[i] = event.t
    for design in system.timed:
        assert isinstance(design.observer, CorrectedObserver)
        try:
            design.observer.check_times(design.form, {name: np.array(one) for name, one in times.items()}, origin)
        except Problem as problem:
            raise ValueError(
                f"the sample of t = {origin + event.t:.12g}: {design.label}: {problem.message}"
            ) from problem
    return tuple(now)


def keep_inputs(system: LiveSystem, w: Floats) -> None:
    """Those at a sample are the inputs before to the step that follows."""
    for place, _, _, before in map(system.structure.system.held.input, range(len(system.inputs))):
        w[before] = w[place]
