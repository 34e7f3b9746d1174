"""The stretches of a long log with all that can be made before they are carried out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.engine.plan import Plan
from hgorun.estimate.carrying import UNEVEN
from hgorun.estimate.long.stretches import Stretch, Stretches, points_before
from hgorun.estimate.scores.compared import Key
from hgorun.estimate.scores.lag import Instrument, felt_of
from hgorun.estimate.scores.output_points import OutputPoints
from hgorun.pieces import distinct
from hgorun.simulation.timeline.steps import steps_between
from hgorun.simulation.timeline.tabulated import Stretchwise
from hgorun.symbolic.evaluate import Floats

_FIRST, _EVERY = 2, 8  # stretches that are carried out with other steps as well: the first ones, then every so many


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Planned:
    """A stretch with all but its plan that can be made before it is carried out.

    Attributes
    ----------
    stretch : Stretch
    grid, times : ndarray
        The output points in it, and all times at which estimates are wanted.
    aside : mapping of Key to (ndarray, ndarray)
        Times and values of what is compared.
    beside : Plan or None
        Of a pass with other steps, where that is compared.
    steps : set of int
        How many there are between two events.
    """

    stretch: Stretch
    grid: Floats
    times: Floats
    aside: Mapping[Key, tuple[Floats, Floats]]
    beside: Plan | None
    steps: set[int]


def planned(
    stretches: Stretches,
    grid: OutputPoints,
    asked: Mapping[Key, tuple[Floats, Floats]],
    step: float,
    instruments: Sequence[Instrument],
    between: Floats,
) -> Iterator[tuple[Planned, Plan]]:
    """All stretches, one after the other, each with its plan: that is let go before the stretch is told of.

    Parameters
    ----------
    stretches : Stretches
    grid : OutputPoints
        The output points of the run.
    asked : mapping of Key to (ndarray, ndarray)
        Times and values of all that is compared.
    step : float
        The longest.
    instruments : sequence of Instrument
        Those that lag.
    between : ndarray
        When they are to see estimates, beside the samples and the times at which they have shown something.
    """
    shared = Stretchwise()
    at, seen, done = 0, 0, dict.fromkeys(asked, 0)
    for number, stretch in enumerate(stretches):
        before, at = at, points_before(grid, stretch, step)
        own, aside = grid[before:at], {}
        for key, (taken, values) in asked.items():
            some = slice(done[key], points_before(taken, stretch, step))
            aside[key], done[key] = (taken[some], values[some]), some.stop
        felt = [
            felt_of(samples.taken, one.taken, one.lag) for one in instruments for samples in stretch.prepared.samples
        ]
        first, seen = seen, points_before(between, stretch, step)
        wanted = [between[first:seen], *felt, *(taken for taken, _ in aside.values())]
        times = distinct(np.concatenate([own, *wanted])) if aside else own
        judged = number < _FIRST or number % _EVERY == 0
        plan = _plan(stretch, times, step, None, shared)
        found = Planned(
            stretch=stretch,
            grid=own,
            times=times,
            aside=aside,
            beside=_plan(stretch, times, step, UNEVEN, shared) if judged else None,
            steps=_set_of(steps_between(stretch.prepared.run.schedule, step)),
        )
        yield found, plan
        del found, plan


def _set_of(steps: np.ndarray) -> set[int]:
    some = steps if any(steps.strides) else steps[:1]  # of one in memory
    fewest, most = int(some.min()), int(some.max())
    return {fewest} if fewest == most else set(distinct(steps).tolist())


def _plan(stretch: Stretch, times: Floats, step: float, uneven: float | None, shared: Stretchwise) -> Plan:
    """Its tables but for the first ones are made by whoever carries it out, in whose cache they are then."""
    return stretch.prepared.plan(np.append(times, stretch.end), step, uneven, shared)
