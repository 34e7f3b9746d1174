"""From an experiment to a run that is ready to be integrated: everything that is decided before the first step."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from hgorun.config.models import Time
from hgorun.errors import Problem
from hgorun.measurement.chance import Chance
from hgorun.measurement.channels import Channel, check_delays, find_channels
from hgorun.measurement.extremes import Unknown
from hgorun.measurement.late import Treatment, are_late, heard
from hgorun.measurement.long import AnySchedule, LongSchedule, is_long
from hgorun.measurement.noise import is_relative
from hgorun.measurement.schedule import Schedule, build_schedule
from hgorun.measurement.signals import extremes_of, kinks_of, signal_remarks, unknown_extremes
from hgorun.measurement.sizes import EVENT_BYTES
from hgorun.memo import Memo, same
from hgorun.observers.base import AnyObserver, CorrectedObserver, SampledObserver
from hgorun.observers.capabilities import Switching
from hgorun.observers.recalling import LAGS, RecallingObserver
from hgorun.observers.treatment import treatment_of
from hgorun.plants.build import BuiltPlant
from hgorun.result.data import DesignNumbers
from hgorun.simulation.checks import check_events, check_run
from hgorun.simulation.design import Design
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.first_step import nominal_step
from hgorun.simulation.loop import DrivenPlant
from hgorun.simulation.plant_alone import PlantRun, plant_extremes, plant_kinks, plant_remarks, plant_unknown
from hgorun.simulation.prepared import Numbers, PreparedRun
from hgorun.simulation.structure import Structure, parameter_values, structure_of
from hgorun.simulation.truth import SameTruth, SimulatedPlant, Truth

_EVENTS = 100_000  # of schedules that are kept in memory
_CHANNELS: Memo[list[Channel]] = Memo(16, lambda channels: not is_long(channels) and _events(channels) < _EVENTS)
_SCHEDULES: Memo[AnySchedule] = Memo(16, lambda schedule: isinstance(schedule, Schedule) and schedule.size < _EVENTS)
_TRUTHS: Memo[SimulatedPlant] = Memo(64)
_DRIVEN: Memo[DrivenPlant] = Memo(64)


def prepare(experiment: Experiment, design: DesignNumbers | None = None) -> PreparedRun:
    """Check all that can be checked without running: models, schedules, observers.

    What depends on the structure alone is built once for all experiments of that structure.

    Parameters
    ----------
    experiment : Experiment
    design : DesignNumbers, optional
        Of a result of the same experiment, in place of those that follow from it on this machine.

    Raises
    ------
    ConfigError
    """
    with experiment.located():
        _check_limits(experiment)
        run = _prepared(experiment, design)
        check_run(run)
    return run


def _check_limits(experiment: Experiment) -> None:
    for label, observer in experiment.observers.items():
        check_limit(experiment, label, observer)


def check_limit(experiment: Experiment, label: str, observer: AnyObserver) -> None:
    """What has no limit as the step falls cannot have its step found by error control.

    Raises
    ------
    Problem
    """
    if experiment.blocks.solver.controlled and isinstance(observer, Switching) and observer.switches:
        raise Problem(
            ("solver", "step"),
            f"observer {label} ({observer.type}) switches in every step and has no limit as steps get shorter, "
            "so that no error can be controlled: give a number, as in solver: {method: euler, step: 1e-4}",
        )


def _prepared(experiment: Experiment, design: DesignNumbers | None) -> PreparedRun:
    plant, time, stretches = experiment.plant, experiment.time, experiment.stretches
    _ = experiment.grid, experiment.forms  # what is wrong with them is said first
    step = nominal_step(experiment) if design is None else design.step
    sizes = _mean_squares(experiment, step)
    seed = experiment.blocks.seed
    chance = seed if any(s.by_chance for one in stretches for s in one) else None
    key = same(stretches), chance, None if sizes is None else tuple(sizes)
    channels = _CHANNELS.get(key, lambda: find_channels(stretches, plant.model.outputs, time, seed, sizes))
    smallest_delay, reach = _with_lags(experiment, step, *check_delays(channels))
    treatments = treatments_of(experiment, channels)
    schedule = schedule_of(experiment, channels, step, treatments=treatments)
    of_groups = in_groups(experiment, treatments)
    designs = [design for group in of_groups for design in group]
    keeps = any(isinstance(observer, SampledObserver) for observer in experiment.observers.values())
    truths = _truths(plant, treatments, keeps=keeps)
    structure = structure_of(truths, of_groups, stretches, schedule.variants, plant.everything)
    numbers = numbers_of(structure, plant, experiment, designs)
    return PreparedRun(
        experiment=experiment,
        structure=structure,
        numbers=numbers if design is None else _replaced(numbers, design),
        step=step,
        channels=channels,
        schedule=schedule,
        smallest_delay=smallest_delay,
        reach=reach,
        treatments=treatments,
        remarks=_remarks(experiment),
        unknown=_unknown(experiment),
    )


def _truths(plant: BuiltPlant, treatments: tuple[Treatment, ...], *, keeps: bool) -> list[Truth]:
    """What every group of observers observes; ``keeps`` as of :class:`~hgorun.simulation.loop.DrivenPlant`."""
    if plant.symbolic.controller is not None:  # the run with the true state, and a copy for each observer
        driven = _DRIVEN.get((plant.symbolic, keeps), lambda: DrivenPlant(plant.symbolic, keeps))
        return [driven] * (1 + len(treatments))
    stepped = plant.block.discretise == "euler"
    truth = _TRUTHS.get((plant.symbolic, stepped), lambda: SimulatedPlant(plant.symbolic, stepped))
    return [truth, *(SameTruth(truth, treatment == "replay") for treatment in treatments)]


def _with_lags(experiment: Experiment, step: float, smallest: float, reach: float) -> tuple[float, float]:
    """The smallest and the largest delay, those by which observers look back at themselves among them.

    Raises
    ------
    Problem
        Where one is shorter than steps that are given, and that other observers share.
    """
    for label, lags in lags_of(experiment).items():
        if experiment.given_step is not None and np.any(lags < step * (1 - 1e-9)):
            apart = f"its copies are {np.min(lags):.4g} apart, less than the step {step:g}"
            raise Problem(("observers", label, "m"), f"{apart}: give a shorter step, or fewer copies")
        smallest, reach = float(np.min(lags, initial=smallest)), float(np.max(lags, initial=reach))
    return smallest, reach


def lags_of(experiment: Experiment) -> dict[str, np.ndarray]:
    """By how much observers look back at signals of their own."""
    found = {}
    for label, design in experiment.designs.items():
        if isinstance(design.observer, RecallingObserver):
            found[label] = design.gains[LAGS]
    return found


def reseeded(runs: Sequence[PreparedRun], seed: int, chance: Chance) -> PreparedRun | None:
    """One of some runs with other random numbers; None where more than times and noise changes with them.

    All but its samples, its noise and its events is that of the run, also its experiment with the seed of that.

    Parameters
    ----------
    runs : sequence of PreparedRun
        Which differ in their seeds alone, and in what outputs are at some times because of them. The size of no noise
        is relative to the output.
    seed : int
    chance : Chance
        The random numbers of the seed.

    Raises
    ------
    Problem
        Where that cannot be carried out.
    """
    run, experiment = runs[0], runs[0].experiment
    outputs = experiment.plant.model.outputs
    channels = find_channels(experiment.stretches, outputs, experiment.time, seed, None, chance)
    if treatments_of(experiment, channels) != run.treatments:
        return None
    smallest_delay, reach = _with_lags(experiment, run.step, *check_delays(channels))
    schedule = schedule_of(experiment, channels, run.step, treatments=run.treatments)
    alike = next((one for one in runs if one.schedule.variants == schedule.variants), None)
    if alike is None:
        return None
    new = replace(alike, channels=channels, schedule=schedule, smallest_delay=smallest_delay, reach=reach)
    check_events(new)
    return new


def treatments_of(experiment: Experiment, channels: list[Channel]) -> tuple[Treatment, ...]:
    """What observers do with late samples beside the common innovation; nothing where no sample is late.

    In a closed loop what each of them does, one after the other: each drives a plant of its own.

    Raises
    ------
    Problem
        Where an observer cannot do what it is asked to.
    """
    found = {label: treatment_of(observer) for label, observer in experiment.observers.items()}
    late = are_late(channels)
    for label, treatment in found.items():
        observer = experiment.observers[label]
        if isinstance(observer, RecallingObserver) and observer.late is not None:
            raise Problem(("observers", label, "late"), "this observer crosses the delay itself: leave the key out")
        if isinstance(observer, SampledObserver) and observer.late is not None:
            raise Problem(("observers", label, "late"), "this observer takes samples without delay")
        if treatment == "innovation" and isinstance(observer, CorrectedObserver):
            message = f"{observer.type} is corrected by samples and has no innovation between them: replay or drop"
            raise Problem(("observers", label, "late"), message)
        continuous = [c for c in channels if any(s.continuous for s in c.stretches)]
        delayed = late or any(not s.undelayed for c in continuous for s in c.stretches)
        if treatment != "innovation" and observer.late is not None and continuous and delayed:
            message = f"{treatment} needs sampled outputs, but {continuous[0].name} is continuous"
            raise Problem(("observers", label, "late"), message)
    if experiment.closed:
        return _in_loops(experiment, found if late else dict.fromkeys(found, "innovation"))
    own_past = [label for label, lags in lags_of(experiment).items() if lags.size]
    if late and own_past and "replay" in found.values():
        other = next(label for label, treatment in found.items() if treatment == "replay")
        message = f"it looks back at its own past, and {other} goes back in time (late: replay): run them apart"
        raise Problem(("observers", own_past[0], "type"), message)
    known: tuple[Treatment, ...] = ("received", "drop", "replay")
    return tuple(treatment for treatment in known if late and treatment in found.values())


def _in_loops(experiment: Experiment, found: Mapping[str, Treatment]) -> tuple[Treatment, ...]:
    for label, treatment in found.items():
        if isinstance(experiment.observers[label], RecallingObserver):
            message = "its copies live in the past and need the inputs of then, which a controller does not keep"
            raise Problem(("observers", label, "type"), message)
        if treatment == "replay":
            raise Problem(
                ("observers", label, "late"),
                "replay takes an observer back to the time of a late sample, but not the plant, which its estimates "
                "have driven since then: innovation or drop",
            )
    return tuple(found.values())


def in_groups(experiment: Experiment, treatments: tuple[Treatment, ...]) -> list[list[Design]]:
    """The designs by what their observers do with late samples: the common innovation first."""
    designs = experiment.designs
    if experiment.closed:
        return [[], *([design] for design in designs.values())]
    if not treatments:
        return [list(designs.values())]
    of = {label: treatment_of(observer) for label, observer in experiment.observers.items()}
    return [[d for label, d in designs.items() if of[label] == one] for one in ("innovation", *treatments)]


def numbers_of(structure: Structure, plant: BuiltPlant, experiment: Experiment, designs: list[Design]) -> Numbers:
    """The numbers of an experiment for its structure."""
    blocks = tuple(block.of(design) for block, design in zip(structure.observers, designs, strict=True))
    has_alpha = structure.system.has_alpha
    own = {design.label: design.initial(plant.parameters, has_alpha=has_alpha) for design in designs}
    initial = [(group.truth.initial(plant), *(own[b.label] for b in group.observers)) for group in structure.groups]
    return Numbers(
        p=parameter_values(plant.everything, experiment.stretches, designs),
        z0=np.concatenate([*chain(*initial), np.zeros(int(len(structure.groups) > 1))]),
        observers=blocks,
    )


def _replaced(numbers: Numbers, design: DesignNumbers) -> Numbers:
    """Those of a result in place of the numbers that were computed here."""
    if design.parameters.shape != numbers.p.shape or design.start.shape != numbers.z0.shape:
        raise Problem((), "the design's numbers that are stored with it are not as many as it has")
    return replace(numbers, p=design.parameters, z0=design.start)


def _mean_squares(experiment: Experiment, step: float) -> np.ndarray | None:
    """Of the noise-free outputs, where the size of some noise is relative to them."""
    if not any(is_relative(stretch) for one in experiment.stretches for stretch in one):
        return None
    if experiment.closed:
        raise Problem(
            ("controller",), "snr_db is relative to the outputs, and every observer's plant has its own: give std"
        )
    if experiment.plant.block.discretise:
        raise Problem(("plant", "discretise"), "snr_db needs a plant in continuous time; give std")
    stiff = experiment.blocks.solver.alone_stiff
    alone = PlantRun(experiment.plant, experiment.time, step, experiment.origin, stiff=stiff)
    return alone.mean_squares()


_SHORTER = 1e-9  # adaptive steps may be so many times shorter than the nominal one


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


def _events(channels: list[Channel]) -> int:
    """How many samples there are of the output that has most of them."""
    return max(c.samples.size for c in channels)


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


_LEVELS = 4  # times that a kink comes back: by then it is one of a derivative of high order


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


def _remarks(experiment: Experiment) -> tuple[str, ...]:
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
    return tuple(dict.fromkeys([*sum(found, of_plant), *_never_held(experiment)])) + tuple(of_observers)


def _never_held(experiment: Experiment) -> list[str]:
    """Of observers that say what is held between samples, where there are none."""
    if any(not s.continuous for one in experiment.stretches for s in one):
        return []
    given = [label for label, observer in experiment.observers.items() if observer.hold is not None]
    return [
        f"observer {label}: hold is given, but all outputs are continuous, so that nothing is held" for label in given
    ]


def _unknown(experiment: Experiment) -> tuple[Unknown, ...]:
    """Functions of time in which an automatic step may miss something."""
    if not experiment.blocks.solver.controlled:
        return ()
    found = plant_unknown(experiment.plant, experiment.time, experiment.origin)
    for stretches in experiment.stretches:
        found += [one for s in stretches if s.continuous for one in unknown_extremes(s)]
    return tuple(found)
