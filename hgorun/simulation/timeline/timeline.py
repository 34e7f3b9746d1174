"""When everything happens in a run, and how the time in between is stepped: what the engine's tables are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.measurement.channels import Channel
from hgorun.measurement.long import AnySchedule
from hgorun.measurement.schedule import Schedule
from hgorun.simulation.timeline.steps import counted_steps


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Timeline:
    """When everything happens in a run.

    Attributes
    ----------
    schedule : Schedule or LongSchedule
    channels : sequence of Channel
        Of every group of observers; those of the outputs come first.
    grid : ndarray
        Output times.
    origin : float
        The start of the run on the configuration's clock.
    reach : float
        The longest continuous delay.
    """

    schedule: AnySchedule
    channels: Sequence[Channel]
    grid: np.ndarray
    origin: float = 0.0
    reach: float = 0.0

    @property
    def events(self) -> Schedule:
        """All events at once."""
        return self.schedule if isinstance(self.schedule, Schedule) else self.schedule.whole


@dataclass(frozen=True, kw_only=True)
class Stepping:
    """How the time between events is stepped.

    Attributes
    ----------
    longest : float
        No step is longer; infinity for adaptive steps, where a segment is one piece.
    always_slope : bool
        The method needs the slope at the end of every segment.
    uneven : float, optional
        For a run that is compared with one of even steps: so many steps for each of its steps, not even.
    """

    longest: float
    always_slope: bool = False
    uneven: float | None = None

    def total(self, schedule: AnySchedule) -> int:
        """All steps of a run."""
        counted = counted_steps(schedule, self.longest)
        return counted.total if self.uneven is None else counted.uneven(self.uneven)
