"""What the observers of an experiment observe: its plant, when outputs are measured, and where a run is recorded."""

from __future__ import annotations

from functools import cached_property
from typing import Self

import numpy as np

from hgorun.measurement.availability import Stretch, resolve
from hgorun.measurement.noise import deviations
from hgorun.memo import Memo, same
from hgorun.plants.build import BuiltPlant, build_plant
from hgorun.simulation.experiment.configured import Configured
from hgorun.simulation.timeline.grid import EvenGrid, even_grid_of, grid_of, metric_step

# what the runs of a family share, and by which their schedules are known again
_STRETCHES: Memo[list[list[Stretch]]] = Memo(16)


class Observed(Configured):
    """What follows from a configuration but for its observers; these are known by their blocks alone."""

    @cached_property
    def plant(self) -> BuiltPlant:
        """The plant as a model with numbers."""
        with self.located():
            return build_plant(self.plant_block, self.origin, self.controller)

    @cached_property
    def stretches(self) -> list[list[Stretch]]:
        """Every output's availability, phase by phase."""
        outputs, time = self.plant.model.outputs, self.blocks.time
        with self.located():
            return _STRETCHES.get(
                (same(self.measurement), outputs, time), lambda: resolve(self.measurement, outputs, time)
            )

    @property
    def metric_step(self) -> float:
        """Spacing of the points that metrics are taken from."""
        return self._every * metric_step(self.blocks.time, self.blocks.metrics)

    @cached_property
    def _every(self) -> int:
        """How many points of the metrics' grid make a step of this experiment's, see :meth:`looked_at`."""
        return 1

    def looked_at(self, every: int) -> Self:
        """The same, but with output at every so many points of the metrics' grid alone."""
        new = object.__new__(type(self))
        new.__dict__ |= self.__dict__
        points, _, of_metrics = self.grid
        new._every, new.grid = every, (points[:: every * of_metrics].copy(), 1, 1)
        return new

    @cached_property
    def grid(self) -> tuple[np.ndarray, int, int]:
        """The finer of output and metric grid, from 0 on, and how many of its points make a step of each."""
        with self.located():
            return grid_of(self.blocks.time, self.blocks.metrics, self.plant.model.n, len(self.observers))

    @cached_property
    def even_grid(self) -> EvenGrid:
        """The same, with points that are made when they are asked for."""
        with self.located():
            return even_grid_of(self.blocks.time, self.blocks.metrics, self.plant.model.n, len(self.observers))

    def sampled(self) -> bool:
        """Whether all outputs are, all the time."""
        return not any(stretch.continuous for output in self.stretches for stretch in output)

    def _late(self) -> bool:
        """Whether a continuous output is."""
        return any(stretch.continuous and not stretch.undelayed for output in self.stretches for stretch in output)

    @cached_property
    def _noise(self) -> dict[str, float]:
        """Standard deviation of the outputs' noise, where several outputs share the states."""
        outputs = self.plant.model.outputs
        return deviations(self.stretches, outputs) if len(outputs) > 1 else {}
