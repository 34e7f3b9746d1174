"""The output points of an estimate, with those at samples that are meant to be there."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from hgorun.estimate.samples import Sampled, rounding_of
from hgorun.native.places import last_near
from hgorun.pieces import ascending
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.timeline.grid import EvenPoints
from hgorun.simulation.timeline.recorded_inputs import RecordedInputs
from hgorun.symbolic.evaluate import Floats

_NEAR, _APART = 1e-9, 0.25  # of the step of a grid: what a sample is one with a point within, and not beyond

Clock: TypeAlias = tuple[Floats, float]
"""Ascending times, and the start of the run among them."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class OutputPoints:
    """A grid whose points have the times of samples, and of changes of inputs, where they differ by rounding alone.

    Multiples of a step are rounded otherwise than the stamps of a log, and stamps that a logger has made by sums are
    off by more: what an estimate is at such a point should not follow from that, nor from the steps of the integration.

    Attributes
    ----------
    even : EvenPoints
        Those of the grid as it is given.
    clocks : tuple of Clock
        When something happens.
    end : float
        Of the run, whose times are counted from its start.
    tolerance : float
        How far apart a point and a sample are one.
    """

    even: EvenPoints
    clocks: tuple[Clock, ...]
    end: float
    tolerance: float

    @classmethod
    def of(cls, experiment: Experiment, clocks: Iterable[Clock]) -> OutputPoints:
        """Those of an experiment."""
        points, every, _ = experiment.even_grid
        even, end = EvenPoints(-(-points.size // every), points.step, every), experiment.time.end
        tolerance = same_point(even.spacing, rounding_of(experiment.origin, end))
        known = {(*_place_of(times), origin): (times, origin) for times, origin in clocks}  # signals may share theirs
        return cls(even=even, clocks=tuple(known.values()), end=end, tolerance=tolerance)

    @property
    def size(self) -> int:
        """How many there are."""
        return self.even.size

    def __getitem__(self, some: slice) -> Floats:
        """Some that follow each other, as an array."""
        return self.at_samples(self.even[some])

    def before(self, time: float) -> int:
        """How many lie before a time."""
        first = max(self.even.before(time) - 1, 0)  # a sample moves a point by much less than a step
        return first + int(np.searchsorted(self[first : first + 2], time, side="left"))

    def at_samples(self, times: Floats) -> Floats:
        """Ascending times, with those of samples in place of those that are near one; of several the last."""
        if not times.size:
            return times
        best: Floats | float = -np.inf
        for clock in self.clocks:
            own = self._between(clock, times[0] - self.tolerance, times[-1] + self.tolerance)
            if own.size:
                best = np.maximum(best, last_near(own, times, self.tolerance))
        return np.where(best >= 0, best, times)

    def _between(self, clock: Clock, first: float, last: float) -> Floats:
        """The times of a clock from one to another, counted from the start of the run."""
        times, origin = clock
        start = bisect_left(times, first, key=lambda time: time - origin)
        stop = bisect_right(times, last, key=lambda time: time - origin)
        own = times[start:stop] - origin if origin else times[start:stop]
        inside = own.size and own[0] > 0.0 and own[-1] <= self.end  # a zero may have a sign
        return own if inside else np.clip(own, 0.0, self.end)


def _place_of(times: Floats) -> tuple[int, int, int]:
    """Where in memory an array is: its address, how many numbers it has, and how far they are from each other."""
    return times.__array_interface__["data"][0], times.size, times.strides[0]


def same_point(step: float, rounding: float) -> float:
    """How far apart a point of a grid and a sample are that are meant to be one.

    Parameters
    ----------
    step : float
        Of the grid.
    rounding : float
        How far a time may be from its place.
    """
    return min(max(_NEAR * step, rounding), _APART * step)


def clocks_of(samples: Iterable[Sampled], inputs: RecordedInputs | None = None) -> list[Clock]:
    """When samples are taken, and known, and inputs change; outputs may share their times."""
    found = {id(times): times for one in samples for times in (one.taken, one.available)}
    if inputs is not None:
        found[id(inputs.times)] = inputs.times
    return [(times if ascending(times, strictly=False) else np.sort(times), 0.0) for times in found.values()]
