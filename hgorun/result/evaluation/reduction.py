"""The metrics of many runs, made of the rows of some of them while the others still wait."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from hgorun.engine.many import Reducer
from hgorun.result.evaluation.columns import Windows
from hgorun.result.evaluation.estimated import Estimated
from hgorun.result.evaluation.lanes import LaneMetrics
from hgorun.result.evaluation.measure import measure_together
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
    truths : sequence of sequence of int
        For every observer the states that it estimates.
    estimated : callable
        The estimates along a run, from its p, shape (parameters,), and its rows, shape (grid points, states).
    closed : bool
        Whether the first n states are those of the plant that the true state drives.
    places : sequence of sequence of int, optional
        Of every observer the states that are its estimates, where all are.
    """

    time: np.ndarray
    every: int
    n: int
    m: int
    settings: MetricSettings
    metrics: Sequence[Metric]
    truths: Sequence[Sequence[int]]
    estimated: Callable[[np.ndarray, np.ndarray], Estimated]
    closed: bool = False
    places: Sequence[Sequence[int]] | None = None

    @property
    def size(self) -> int:
        """Numbers of a member."""
        return len(self.metrics) * self.m * self.n

    @property
    def states(self) -> Sequence[int] | None:
        """Those of the plant and the estimates, where these are states."""
        return None if self.places is None else sorted({*range(self.n), *chain(*self.truths), *chain(*self.places)})

    def reducer(self, lanes: int, *, whole: int | None = None) -> Reducer | None:
        """The built-in metrics compiled; None where they are left to numpy."""
        windows = Windows.of(self.time, self.settings)
        if self.places is None or self.n < 2 or windows is None or not windows.known.issuperset(self.metrics):
            return None
        code = self._code(windows, lanes, whole=whole)
        return Reducer(address=code.address, arrays=code.workspace(), size=code.size)

    def _code(self, windows: Windows, lanes: int, *, whole: int | None = None) -> LaneMetrics:
        assert self.places is not None
        assert self.states is not None
        shown = self.states if whole is None else range(whole)
        at = {state: place for place, state in enumerate(shown)}
        return LaneMetrics(
            time=self.time,
            every=self.every,
            width=len(at),
            xhat=[at[state] for state in chain(*self.places)],
            x=[at[state] for state in chain(*self.truths)],
            windows=windows,
            lanes=lanes,
        )

    def finished(self, found: np.ndarray) -> np.ndarray:
        """The metrics from what the compiled passes have found; infinite where an estimate is not finite."""
        windows = Windows.of(self.time, self.settings)
        assert windows is not None
        values, lost = self._code(windows, 1).metrics(found)
        lost = np.repeat(lost.reshape(self.m, self.n, -1).any(axis=1), self.n, axis=0)
        return np.concatenate([np.where(lost, np.inf, values[metric]) for metric in self.metrics])

    def of(self, rows: np.ndarray, p: np.ndarray) -> np.ndarray:
        """As :class:`hgorun.engine.ensemble.Reduction` has it."""
        found = np.empty((self.size, rows.shape[2]))
        points = slice(None, None, self.every)
        for lane in range(rows.shape[2]):
            z = rows[:, :, lane]
            estimates = self.estimated(p[:, lane], z).at(points)
            truths, reference = Estimated(z[points], self.truths), z[points, : self.n] if self.closed else None
            values = measure_together(self.time, truths, estimates, self.settings, self.metrics, reference)
            found[:, lane] = np.concatenate([values[metric.name].ravel() for metric in self.metrics])
        return found

    def named(self, reduced: np.ndarray) -> Mapping[str, np.ndarray]:
        """{metric: values, shape (m, n, N)} from what :meth:`of` gives, shape (size, N)."""
        parts = reduced.reshape(len(self.metrics), self.m, self.n, -1)
        return {metric.name: part for metric, part in zip(self.metrics, parts, strict=True)}
