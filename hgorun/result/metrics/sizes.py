"""How large the error is: rmse, sup, peak."""

from __future__ import annotations

import numpy as np

from hgorun.result.metrics.base import Estimates, Metric, largest, metric


def _largest(estimates: Estimates) -> np.ndarray:
    return largest(estimates.size)


def _root_mean_square(estimates: Estimates) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(estimates.error**2, axis=0)))


RMSE = metric(
    Metric(
        name="rmse",
        meaning="root mean square of the error over the steady window",
        unit="state",
        measure=_root_mean_square,
        phrase="rms of ${}$",
        place=10,
    )
)
SUP = metric(
    Metric(
        name="sup",
        meaning="largest error in the steady window",
        unit="state",
        measure=_largest,
        phrase="largest $|{}|$",
        place=20,
    )
)
PEAK = metric(
    Metric(
        name="peak",
        meaning="largest error in the transient window",
        unit="state",
        measure=_largest,
        window="transient",
        phrase="peak of $|{}|$",
        place=30,
    )
)
