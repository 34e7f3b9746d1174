"""Windows of time on a grid."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hgorun.config.models import Metrics, Time

_SLACK = 1e-9  # of a grid step: so far outside of a window a point still belongs to it


def points_in(time: np.ndarray, window: tuple[float, float]) -> slice:
    """The points of a grid that lie in a window, its ends included in spite of rounding.

    Parameters
    ----------
    time : ndarray, shape (Nt,)
        Increasing; evenly spaced at the start.
    window : (from, to)
    """
    slack = 0.0
    if time.size > 1:  # far from 0 neighbouring numbers are further apart than that part of a step
        slack = _SLACK * float(time[1] - time[0]) + 2 * float(np.spacing(max(abs(time[0]), abs(time[-1]))))
    first = np.searchsorted(time, window[0] - slack, side="left")
    return slice(int(first), int(np.searchsorted(time, window[1] + slack, side="right")))


def window_since(window: tuple[float, float], origin: float) -> tuple[float, float]:
    """A window counted from some time on.

    Far from 0 its ends are rounded by more than a point of the grid may lie outside: it is wider by that.
    """
    if not origin:
        return window
    rounding = 2 * float(np.spacing(max(abs(origin), *map(abs, window))))
    return window[0] - origin - rounding, window[1] - origin + rounding


@dataclass(frozen=True, eq=False, repr=False)
class MetricSettings:
    """Where the metrics look, with nothing omitted.

    Attributes
    ----------
    steady, transient : (from, to)
    average : float
        Length of the moving mean that hf takes away.
    settling : float
        Settled below this part of the transient peak.
    """

    steady: tuple[float, float]
    transient: tuple[float, float]
    average: float
    settling: float

    @classmethod
    def of(cls, metrics: Metrics, time: Time) -> MetricSettings:
        """On the clock of the configuration; defaults: the last two thirds, the first third, 1 % of the run."""
        span = time.end - time.start
        third = time.start + span / 3
        return cls(
            metrics.window or (third, time.end),
            metrics.transient or (time.start, third),
            metrics.average or span / 100,
            metrics.settling,
        )

    def told(self) -> dict[str, Any]:
        """Everything by its name, for files."""
        return dict(vars(self))

    def since(self, origin: float) -> MetricSettings:
        """The same windows, counted from some time on."""
        if not origin:
            return self
        steady, transient = (window_since(window, origin) for window in (self.steady, self.transient))
        return replace(self, steady=steady, transient=transient)
