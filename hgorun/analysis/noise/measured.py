"""The noise of a run's measurements, by comparison with the run without noise."""

from __future__ import annotations

import numpy as np

from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun


def noise_between(run: PreparedRun, result: Result, noise_free: Result) -> np.ndarray:
    """What noise adds to every measurement, shape (Nk, q); of angles without whole turns."""
    gaps = result.measurements.y - noise_free.measurements.y
    model = run.plant.model
    return np.column_stack([model.wrapped(i, gaps[:, i]) for i in range(gaps.shape[1])])
