"""Of what is measured in a run, what never reaches an observer: offsets, periods and delays longer than the run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hgorun.config.models import Time
from hgorun.errors import printable
from hgorun.measurement.availability import Stretch
from hgorun.measurement.blocks import Periodic, Times
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.symbolic.evaluate import along, compiled

_POINTS = 1001  # of a stretch at which a delay that is a function of time is looked at


def unheard(experiment: Experiment) -> Iterator[str]:
    """A remark for every output of which next to nothing arrives: a time in another unit than the run's, as a rule."""
    time, source = experiment.time, experiment.source
    unit = printable(experiment.blocks.time.unit)
    for name, stretches in zip(experiment.plant.model.outputs, experiment.stretches, strict=True):
        for path, told in (*_few_samples(name, stretches, time), *_nothing_new(stretches, time)):
            yield f"{source.told(path)}: {told}; times are in {unit}"


def _few_samples(name: str, stretches: Sequence[Stretch], time: Time) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Of an output that is sampled at most once."""
    if any(stretch.continuous for stretch in stretches):
        return
    run, found = time.end - time.start, [_first_two(stretch) for stretch in stretches]
    inside = [[t for t in of if s.start <= t <= s.end] for s, of in zip(stretches, found, strict=True)]
    count, last, path = sum(map(len, inside)), stretches[-1], stretches[-1].paths["sampling"]
    sampling = last.sampling
    if count == 0:
        where = (*path, "offset") if isinstance(sampling, Periodic) else path
        first = found[-1][0]
        yield (
            where,
            f"the first sample of {name} would come {first:g} after the start of the run, which ends at {run:g}",
        )
    elif count == 1 and isinstance(sampling, Periodic) and sampling.period > run:
        yield (
            (*path, "period"),
            f"{sampling.period:g} is longer than the run, {run:g}, so that there is no second sample",
        )
    elif count == 1:
        where = (*path, "period") if isinstance(sampling, Periodic) else path
        yield where, f"one sample of {name} arrives in the run, which ends at {run:g}, and no second one"


def _first_two(stretch: Stretch) -> list[float]:
    """When the first samples of a stretch would arrive: two, where there are so many."""
    sampling = stretch.sampling
    if isinstance(sampling, Periodic):
        first = stretch.start + sampling.offset
        return [first, first + sampling.period]
    if isinstance(sampling, Times):
        times = [float(t) - stretch.origin for t in sampling.times]
        if len(times) == 1:  # which was meant
            return times * 2
        return [t for t in times if stretch.start <= t <= stretch.end][:2]
    first_step = along(compiled(stretch.steps or "inf", "k"), np.zeros(1))
    return [stretch.start, stretch.start + float(first_step[0])]


def _nothing_new(stretches: Sequence[Stretch], time: Time) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Of an output that is always later than the run is old."""
    if all(stretch.undelayed for stretch in stretches):
        return
    newest = []
    for stretch in stretches:
        at = np.linspace(stretch.start, stretch.end, 1 if stretch.delay_is_constant else _POINTS)
        at[-1] = stretch.end
        newest.append(float(np.max(at - stretch.delay_at(at))))
    if max(newest) <= 0:
        last, run = stretches[-1], time.end - time.start
        delay = last.delay_at(np.zeros(1))[0]
        long = (
            f"{delay:g} is not shorter than the run, {run:g}"
            if last.delay_is_constant
            else "it is never shorter than the run so far"
        )
        yield last.paths["delay"], f"{long}, so that nothing arrives that was measured after the start"
