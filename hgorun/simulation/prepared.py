"""A run, ready to be integrated: its structure, shared with other runs, and its numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hgorun.config.models import Solver, Time
from hgorun.measurement.channels import Channel
from hgorun.measurement.extremes import Unknown
from hgorun.measurement.late import Treatment, heard
from hgorun.measurement.long import AnySchedule
from hgorun.measurement.schedule import Schedule, at_events, tolerances
from hgorun.memo import Memo, same
from hgorun.plants.build import BuiltPlant
from hgorun.simulation.design.first_inputs import Recorded
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.plant_alone import PlantRun
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.simulation.system.structure import Structure
from hgorun.simulation.timeline.grid import LONG
from hgorun.simulation.timeline.timeline import Timeline
from hgorun.symbolic.forms import Form

# tables of runs of one family are known again by their grids
_AT_EVENTS: Memo[np.ndarray] = Memo(16, lambda grid: grid.size < LONG)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Numbers:
    """What two runs of one structure differ in.

    Attributes
    ----------
    p, z0 : ndarray
        Parameters, and the initial state.
    observers : tuple of ObserverBlock
        With the numbers of this run.
    """

    p: np.ndarray
    z0: np.ndarray
    observers: tuple[ObserverBlock, ...]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PreparedRun:
    """All that is decided before the first step.

    Attributes
    ----------
    step : float
        The nominal step.
    channels : list of Channel
        What is measured of every output.
    schedule : Schedule or LongSchedule
    longest_step, reach : float
        No step is longer, and no continuous delay.
    treatments : tuple of str
        What is done with late samples by groups of observers, beside the common innovation.
    remarks : tuple of str
        What should be known of the run although nothing is wrong with it.
    unknown : tuple of Unknown
        Functions of time in which an automatic step may miss something.
    recorded : tuple
        The inputs that are recorded, as they begin.
    """

    experiment: Experiment
    structure: Structure
    numbers: Numbers
    step: float
    channels: list[Channel]
    schedule: AnySchedule
    smallest_delay: float
    reach: float
    treatments: tuple[Treatment, ...] = ()
    remarks: tuple[str, ...] = ()
    unknown: tuple[Unknown, ...] = ()
    recorded: Recorded = ()

    @cached_property
    def heard(self) -> list[Channel]:
        """The channels of all groups of observers; where they drive plants those of the true state come first."""
        return heard(self.channels, self.treatments)

    @property
    def closed(self) -> bool:
        """Whether the estimates drive the plant, a copy of it for each observer."""
        return bool(self.structure.loops)

    @property
    def plant(self) -> BuiltPlant:
        """The plant with its numbers."""
        return self.experiment.plant

    @property
    def forms(self) -> dict[str, Form]:
        """The plant as every observer sees it."""
        return self.experiment.forms

    @property
    def time(self) -> Time:
        """Horizon and output grid, counted from the start of the run."""
        return self.experiment.time

    @property
    def origin(self) -> float:
        """The start of the run on the clock of the configuration."""
        return self.experiment.origin

    @property
    def solver(self) -> Solver:
        """How the equations are solved."""
        return self.experiment.blocks.solver

    @property
    def span(self) -> float:
        """How long the run lasts."""
        return self.time.end - self.time.start

    @property
    def longest_gap(self) -> float:
        """The longest time between two events."""
        return self.schedule.longest_gap

    @property
    def adaptive(self) -> bool:
        """Whether given tolerances control every step."""
        return self.experiment.adaptive

    @property
    def grid(self) -> np.ndarray:
        """The finer of output and metric grid."""
        return self.experiment.grid[0]

    @property
    def timeline(self) -> Timeline:
        """When everything happens.

        On a clock that does not start at zero, listed times of samples are off by its rounding from points of the grid,
        which count from the start: those are then at the samples.
        """
        grid, schedule = self.grid, self.schedule
        if self.origin and isinstance(schedule, Schedule):
            rounding, _ = tolerances(self.channels, self.step)
            key = same(grid), same(schedule), rounding
            grid = _AT_EVENTS.get(key, lambda: at_events(self.grid, schedule.events, rounding))
        return self.timeline_on(grid)

    def timeline_on(self, grid: np.ndarray) -> Timeline:
        """The same with other output times."""
        return Timeline(schedule=self.schedule, channels=self.heard, grid=grid, origin=self.origin, reach=self.reach)

    def looked_at(self, every: int) -> PreparedRun:
        """The same run with output at every so many points of the metrics' grid alone."""
        return replace(self, experiment=self.experiment.looked_at(every))

    @property
    def observers(self) -> tuple[ObserverBlock, ...]:
        """The observers with the numbers of this run."""
        return self.numbers.observers

    @cached_property
    def plant_alone(self) -> PlantRun:
        """The plant without observers, at other times than those of the grid."""
        return PlantRun(self.plant, self.time, self.step, self.origin, stiff=self.solver.alone_stiff)
