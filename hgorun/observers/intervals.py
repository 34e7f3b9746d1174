"""How far apart samples are, for observers whose numbers follow from that."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hgorun.errors import Problem
from hgorun.symbolic.forms import Form
from hgorun.symbolic.sensors import Sensor

UNKNOWN = Sensor(None, None, None, why="nothing is known of its noise")


def mean_intervals(given: float | None, sensors: Sequence[Sensor], form: Form, key: str) -> np.ndarray:
    """The mean time between two samples of every output, shape (q,): as given by a key, or from the measurement.

    Raises
    ------
    Problem
        Where it does not follow.
    """
    return _between_samples(given, sensors, form, key, lambda sensor: sensor.interval)


def usual_periods(given: float | None, sensors: Sequence[Sensor], form: Form, key: str | None) -> np.ndarray:
    """The usual time between two samples of every output, shape (q,), which hardly changes where some are missing.

    Parameters
    ----------
    given, sensors, form, key
        As of :func:`mean_intervals`; without a key it follows from the measurement alone.

    Raises
    ------
    Problem
        Where it does not follow.
    """
    return _between_samples(given, sensors, form, key, lambda sensor: sensor.period)


def _between_samples(
    given: float | None,
    sensors: Sequence[Sensor],
    form: Form,
    key: str | None,
    measured: Callable[[Sensor], float | None],
) -> np.ndarray:
    found = []
    for name, sensor in zip(form.plant.outputs, sensors or (UNKNOWN,) * len(form.plant.outputs), strict=True):
        if sensor.continuous:
            raise Problem((), f"this needs sampled outputs, but {name} is continuous")
        interval = measured(sensor) if given is None else given
        if interval is None:
            if key is None:
                message = f"it takes samples of one period, and those of {name} come at times of their own: take ekf"
                raise Problem(("type",), message)
            raise Problem((key,), f"the mean time between samples of {name} is not known, or changes: give {key}")
        found.append(interval)
    return np.array(found)
