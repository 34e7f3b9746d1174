"""All that happens in a run, and what should be known of it although nothing is wrong."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import replace

import numpy as np

from hgorun.config.models import Time
from hgorun.errors import Problem, printable
from hgorun.measurement.blocks import Periodic
from hgorun.measurement.channels import Channel
from hgorun.measurement.extremes import Unknown
from hgorun.measurement.late import Treatment, heard
from hgorun.measurement.long import AnySchedule, LongSchedule, is_long
from hgorun.measurement.schedule import Schedule, build_schedule
from hgorun.measurement.signals import extremes_of, kinks_of, signal_remarks, unknown_extremes
from hgorun.measurement.sizes import EVENT_BYTES
from hgorun.memo import Memo
from hgorun.observers.recalling import LAGS, RecallingObserver
from hgorun.observers.sample_times import EvenSamples
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.plant_alone import plant_extremes, plant_kinks, plant_remarks, plant_unknown
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.remarks.signs import sign_remarks
from hgorun.simulation.remarks.unheard import unheard
from hgorun.simulation.remarks.units import unit_remarks
from hgorun.simulation.remarks.unstable import unstable

_EVENTS = 100_000  # of schedules that are kept in memory
_SCHEDULES: Memo[AnySchedule] = Memo(16, lambda schedule: isinstance(schedule, Schedule) and schedule.size < _EVENTS)
_SHORTER = 1e-9  # adaptive steps may be so many times shorter than the nominal one
_LEVELS = 4  # times that a kink comes back: by then it is one of a derivative of high order


def with_events(run: PreparedRun, times: np.ndarray) -> PreparedRun:
    """The same run with more times at which a step ends."""
    schedule = schedule_of(run.experiment, run.channels, run.step, times, treatments=run.treatments)
    return replace(run, schedule=schedule)


def schedule_of(
    experiment: Experiment,
    channels: list[Channel],
    step: float,
    more: np.ndarray | None = None,
    treatments: tuple[Treatment, ...] = (),
) -> AnySchedule:
    """All that happens in a run.

    Parameters
    ----------
    step : float
        The nominal one.
    more : ndarray, optional
        Times at which a step is to end besides.
    treatments : tuple of str
        What is done with late samples, beside the common innovation.
    """
    time = experiment.time
    found = [plant_kinks(experiment.plant, time, experiment.origin)]
    found += [kinks_of(s, time.max_memory) for channel in channels for s in channel.stretches if s.continuous]
    kinks = np.concatenate([irregular.times for irregular in found])
    looked_at = _extremes(experiment, channels) if experiment.blocks.solver.controlled else np.zeros(0)
    looked_at = np.concatenate([looked_at, _returns(experiment, channels)])
    if more is not None:
        looked_at = np.concatenate([looked_at, more])
    timings, changes = tuple(channel.timing for channel in channels), (kinks.tobytes(), looked_at.tobytes())
    short = _SHORTER * step if experiment.adaptive else step
    period = None if experiment.controller is None else experiment.controller.period
    # delays depend on the clock
    key: Hashable = timings, time, experiment.origin, changes, short, treatments, period

    def build() -> AnySchedule:
        if not treatments and period is None and is_long(channels):
            return LongSchedule(channels=channels, time=time, kinks=kinks, extremes=looked_at, step=short)
        instants = None if period is None else _instants(period, time)
        return build_schedule(heard(channels, treatments), time, kinks, short, looked_at, instants)

    return _SCHEDULES.get(key, build)


def _instants(period: float, time: Time) -> np.ndarray:
    """When a controller acts: from the start of the run on.

    Raises
    ------
    Problem
        Where there are more times than fit into memory.
    """
    count = np.floor((time.end - time.start) / period) + 1
    if count * EVENT_BYTES > time.max_memory:
        raise Problem(
            ("controller", "period"),
            f"{count:.4g} times at which the controller acts take {count * EVENT_BYTES / 2**30:.3g} GiB; "
            f"time.max_memory allows {time.max_memory / 2**30:.3g} GiB",
        )
    return np.asarray(time.start + period * np.arange(int(count)))


def lags_of(experiment: Experiment) -> dict[str, np.ndarray]:
    """By how much observers look back at signals of their own."""
    found = {}
    for label, design in experiment.designs.items():
        if isinstance(design.observer, RecallingObserver):
            found[label] = design.gains[LAGS]
    return found


def _returns(experiment: Experiment, channels: list[Channel]) -> np.ndarray:
    """When kinks of the start and of what is late come back to observers that look back at themselves."""
    lags = {float(lag) for of in lags_of(experiment).values() for lag in np.unique(of)}
    if not lags or experiment.given_step is not None:  # given steps are those of all observers, alone and together
        return np.zeros(0)
    late = {float(s.delay_at(np.zeros(1))[0]) for c in channels for s in c.stretches if s.delay_is_constant}
    times = [age + k * lag for lag in lags for age in {0.0, *late} for k in range(_LEVELS + 1)]
    return experiment.time.start + np.array([time for time in times if time > 0])


def _extremes(experiment: Experiment, channels: list[Channel]) -> np.ndarray:
    """Where functions of time have extremes: however narrow these are, error control sees a pulse at an event."""
    found = [plant_extremes(experiment.plant, experiment.time)]
    found += [extremes_of(s) for channel in channels for s in channel.stretches if s.continuous]
    return np.concatenate([irregular.times for irregular in found])


def remarks(experiment: Experiment) -> tuple[str, ...]:
    """What should be known of the run although nothing is wrong with the configuration."""
    time = experiment.time
    continuous = [s for one in experiment.stretches for s in one if s.continuous]
    found = [signal_remarks(s, time.max_memory) for s in continuous]
    of_plant = plant_remarks(experiment.plant, time, experiment.origin)
    of_observers = [
        f"observer {label}: {remark}"
        for label, design in experiment.designs.items()
        for remark in design.observer.remarks(design.form)
    ]
    of_all = dict.fromkeys(
        [*sum(found, of_plant), *_never_held(experiment), *unheard(experiment), *_swapped(experiment)]
    )
    return (
        *of_all,
        *unstable(experiment),
        *unit_remarks(experiment.source, experiment.plant.model),
        *of_observers,
        *_uneven(experiment),
        *_long_step(experiment),
        *sign_remarks(experiment.source),
    )


def _long_step(experiment: Experiment) -> Iterator[str]:
    """A step that was given and is longer than the run: in another unit of time, as a rule."""
    step, length = experiment.blocks.solver.step, experiment.time.end - experiment.time.start
    if isinstance(step, float) and step > length * (1 + 1e-9):
        where, unit = experiment.source.told(("solver", "step")), printable(experiment.blocks.time.unit)
        yield (
            f"{where}: {step:g} is longer than the run, {length:g}: steps end where output is written or a sample "
            f"arrives, and nothing else limits them; times are in {unit}"
        )


def _swapped(experiment: Experiment) -> list[str]:
    """Jitter that lets samples pass each other: two neighbours keep their order up to half a period."""
    sampled = [s.sampling for one in experiment.stretches for s in one if isinstance(s.sampling, Periodic)]
    return [
        f"measurement.sampling.jitter: {one.jitter:g} is more than half of the period {one.period:g}, so that samples "
        "change places; they are used in the order in which they arrive"
        for one in sampled
        if one.jitter > 0.5 * one.period
    ]


def _uneven(experiment: Experiment) -> list[str]:
    """Of implicit differentiators, whose quotients of higher order are those of even samples."""
    sampled = [s for one in experiment.stretches for s in one if not s.continuous]
    if all(s.regular is not None for s in sampled):
        return []
    return [
        f"observer {label}: samples are not even, so that its derivatives from the second on are not exact, even for "
        "polynomials"
        for label, observer in experiment.observers.items()
        if isinstance(observer, EvenSamples) and observer.even_only and experiment.plant.model.n > 2
    ]


def _never_held(experiment: Experiment) -> list[str]:
    """Of observers that say what is held between samples, where there are none."""
    if any(not s.continuous for one in experiment.stretches for s in one):
        return []
    given = [label for label, observer in experiment.observers.items() if observer.hold is not None]
    return [
        f"observer {label}: hold is given, but all outputs are continuous, so that nothing is held" for label in given
    ]


def unknown(experiment: Experiment) -> tuple[Unknown, ...]:
    """Functions of time in which an automatic step may miss something."""
    if not experiment.blocks.solver.controlled:
        return ()
    found = plant_unknown(experiment.plant, experiment.time, experiment.origin)
    for stretches in experiment.stretches:
        found += [one for s in stretches if s.continuous for one in unknown_extremes(s)]
    return tuple(found)
