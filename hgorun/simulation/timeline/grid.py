"""The points of a run at which there is output, and those that metrics are taken from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from hgorun.config.models import Metrics, Time
from hgorun.errors import Problem
from hgorun.memo import Memo
from hgorun.result.windows import points_in, window_since

Grid: TypeAlias = tuple[np.ndarray, int, int]


@dataclass(frozen=True, eq=False, repr=False)
class EvenPoints:
    """Points 0, step, 2 step, ... of which only those are made that are asked for: there may be many.

    Attributes
    ----------
    size : int
        How many there are.
    step : float
    every : int
        Only every so many multiples of the step are among them.
    """

    size: int
    step: float
    every: int = 1

    @property
    def spacing(self) -> float:
        """From one of them to the next."""
        return self.step * self.every

    def __getitem__(self, some: slice) -> np.ndarray:
        """Some that follow each other, as an array."""
        first, stop, between = some.indices(self.size)
        assert between == 1
        points = np.arange(first * self.every, stop * self.every, self.every, dtype=float)
        points *= self.step
        return points

    def before(self, time: float) -> int:
        """How many lie before a time."""
        near = int(np.clip(time / self.spacing, 0, self.size))  # rounding may have moved it by one
        first = max(near - 2, 0)
        return first + int(np.searchsorted(self[first : near + 3], time, side="left"))


EvenGrid: TypeAlias = tuple[EvenPoints, int, int]


def metric_step(time: Time, metrics: Metrics) -> float:
    """Spacing of the points that metrics are taken from."""
    return metrics.record or time.output_step


LONG = 1 << 20  # output points of a run that is carried out without holding its trajectories in memory


_KEPT = 1_000_000  # points of a grid that is kept in memory
_GRIDS: Memo[Grid] = Memo(16, lambda grid: grid[0].size < _KEPT)
_POINTS: Memo[np.ndarray] = Memo(16, lambda points: points.size < _KEPT)  # tables are known again by them


def grid_of(time: Time, metrics: Metrics, states: int, observers: int) -> Grid:
    """The finer of output and metric grid, from 0 on, and how many of its points make a step of each.

    Parameters
    ----------
    time, metrics
        The blocks, on the clock of the configuration.
    states, observers : int
        How many there are: what takes memory.

    Raises
    ------
    Problem
        When one grid is not a multiple of the other, a window lies outside of the run, or the output is larger than
        allowed.
    """
    return _GRIDS.get((time, metrics, states, observers), lambda: _grid(time, metrics, states, observers))


def even_grid_of(time: Time, metrics: Metrics, states: int, observers: int) -> EvenGrid:
    """The same grid, whose points are made when they are asked for; arguments and what is raised as of that."""
    end, record = time.from_zero.end, metric_step(time, metrics)
    fine = min(record, time.output_step)
    ratios = [round(step / fine) for step in (time.output_step, record)]
    for ratio, step in zip(ratios, (time.output_step, record), strict=True):
        if abs(ratio * fine - step) > 1e-6 * fine:
            raise Problem(
                ("metrics", "record"),
                f"record {record:g} and output_step {time.output_step:g}: one must be a multiple of the other",
            )
    count = points_up_to(time.start, time.end, fine)
    width = states + observers * (states * 2 + 8)  # states and estimates, before the exact size is known
    size = count * width * 8
    if size > time.max_memory:
        raise Problem(
            ("time", "output_step"),
            f"the output grid has {count:.4g} points, about {size / 2**30:.3g} GiB; "
            f"time.max_memory allows {time.max_memory / 2**30:.3g} GiB",
        )
    for path, step in ((("time", "output_step"), time.output_step), (("metrics", "record"), record)):
        if step > end * (1 + 1e-9) and points_up_to(time.start, time.end, step) < 2:
            raise Problem(path, f"{step:g} is longer than the run, {end:g}: shorten it")
    if metrics.window is not None or metrics.transient is not None:
        _check_windows(_kept_points(int(count), fine)[:: ratios[1]], fine, time, metrics)
    return EvenPoints(int(count), fine), ratios[0], ratios[1]


def _grid(time: Time, metrics: Metrics, states: int, observers: int) -> Grid:
    points, of_output, of_metrics = even_grid_of(time, metrics, states, observers)
    return _kept_points(points.size, points.step), of_output, of_metrics


def _kept_points(count: int, step: float) -> np.ndarray:
    """All of them, the same array for all who ask, where they are few."""
    return _POINTS.get((count, step), lambda: EvenPoints(count, step)[:])


def points_up_to(start: float, end: float, step: float) -> float:
    """How many points a grid has: one at its end counts whatever rounding takes off it.

    Far from 0, as in seconds since 1970, a length is the difference of numbers that are rounded by more than it is.
    """
    length, rounding = end - start, 1e-9 + 2 * np.spacing(max(abs(start), abs(end))) / step
    return float(np.floor(length / step * (1 + 1e-12) + rounding)) + 1


def _check_windows(measured: np.ndarray, fine: float, time: Time, metrics: Metrics) -> None:
    """The windows of the metrics hold some of their points, and do not reach outside of the run."""
    origin, end = time.start, time.from_zero.end
    for key in ("window", "transient"):
        window = getattr(metrics, key)
        if window is None:
            continue
        since = window[0] - origin, window[1] - origin
        slack = 1e-9 * fine + np.spacing(max(map(abs, window)))
        outside = since[0] < -slack or since[1] > end + slack
        if outside and key == "window":  # of the transient of a shortened run there may be less
            raise Problem(
                ("metrics", key),
                f"[{window[0]:g}, {window[1]:g}] reaches outside the run, which lasts from {origin:g} to {time.end:g}",
            )
        if measured[points_in(measured, window_since(window, origin))].size == 0:
            raise Problem(("metrics", key), f"no output point lies in [{window[0]:g}, {window[1]:g}]")
