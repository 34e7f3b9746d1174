"""A recording and the observers of it, ready to be carried out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from hgorun.config.models import Method
from hgorun.config.refusals import within_run
from hgorun.data.recording import FirstSamples
from hgorun.data.recording import Recording as Recorded
from hgorun.engine.again import Again
from hgorun.engine.memory import Start
from hgorun.engine.methods import METHODS
from hgorun.engine.plan import Plan
from hgorun.engine.program import Program
from hgorun.errors import ConfigError, Problem
from hgorun.estimate.covariance import Covariance
from hgorun.estimate.refused import refuse, require_apart, require_used
from hgorun.estimate.samples import Sampled, all_sampled, channel, recorded_inputs
from hgorun.estimate.steps.again import again_of
from hgorun.estimate.steps.bound import beginning_of, bound_with, known_at
from hgorun.estimate.steps.first_steps import first_steps
from hgorun.measurement.late import HeardOtherwise, heard
from hgorun.measurement.schedule import at_events, build_schedule, tolerances
from hgorun.observers.treatment import treatment_of
from hgorun.simulation.checks.checks import check_corrections, check_punctual
from hgorun.simulation.checks.jump_checks import check_jumps
from hgorun.simulation.checks.start import check_start
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.plant_alone import plant_kinks
from hgorun.simulation.preparation.first_step import nominal_step
from hgorun.simulation.preparation.other_faults import told_together
from hgorun.simulation.preparation.preparation import numbers_of
from hgorun.simulation.preparation.treatments import in_groups, treatments_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.structure import structure_of
from hgorun.simulation.system.truth import Recording, SameTruth, Truth
from hgorun.simulation.timeline.recorded_inputs import RecordedInputs
from hgorun.simulation.timeline.tables import build_plan
from hgorun.simulation.timeline.tabulated import Stretchwise
from hgorun.simulation.timeline.timeline import Stepping
from hgorun.symbolic.evaluate import Floats, evaluate


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PreparedEstimate:
    """All that is decided before the first step.

    Attributes
    ----------
    run : PreparedRun
        Experiment, equations, numbers and schedule; its times are counted from the start of the run.
    samples : tuple of Sampled
        Of every output.
    inputs : RecordedInputs, optional
        Those that are recorded.
    first_samples : int or "auto"
        How many of them the start is fitted to, of observers that have none of their own; 1: to none.
    """

    run: PreparedRun
    samples: tuple[Sampled, ...]
    inputs: RecordedInputs | None
    first_samples: FirstSamples = 1

    @property
    def experiment(self) -> Experiment:
        """Of which the observers are."""
        return self.run.experiment

    @property
    def slots(self) -> list[slice]:
        """Where among all samples those of each output are."""
        ends = np.cumsum([0, *(one.values.size for one in self.samples)]).tolist()
        return [slice(a, b) for a, b in pairwise(ends)]

    def treatment(self, j: int) -> str:
        """What observer j does with late samples."""
        return treatment_of(self.run.observers[j].observer)

    def group(self, j: int) -> int:
        """Which of the groups that hear late samples otherwise observer j belongs to; 0: samples as they come."""
        treatments = self.run.treatments
        return 1 + treatments.index(treatment) if (treatment := self.treatment(j)) in treatments else 0

    def own_slots(self, output: int, j: int) -> np.ndarray | slice:
        """Where observer j hears the samples of an output, (n_k,) of them; -1 for those that are left out for it."""
        channels = self.run.heard
        number = self.group(j) * len(self.samples) + output
        first = sum(c.samples.arrival.size for c in channels[:number])
        channel, count = channels[number], self.samples[output].values.size
        if not isinstance(channel, HeardOtherwise):
            return slice(first, first + count)
        found = np.full(count, -1)
        found[channel.which] = first + np.arange(channel.which.size)
        return found

    def used(self) -> np.ndarray:
        """Which samples each observer takes, but for outliers, shape (samples, m)."""
        columns = []
        for b in self.run.observers:
            treatment = treatment_of(b.observer)
            if treatment == "drop" and self.run.treatments:
                columns.append(np.concatenate([one.available <= one.taken for one in self.samples]))
            elif treatment == "replay" and self.run.treatments:
                columns.append(np.ones(sum(one.used.size for one in self.samples), dtype=bool))
            else:
                columns.append(np.concatenate([one.used for one in self.samples]))
        return (
            np.column_stack(columns) if columns else np.zeros((sum(o.used.size for o in self.samples), 0), dtype=bool)
        )

    @property
    def gated(self) -> bool:
        """Whether samples may be found to be outliers."""
        return any(one.gate is not None and one.values.size for one in self.samples)

    @property
    def late(self) -> bool:
        """Whether samples may have become known after they were taken."""
        return any(one.available is not one.taken for one in self.samples)

    @property
    def again(self) -> Again | None:
        """Whether observers that steps lose get shorter ones; None: steps are taken as they are."""
        return again_of(self.experiment, self.run.structure)

    def program(self) -> Program:
        """The native code."""
        return self.run.structure.program(self.method)

    @property
    def method(self) -> Method:
        """Of integration."""
        return self.run.solver.given_method

    def plan(
        self,
        grid: Floats,
        step: float,
        uneven: float | None = None,
        shared: Stretchwise | None = None,
        *,
        whole: bool = False,
    ) -> Plan:
        """The tables of a run, all at once or perhaps in parts; see :func:`build_plan`."""
        return build_plan(
            self.run.timeline_on(at_events(grid, self.run.schedule.events, self.tolerance)),
            self.run.structure.system,
            Stepping(longest=step, always_slope=bool(METHODS[self.method].error), uneven=uneven),
            inputs=self.inputs,
            samples=[one.values for one in self.samples],
            in_parts=not (self.gated or whole),
            shared=shared,
        )

    @property
    def tolerance(self) -> float:
        """How far apart events are one, and how much before one an output point is at it."""
        return tolerances(self.run.channels, self.run.step)[1]

    def start(self) -> Start:
        """Where it begins."""
        numbers = self.run.numbers
        return beginning_of(numbers.z0, numbers.p, self.run.solver.divergence)

    def bound(self, t: float) -> float:
        """Beyond that an observer is lost at a time, with the samples that have arrived before it."""
        known = [np.abs(one.values[one.available < t]) for one in self.samples]
        sizes = [float(np.max(part)) for part in known if part.size]
        return bound_with(self.run.solver.divergence, max([known_at(self.run.numbers.z0), *sizes]))

    def u(self, times: Floats) -> Floats:
        """The inputs at several times, shape (len(times), m)."""
        system, numbers = self.run.structure.system, self.run.numbers
        if self.inputs is not None and self.inputs.levels.shape[1] == len(self.run.plant.model.inputs):
            return self._shown_inputs.at(times)
        u = self.run.structure.inputs.along(times, numbers.p, np.zeros(system.states)).copy()
        if self.inputs is not None:
            u[:, self.recorded] = self._shown_inputs.at(times)
        return u

    def held(self, times: Floats) -> Floats | None:
        """The vector w as far as it says what the inputs are at several times; None where none is recorded."""
        if self.inputs is None:
            return None
        layout = self.run.structure.system.held
        w = np.zeros((times.size, layout.size))
        shown = self._shown_inputs
        for i, (values, slopes) in enumerate(zip(shown.at(times).T, shown.slopes_at(times).T, strict=True)):
            value, slope, since, _ = layout.input(i)
            w[:, value], w[:, slope], w[:, since] = values, slopes, times
        return w

    def outputs(self, times: Floats, x: Floats) -> Floats:
        """h(t, x, u), shape (len(times), q)."""
        model = self.run.plant.model
        if not times.size:
            return np.zeros((0, len(model.outputs)))
        return evaluate(model.output_function, times[:, None], x, self.u(times), self.run.plant.parameters)[0]

    def covariances(self) -> list[Covariance | None]:
        """Of every observer what it knows of its errors."""
        run = self.run
        return [Covariance.of(run.experiment, run.structure, run.numbers.p, b) for b in run.observers]

    @cached_property
    def _shown_inputs(self) -> RecordedInputs:
        """The recorded inputs, where there are some, as output points show them."""
        assert self.inputs is not None
        return self.inputs.shown_from(self.run.schedule.events, self.tolerance)

    @property
    def recorded(self) -> list[int]:
        """The numbers of the inputs that are recorded."""
        truth = self.run.structure.groups[0].truth
        assert isinstance(truth, Recording)
        return list(truth.recorded)


def prepare_estimate(experiment: Experiment, recording: Recorded) -> PreparedEstimate:
    """Check all that can be checked before the first step.

    Parameters
    ----------
    experiment : Experiment
        A whole one, see :func:`hgorun.estimate.completed.completed`.
    recording : Recording

    Raises
    ------
    ConfigError
    """
    with told_together(experiment, partial(_check_grid, experiment)):
        experiment.require_open("recorded data come of inputs that were applied, not of what is estimated here")
        if experiment.adaptive:
            message = "estimates of recorded data take steps that are fixed: give step, or neither"
            raise Problem(("solver", "rtol"), message)
        refuse(experiment)
        samples = tuple(all_sampled(recording, experiment))
        plant, time = experiment.plant, experiment.time
        channels = [channel(one, experiment, i) for i, one in enumerate(samples)]
        inputs = recorded_inputs(recording, plant.model.inputs, experiment.origin, time.end)
        _check_grid(experiment)
        _ = experiment.forms  # what is wrong with them is said first
        step = nominal_step(experiment)
        kinks = plant_kinks(plant, time, experiment.origin).times
        changes = np.zeros(0) if inputs is None else inputs.times
        looked_at = np.concatenate([changes, first_steps(experiment, step, changes, channels)])
        treatments = treatments_of(experiment, channels)
        schedule = build_schedule(heard(channels, treatments), time, kinks, step, looked_at)
        of_groups = in_groups(experiment, treatments)
        designs = [design for group in of_groups for design in group]
        recorded = tuple(i for i, name in enumerate(plant.model.inputs) if name in recording.inputs)
        truth = Recording(plant.symbolic, recorded)
        truths: list[Truth] = [truth, *(SameTruth(truth, treatment == "replay") for treatment in treatments)]
        stretches, variants, everything = experiment.stretches, schedule.variants, plant.everything
        structure = structure_of(truths, of_groups, stretches, variants, everything, innovations=True, variances=True)
        require_used(plant.model, recorded, structure)
        at_start = () if inputs is None else inputs.first(recorded)
        numbers = numbers_of(structure, plant, experiment, designs, at_start)
        run = PreparedRun(
            experiment=experiment,
            structure=structure,
            numbers=numbers,
            step=step,
            channels=channels,
            schedule=schedule,
            smallest_delay=np.inf,
            reach=0.0,
            treatments=treatments,
            recorded=at_start,
        )
        check_jumps(run)
        require_apart(experiment, samples)
        check_punctual(run)
        check_corrections(run)
        check_start(run)
        prepared = PreparedEstimate(run=run, samples=samples, inputs=inputs, first_samples=recording.first_samples)
    return prepared


def _check_grid(experiment: Experiment) -> None:
    """What is wrong with the output points is said; a block ``metrics`` has no use here, and is as a rule inherited."""
    try:
        _ = experiment.even_grid
    except ConfigError as error:
        if not within_run(error.key or "").startswith("metrics."):
            raise
        message = (
            f"{error.message}; estimates of recorded data have no metrics: leave the block out, or write "
            "`metrics: null` where it is inherited"
        )
        raise ConfigError(message, file=error.file, line=error.line, key=error.key) from None
