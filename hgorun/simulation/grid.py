"""The points of a run at which there is output, and those that metrics are taken from."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from hgorun.config.models import Metrics, Time
from hgorun.errors import Problem
from hgorun.memo import Memo
from hgorun.result.windows import points_in

Grid: TypeAlias = tuple[np.ndarray, int, int]


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


def _grid(time: Time, metrics: Metrics, states: int, observers: int) -> Grid:
    end, record = time.from_zero.end, metric_step(time, metrics)
    fine = min(record, time.output_step)
    ratios = [round(step / fine) for step in (time.output_step, record)]
    for ratio, step in zip(ratios, (time.output_step, record), strict=True):
        if abs(ratio * fine - step) > 1e-6 * fine:
            raise Problem(
                ("metrics", "record"),
                f"record {record:g} and output_step {time.output_step:g}: one must be a multiple of the other",
            )
    count = points_up_to(end, fine)
    width = states + observers * (states * 2 + 8)  # states and estimates, before the exact size is known
    size = count * width * 8
    if size > time.max_memory:
        raise Problem(
            ("time", "output_step"),
            f"the output grid has {count:.4g} points, about {size / 2**30:.3g} GiB; "
            f"time.max_memory allows {time.max_memory / 2**30:.3g} GiB",
        )
    for path, step in ((("time", "output_step"), time.output_step), (("metrics", "record"), record)):
        if step > end * (1 + 1e-9):
            raise Problem(path, f"{step:g} is longer than the run, {end:g}: shorten it")
    points = _POINTS.get((int(count), fine), lambda: _points(int(count), fine))
    _check_windows(points[:: ratios[1]], fine, time, metrics)
    return points, ratios[0], ratios[1]


def points_up_to(end: float, step: float) -> float:
    """How many points a grid from 0 on has: one at its end counts whatever rounding takes off it."""
    rounding = 1e-9 + 2 * np.spacing(end) / step
    return float(np.floor(end / step * (1 + 1e-12) + rounding)) + 1


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
        if measured[points_in(measured, since)].size == 0:
            raise Problem(("metrics", key), f"no output point lies in [{window[0]:g}, {window[1]:g}]")


def _points(count: int, step: float) -> np.ndarray:
    """0, step, 2 step, ..., in place: there may be many."""
    points = np.arange(count, dtype=float)
    points *= step
    return points
