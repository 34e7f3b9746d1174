"""When the samples of a recording come, as observers are told of it that are designed for that."""

from __future__ import annotations

import numpy as np

from hgorun.data.recording import Recording
from hgorun.data.times.time_steps import median_step

_EVEN = 1e-5  # of the usual step: what the rounding of time stamps may make of it


def mean_intervals(recording: Recording, start: float, end: float) -> dict[str, float]:
    """By output the mean time between the samples of a run, where samples are not evenly spaced.

    Gaps count, and so do samples of one time: it is how many samples there are in how much time that tells how much
    they say. Where the mean is the median but for the rounding of stamps, that is taken.

    Parameters
    ----------
    start, end : float
        Of the run.
    """
    found = {}
    for name, signal in recording.outputs.items():
        first, last = np.searchsorted(signal.taken, start), np.searchsorted(signal.taken, end, side="right")
        taken = signal.taken[first:last]
        span = float(taken[-1] - taken[0]) if taken.size else 0.0
        if span > 0:
            mean, usual = span / (taken.size - 1), median_step(signal.taken)
            if abs(mean - usual) > _EVEN * usual:
                found[name] = mean
    return found


def period_of(taken: np.ndarray, stated: object = None) -> float:
    """About how far apart samples are; any number for a single one.

    Parameters
    ----------
    taken : ndarray
    stated : object
        What the configuration says of it: taken if it differs by the rounding of stamps, as a stream takes it.
    """
    step = median_step(taken)
    if np.isnan(step):
        return 1.0
    if not isinstance(stated, (int, float)):
        return step
    rounding = 4 * float(np.spacing(np.max(np.abs(taken))))
    return float(stated) if abs(stated - step) <= rounding else step


def offset_of(taken: np.ndarray, start: float) -> dict[str, float]:
    """How long after the start the first sample is taken, where it is not the start."""
    k = int(np.searchsorted(taken, start))
    return {"offset": float(taken[k] - start)} if k < taken.size and taken[k] > start else {}
