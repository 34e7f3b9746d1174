"""What observers of a stream that step from sample to sample ask of the times between two samples."""

from __future__ import annotations

import numpy as np

from hgorun.errors import Problem
from hgorun.observers.base import AnySampled, SampledObserver, SampleSchedule
from hgorun.simulation.checks.jump_checks import check_schedule
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.symbolic.evaluate import along, compiled
from hgorun.symbolic.forms import Form

_STATED = 100  # times between samples that are looked at where they are stated


class Gaps:
    """What observers ask of each time between two samples, one after the other.

    Parameters
    ----------
    experiment : Experiment
    """

    def __init__(self, experiment: Experiment) -> None:
        self._origin, self._longest = experiment.origin, 0.0
        self._asking = asking_of_gaps(experiment)
        self._numbered = any(observer.asks_of_numbers for _, observer, _ in self._asking)

    def require(self, gap: float, number: int, t: float) -> None:
        """Refuse a gap after a sample of a number, which a sample at t ends.

        Raises
        ------
        ValueError
        """
        if not self._asking or (gap <= self._longest and not self._numbered):
            return
        schedule = SampleSchedule(np.array([gap]), None, (), number=number, recorded=True)
        for label, observer, form in self._asking:
            try:
                observer.check_samples(form, schedule)
            except Problem as problem:
                raise ValueError(f"the sample of t = {self._origin + t:.12g}: {label}: {problem.message}") from problem
        self._longest = max(self._longest, gap)


def asking_of_gaps(experiment: Experiment) -> list[tuple[str, AnySampled, Form]]:
    """Observers that may refuse a time between two samples, with their labels and forms."""
    of = [(d.label, d.observer, d.form) for d in experiment.designs.values()]
    return [(label, one, form) for label, one, form in of if isinstance(one, SampledObserver) and one.asks_of_gaps]


def require_stated(experiment: Experiment) -> None:
    """Refuse times between samples that are stated, before the first one comes.

    Raises
    ------
    Problem
    """
    first = experiment.stretches[0][0]
    if first.period is not None:
        gaps = np.full(_STATED, first.period)
    elif first.steps is not None:
        gaps = along(compiled(first.steps, "k"), np.arange(_STATED))
    else:
        return
    schedule = SampleSchedule(gaps, first.steps, first.paths["sampling"])
    for label, observer, form in asking_of_gaps(experiment):
        check_schedule(label, observer, form, schedule)
