"""How long the transient lasts."""

from __future__ import annotations

import numpy as np

from hgorun.result.metrics.base import Estimates, Metric, largest, metric

_DEVIATIONS = 5.0  # of noise, that it hardly exceeds


def _settling(estimates: Estimates) -> np.ndarray:
    """The last time at which |e| exceeds a part of its transient peak; the start where it never does."""
    transient = estimates.within("transient").size
    if not len(transient):
        return np.full(estimates.size.shape[1:], estimates.time[0])
    above = estimates.size > estimates.settings.settling * largest(transient)
    last = len(above) - 1 - np.argmax(above[::-1], axis=0)  # the last point, too, where none is above
    ever = np.take_along_axis(above, last[None], axis=0)[0]
    return np.asarray(np.where(ever, estimates.time[last], estimates.time[0]))


SETTLING = metric(
    Metric(
        name="settling",
        meaning="last time at which the error exceeds 5 % (metrics.settling) of its transient peak; never if it still "
        "does at the end",
        unit="time",
        moment=True,
        measure=_settling,
        window="run",
        phrase="settling time of ${}$",
        place=40,
        setting="settling",
        told=lambda part, _: f"{100 * part:g} % of peak",
    )
)


def lifted_by_noise(sup: np.ndarray, fast: np.ndarray, peak: np.ndarray, part: float) -> np.ndarray:
    """Whether noise again and again lifts the error above the part of its peak that it has to settle below.

    Then the last time above it is a chance of the last samples. That is so where the error exceeds that part in the
    steady window and five standard deviations of its fast part (hf) do; a slow decay has next to no fast part.
    """
    return np.asarray(np.isfinite(sup) & (np.minimum(sup, _DEVIATIONS * fast) > part * peak))
