"""From an experiment to a run that is ready to be integrated: everything that is decided before the first step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import chain

import numpy as np

from hgorun.errors import Problem
from hgorun.measurement.chance import Chance
from hgorun.measurement.channels import Channel, check_delays, find_channels
from hgorun.measurement.late import Treatment
from hgorun.measurement.long import is_long
from hgorun.measurement.noise import is_relative
from hgorun.memo import Memo, same
from hgorun.observers.base import AnyObserver, SampledObserver
from hgorun.observers.capabilities import Switching
from hgorun.observers.stepped import SteppedObserver
from hgorun.plants.build import BuiltPlant
from hgorun.result.records.data import DesignNumbers
from hgorun.simulation.checks.checks import check_events, check_run
from hgorun.simulation.design.design import Design
from hgorun.simulation.design.first_inputs import Recorded
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.plant_alone import PlantRun
from hgorun.simulation.preparation.first_step import nominal_step
from hgorun.simulation.preparation.other_faults import check_grid, told_together
from hgorun.simulation.preparation.scheduling import lags_of, remarks, schedule_of, unknown
from hgorun.simulation.preparation.treatments import in_groups, treatments_of
from hgorun.simulation.prepared import Numbers, PreparedRun
from hgorun.simulation.system.loop import DrivenPlant
from hgorun.simulation.system.structure import Structure, parameter_values, structure_of
from hgorun.simulation.system.truth import SameTruth, SimulatedPlant, Truth

_EVENTS = 100_000  # of schedules that are kept in memory
_CHANNELS: Memo[list[Channel]] = Memo(16, lambda channels: not is_long(channels) and _events(channels) < _EVENTS)
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
    with told_together(experiment, partial(check_grid, experiment)):
        _check_limits(experiment)
        run = _prepared(experiment, design)
        check_run(run)
    return run


def _check_limits(experiment: Experiment) -> None:
    for label, observer in experiment.observers.items():
        check_limit(experiment, label, observer)
        if isinstance(observer, SteppedObserver) and experiment.given_step is None and not experiment.sampled():
            raise Problem(
                ("solver", "step"),
                f"observer {label} ({observer.type}) measures a continuous output at the ends of the solver's steps, "
                "which are its period: give a number, as in solver: {method: rk4, step: 0.01}",
            )


def check_limit(experiment: Experiment, label: str, observer: AnyObserver) -> None:
    """What has no limit as the step falls cannot have its step found by error control.

    The steps of a recursion of samples are the times between them, whatever the solver's are.

    Raises
    ------
    Problem
    """
    if experiment.blocks.solver.controlled and _has_no_limit(experiment, observer):
        raise Problem(
            ("solver", "step"),
            f"observer {label} ({observer.type}) switches in every step and has no limit as steps get shorter, "
            "so that no error can be controlled: give a number, as in solver: {method: euler, step: 1e-4}",
        )


def needs_given_steps(experiment: Experiment, observer: AnyObserver) -> bool:
    """Whether the numbers of an observer are those of the solver's steps, and have no limit or another one."""
    if isinstance(observer, SteppedObserver) and not experiment.sampled():
        return True
    return _has_no_limit(experiment, observer)


def _has_no_limit(experiment: Experiment, observer: AnyObserver) -> bool:
    """Whether it chatters as its steps let it, and they are the solver's."""
    if isinstance(observer, SteppedObserver) and experiment.sampled():
        return False
    return isinstance(observer, Switching) and observer.switches


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
        remarks=remarks(experiment),
        unknown=unknown(experiment),
    )


def _events(channels: list[Channel]) -> int:
    """How many samples there are of the output that has most of them."""
    return max(c.samples.size for c in channels)


def _truths(plant: BuiltPlant, treatments: tuple[Treatment, ...], *, keeps: bool) -> list[Truth]:
    """What every group of observers observes; ``keeps`` as of :class:`~hgorun.simulation.system.loop.DrivenPlant`."""
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


def numbers_of(
    structure: Structure,
    plant: BuiltPlant,
    experiment: Experiment,
    designs: list[Design],
    recorded: Recorded = (),
) -> Numbers:
    """The numbers of an experiment for its structure."""
    blocks = tuple(block.of(design) for block, design in zip(structure.observers, designs, strict=True))
    has_alpha = structure.system.has_alpha
    own = {design.label: design.initial(plant, has_alpha=has_alpha, recorded=recorded) for design in designs}
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
