"""How far the plant that an observer drives is from the one that the true state drives."""

from __future__ import annotations

import numpy as np

from hgorun.result.metrics.base import Estimates, Metric, largest, metric


def _recovery(estimates: Estimates) -> np.ndarray:
    assert estimates.reference is not None
    return largest(np.abs(estimates.x - estimates.reference))


RECOVERY = metric(
    Metric(
        name="recovery",
        meaning="largest difference between the driven plant and the one that the true state drives",
        unit="state",
        measure=_recovery,
        window="run",
        phrase="recovery error of ${}$",
        place=70,
        closed=True,
    )
)
