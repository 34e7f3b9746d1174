"""Where the first steps of an estimate end that are shorter than others, in a file as in a stream."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hgorun.engine.early import Early
from hgorun.measurement.channels import Channel
from hgorun.measurement.schedule import away_from, tolerances_of
from hgorun.pieces import distinct
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.first_step import first_moments
from hgorun.symbolic.evaluate import Floats


def early(experiment: Experiment, step: float) -> Early:
    """These times, whatever happens; none for most observers, and with a given step.

    Parameters
    ----------
    step : float
        The longest.
    """
    _, apart = tolerances_of(experiment.stretches, step)
    return Early(first_moments(experiment, step, apart) + experiment.time.start, apart)


def first_steps(experiment: Experiment, step: float, changes: Floats, channels: Sequence[Channel]) -> Floats:
    """The same in a run whose samples and changes of inputs are known: where none of these is.

    Parameters
    ----------
    step : float
        The longest.
    changes : ndarray
        When inputs change.
    channels : sequence of Channel
    """
    found = early(experiment, step)
    if not found.times.size:
        return found.times
    times = [changes, *(one.samples.taken for one in channels), *(one.samples.arrival for one in channels)]
    inside = found.times[found.times < experiment.time.end]
    return away_from(inside, distinct(np.concatenate(times)), found.apart)
