"""The metrics of many runs, made of the rows of some of them while the others still wait."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.result.estimated import Estimated
from hgorun.result.measure import measure_together
from hgorun.result.metrics.base import Metric
from hgorun.result.windows import MetricSettings


@dataclass(frozen=True, kw_only=True, eq=False)
class MetricReduction:
    """The metrics of every observer and state, with the bits that a run alone gives.

    Attributes
    ----------
    time : ndarray, shape (Nt,)
        The metrics' grid, on the run's own clock.
    every : int
        Every so many points of the rows are points of that grid.
    n, m : int
        States of the plant, which are the first of each row, and observers.
    settings : MetricSettings
        On the run's own clock.
    metrics : sequence of Metric
    estimated : callable
        The estimates along a run, from its p, shape (parameters,), and its rows, shape (grid points, states).
    """

    time: np.ndarray
    every: int
    n: int
    m: int
    settings: MetricSettings
    metrics: Sequence[Metric]
    estimated: Callable[[np.ndarray, np.ndarray], Estimated]

    @property
    def size(self) -> int:
        """Numbers of a member."""
        return len(self.metrics) * self.m * self.n

    def of(self, rows: np.ndarray, p: np.ndarray) -> np.ndarray:
        """As :class:`hgorun.engine.ensemble.Reduction` has it."""
        found = np.empty((self.size, rows.shape[2]))
        points = slice(None, None, self.every)
        for lane in range(rows.shape[2]):
            z = rows[:, :, lane]
            estimates = self.estimated(p[:, lane], z).at(points)
            values = measure_together(self.time, z[points, : self.n], estimates, self.settings, self.metrics)
            found[:, lane] = np.concatenate([values[metric.name].ravel() for metric in self.metrics])
        return found

    def named(self, reduced: np.ndarray) -> Mapping[str, np.ndarray]:
        """{metric: values, shape (m, n, N)} from what :meth:`of` gives, shape (size, N)."""
        parts = reduced.reshape(len(self.metrics), self.m, self.n, -1)
        return {metric.name: part for metric, part in zip(self.metrics, parts, strict=True)}
