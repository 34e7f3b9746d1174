"""The observers of an experiment as one system whose samples are not known before they come."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from hgorun.config.nearest import listed
from hgorun.engine.live import Live
from hgorun.engine.plan import Floats
from hgorun.errors import Problem
from hgorun.estimate.covariance import Covariance
from hgorun.estimate.refused import refuse, require_used
from hgorun.estimate.steps.again import again_of
from hgorun.estimate.steps.bound import beginning_of
from hgorun.estimate.steps.breaks import breaks_of
from hgorun.estimate.stream.beginning import Begun, numbers_at_start
from hgorun.estimate.stream.gaps import require_stated
from hgorun.measurement.late import Treatment
from hgorun.measurement.variants import HELD, SILENT
from hgorun.observers.base import CorrectedObserver, SampledObserver
from hgorun.observers.sample_times import BeginsWithASample
from hgorun.observers.treatment import treatment_of
from hgorun.simulation.checks.start import check_start
from hgorun.simulation.design.design import Design
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.first_step import nominal_step
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.simulation.system.structure import Structure, structure_of
from hgorun.simulation.system.truth import Recording
from hgorun.symbolic.evaluate import evaluate
from hgorun.symbolic.forms import Driven

LATE = 8  # samples of one output that may be on their way at once
TOGETHER = 4096  # samples in one native call
_MOST_OUTPUTS = 6  # whose every combination of heard and not heard is compiled
_ON_TIME = 1e-6  # of a step


def slot_of(output: int, late: int = 0) -> int:
    """The place of a sample: 0 of one that is known when it is taken, 1 to :data:`LATE` of those on their way."""
    return output * (LATE + 1) + late


@dataclass(frozen=True, eq=False, repr=False)
class LiveSystem:
    """The observers with their numbers, m of them.

    Attributes
    ----------
    experiment : Experiment
    structure : Structure
    p : ndarray, shape (parameters,)
    start : ndarray, shape (states,)
        All states of the observers.
    labels : tuple of str
    inputs, outputs : mapping of str to int
        The numbers of inputs that come with samples, and of outputs.
    corrections, steps : tuple of int
        Jumps of the system whenever something arrives, and from sample to sample.
    covariances : tuple of Covariance or None
    treatments : mapping of str to str
        What each observer does with late samples.
    regimes : mapping of tuple of bool to int
        By the outputs that have been heard, what the system is between the samples.
    step : float
        The longest.
    begin : tuple of ObserverBlock
        Observers with states that belong to the first sample.
    driven : tuple of str
        Labels of observers whose states at the start depend on inputs that come with the samples.
    timed : tuple of Design
        Observers that may refuse the times of samples.
    """

    experiment: Experiment
    structure: Structure
    p: Floats
    start: Floats
    labels: tuple[str, ...]
    inputs: Mapping[str, int]
    outputs: Mapping[str, int]
    corrections: tuple[int, ...]
    steps: tuple[int, ...]
    covariances: tuple[Covariance | None, ...]
    treatments: Mapping[str, Treatment]
    regimes: Mapping[tuple[bool, ...], int]
    step: float
    begin: tuple[ObserverBlock, ...]
    driven: tuple[str, ...]
    timed: tuple[Design, ...]

    @classmethod
    def of(cls, experiment: Experiment, inputs: tuple[str, ...]) -> LiveSystem:
        """Those of an experiment.

        Parameters
        ----------
        experiment : Experiment
        inputs : tuple of str
            Inputs that come with the samples.

        Raises
        ------
        Problem
            For what cannot be followed sample by sample.
        """
        _check(experiment, inputs)
        require_stated(experiment)
        plant = experiment.plant
        model, designs = plant.model, list(experiment.designs.values())
        outputs = {name: i for i, name in enumerate(model.outputs)}
        truth = Recording(plant.symbolic, tuple(i for i, name in enumerate(model.inputs) if name in inputs))
        variants = [tuple((what, 0) for what in row) for row in product((SILENT, HELD), repeat=len(outputs))]
        stretches = experiment.stretches
        structure = structure_of([truth], [designs], stretches, variants, plant.everything, innovations=True)
        require_used(model, truth.recorded, structure)
        driven = tuple(design.label for design in designs if inputs and isinstance(design.form, Driven))
        numbers = numbers_at_start(experiment, structure, truth.recorded, {}, driven)
        if not inputs:  # else nothing is known of them yet
            check_start(Begun(plant, experiment.time, structure, numbers))
        corrections = tuple(number for number, _, _ in structure.system.corrections)
        return cls(
            experiment=experiment,
            structure=structure,
            p=numbers.p,
            start=numbers.z0,
            labels=tuple(b.label for b in numbers.observers),
            inputs={name: i for i, name in enumerate(name for name in model.inputs if name in inputs)},
            outputs=outputs,
            corrections=corrections,
            steps=tuple(number for number in range(len(structure.system.jumps)) if number not in corrections),
            covariances=tuple(Covariance.of(experiment, structure, numbers.p, b) for b in numbers.observers),
            treatments={label: treatment_of(observer) for label, observer in experiment.observers.items()},
            regimes={row: number for number, row in enumerate(product((False, True), repeat=len(outputs)))},
            step=nominal_step(experiment),
            begin=tuple(b for b in numbers.observers if isinstance(b.observer, BeginsWithASample)),
            driven=driven,
            timed=tuple(d for d in designs if isinstance(d.observer, CorrectedObserver) and d.observer.asks_of_times),
        )

    def live(self) -> Live:
        """A run of it that begins at 0."""
        solver = self.experiment.blocks.solver
        program, start = (
            self.structure.program(solver.given_method),
            beginning_of(self.start, self.p, solver.divergence),
        )
        breaks, again = breaks_of(self.experiment, self.step), again_of(self.experiment, self.structure)
        return Live(program, start, 0.0, slot_of(len(self.outputs)), self.step, TOGETHER, breaks, again)

    def begun(self, t: float, z: Floats) -> None:
        """Let observers begin with a first sample at t, where it comes at another time than they expect.

        Parameters
        ----------
        t : float
        z : ndarray
            All states then: changed.
        """
        for block in self.begin:
            observer = block.observer
            assert isinstance(observer, BeginsWithASample)
            if abs(t - observer.begins) > _ON_TIME * self.step:
                xhat = block.states["xhat"].shaped(z[None])[0]
                for name, values in observer.begun(block.form, xhat).items():
                    place = block.states[name]
                    z[place.start : place.start + place.size] = place.numbers(values)

    def start_with(self, told: Mapping[int, float]) -> Floats:
        """All states at the start; NaN where they depend on inputs that have not been told.

        Parameters
        ----------
        told : mapping of int to float
            The inputs that are known by now, by their numbers among those that come with samples.

        Raises
        ------
        Problem
        """
        return numbers_at_start(self.experiment, self.structure, self._recorded, told, self.driven).z0

    def check_start_with(self, told: Mapping[int, float], w: Floats) -> None:
        """Refuse a start at which a right-hand side is not a number, as a file does.

        Parameters
        ----------
        told : mapping of int to float
            As in :meth:`start_with`.
        w : ndarray
            What is held at the start, the inputs among it.

        Raises
        ------
        Problem
        """
        experiment, held = self.experiment, self.structure.system.held
        numbers = numbers_at_start(experiment, self.structure, self._recorded, told, self.driven)
        lines = tuple((place, float(w[held.input(i)[0]]), 0.0) for i, place in enumerate(self._recorded))
        check_start(Begun(experiment.plant, experiment.time, self.structure, numbers, lines))

    @property
    def _recorded(self) -> tuple[int, ...]:
        """The inputs that come with samples, by their numbers among all inputs."""
        return tuple(self.experiment.plant.model.inputs.index(name) for name in self.inputs)

    @property
    def joint(self) -> bool:
        """Whether samples of several outputs that are taken at one time enter an observer together."""
        several = any(stop - first > 1 for _, first, stop in self.structure.system.corrections)
        return several or (bool(self.steps) and len(self.outputs) > 1)

    @property
    def stepping(self) -> str:
        """Labels of the observers that step from sample to sample."""
        observers = self.experiment.observers.items()
        return ", ".join(label for label, observer in observers if isinstance(observer, SampledObserver))

    @property
    def follows_states(self) -> bool:
        """Whether estimates follow from the states alone, and not from inputs that come with samples."""
        return all(one.places is not None or not one.function.size1_in(3) for one in self.structure.estimates)

    def estimates(self, live: Live) -> Iterator[tuple[str, Floats]]:
        """Every observer's label and its xhat, shape (n,)."""
        for label, readout in zip(self.labels, self.structure.estimates, strict=True):
            if readout.places is not None:
                yield label, live.z[readout.places]
            else:
                w = live.w if readout.function.size1_in(3) else np.zeros(0)
                yield label, evaluate(readout.function, np.array([live.t]), self.p, live.z, w)[0][0]

    def output(self, name: str) -> int:
        """The number of an output.

        Raises
        ------
        ValueError
        """
        if name not in self.outputs:
            hint = ""
            if name in self.experiment.plant.model.inputs:
                hint = f"; {name} is an input, given as u={{{name!r}: ...}}"
                hint += "" if name in self.inputs else f" where inputs=[{name!r}] says that it comes with samples"
            raise ValueError(f"no output is called {name!r}; there are {listed(self.outputs, name)}{hint}")
        return self.outputs[name]

    def input(self, name: str) -> int:
        """The number of an input that comes with samples.

        Raises
        ------
        ValueError
        """
        if name not in self.inputs:
            known = ", ".join(self.inputs) or "none"
            raise ValueError(f"the input {name!r} is not given with samples; those that are: {known}")
        return self.inputs[name]


def _check(experiment: Experiment, inputs: tuple[str, ...]) -> None:
    model = experiment.plant.model
    experiment.require_open("a stream is told its inputs, which no observer here decides")
    if experiment.adaptive:
        raise Problem(("solver", "rtol"), "a stream is followed with steps that are fixed: give step")
    refuse(experiment)
    if len(model.outputs) > _MOST_OUTPUTS:
        raise Problem(("plant",), f"a stream has at most {_MOST_OUTPUTS} outputs")
    unknown = [name for name in inputs if name not in model.inputs]
    if unknown:
        raise Problem(("plant", "inputs"), f"unknown input {unknown[0]!r}")
