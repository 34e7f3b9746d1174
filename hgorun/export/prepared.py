"""From a run to its observers as they are exported: with the steps of the run, or why an observer cannot be."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.config.nearest import listed, nearest
from hgorun.engine.early import NONE
from hgorun.engine.history_room import history_pieces
from hgorun.engine.methods import METHODS, Method
from hgorun.errors import ConfigError, Problem
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.export.equations import Equations, Output, equations_of, outputs_of
from hgorun.export.names import identifier
from hgorun.export.observer import Exported
from hgorun.export.refused import require_exportable
from hgorun.export.steps import Integrated, OfData, OfRun, Steps
from hgorun.measurement.schedule import Schedule
from hgorun.observers.base import (
    ContinuousObserver,
)
from hgorun.pieces import median
from hgorun.result.records.status import Verdict
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.truth import Recording

_OUTPUTS = 32


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What is to be exported of a run, and how.

    Attributes
    ----------
    late : float
        How late samples of any output may be known; those of an output with a longer delay in the configuration as
        late as there.
    inputs_given : bool
        Whether inputs are told to the observer, in place of the configuration's functions of time.
    steps : bool
        Whether it is integrated where it is exported to: otherwise any method will do.
    """

    late: float = 0.0
    inputs_given: bool = False
    steps: bool = True


def only(experiment: Experiment, labels: Collection[str]) -> Experiment:
    """The same experiment with the chosen observers alone, or with all of them where none is chosen.

    Steps, and with them the length of a history, follow from the observers of a run: from those that are exported.

    Raises
    ------
    ConfigError
        Where no observer is called so.
    """
    known = list(experiment.observers)
    for label in labels:
        if label not in known:
            near = nearest(label, known)
            raise ConfigError(f"--observer: no observer is called {label!r}.{near} Known: {listed(known, label)}")
    others = [label for label in known if labels and label not in labels]
    if not others or experiment.closed:  # a closed loop is refused as a whole
        return experiment
    return experiment.varied({f"observers.{label}": None for label in others})


def exported(run: PreparedRun, wanted: Wanted | None = None) -> list[Exported]:
    """The observers of a simulated run, ready to be written.

    Raises
    ------
    ConfigError
        When one of them cannot be exported; the message says why.
    """
    wanted = Wanted() if wanted is None else wanted
    with run.experiment.located():
        run.experiment.require_open("an exported observer is told its inputs, or computes them from the time")
    model = run.plant.model
    told = tuple(range(len(model.inputs))) if wanted.inputs_given else ()
    return _all(run, wanted, told, OfRun(run))


def exported_estimate(prepared: PreparedEstimate, wanted: Wanted | None = None) -> list[Exported]:
    """The observers of recorded data, ready to be written; inputs that are recorded are told to them.

    Raises
    ------
    ConfigError
        When one of them cannot be exported; the message says why.
    """
    run, wanted = prepared.run, Wanted() if wanted is None else wanted
    truth = run.structure.groups[0].truth
    assert isinstance(truth, Recording)
    told = tuple(range(len(run.plant.model.inputs))) if wanted.inputs_given else truth.recorded
    return _all(run, wanted, told, OfData(prepared))


def _all(run: PreparedRun, wanted: Wanted, told: tuple[int, ...], integrated: Integrated) -> list[Exported]:
    labels = _labels(run)
    with run.experiment.located():
        flows = any(isinstance(run.experiment.observers[label], ContinuousObserver) for label in labels)
        steps = integrated.steps if flows and wanted.steps else None

        def one(label: str) -> Exported:
            return _exported(run, label, steps, wanted, told, verdict=lambda: integrated.verdicts[label])

        return [_or_others(label, labels, one) for label in labels]


def _or_others(label: str, labels: Sequence[str], export: Callable[[str], Exported]) -> Exported:
    """An exported observer, or why there is none, and how to export those beside it for which there is one."""
    try:
        return export(label)
    except Problem as problem:
        others = [other for other in labels if other != label and _can(export, other)]
        if not others:
            raise
        chosen = " ".join(f"--observer {shlex.quote(other)}" for other in others)
        raise Problem(problem.path, f"{problem}; to export the others: {chosen}") from problem


def _can(export: Callable[[str], Exported], label: str) -> bool:
    try:
        export(label)
    except Problem:
        return False
    return True


def _labels(run: PreparedRun) -> list[str]:
    labels = list(run.experiment.observers)
    if not labels:
        raise ConfigError("there is no observer to export")
    if len(run.plant.model.outputs) > _OUTPUTS:
        raise ConfigError(f"an exported observer has at most {_OUTPUTS} outputs, a bit for each")
    taken: dict[str, str] = {}
    for label in labels:
        other = taken.setdefault(identifier(label).lower(), label)
        if other != label:
            raise ConfigError(
                f"observers {other!r} and {label!r} would be written to the same files; name one with --observer"
            )
    return labels


def _exported(
    run: PreparedRun,
    label: str,
    steps: Steps | None,
    wanted: Wanted,
    told: tuple[int, ...],
    verdict: Callable[[], Verdict],
) -> Exported:
    experiment, plant = run.experiment, run.plant
    design, path = experiment.designs[label], ("observers", label)
    require_exportable(run, label, wanted.late)
    flows = isinstance(design.observer, ContinuousObserver)
    lateness = [max(_lateness(run, i), wanted.late) for i in range(len(plant.model.outputs))]
    try:
        outputs = outputs_of(experiment.stretches, plant, [late > 0 for late in lateness])
    except ValueError as error:
        raise Problem(path, str(error)) from error
    found = equations_of(design, plant, outputs, run.origin, told=told)
    method, step, pieces = METHODS["rk4"], 1.0, 0
    if steps is not None and flows:
        method, step = METHODS[steps.method], steps.step
        pieces = _pieces(run, steps, outputs, max(lateness))
    assert isinstance(method, Method)
    return Exported(
        run=experiment.name,
        label=label,
        design=design,
        block=found.block,
        plant=plant,
        outputs=outputs,
        told=told,
        start=_start(run, label, found),
        begun=experiment.begun.get(label, {}),
        method=method,
        step=step,
        early=NONE if steps is None or not flows else steps.early,
        beside=_beside(experiment, label) if steps is not None else (),
        pieces=pieces,
        sides=bool(np.any(run.schedule.inward)),
        origin=run.origin,
        gap=run.longest_gap,
        usual_gap=_usual_gap(run),
        unit=experiment.blocks.time.unit,
        equations=found.flow,
        jump=found.jump,
        held=found.held,
        verdict=verdict,
    )


def _beside(experiment: Experiment, label: str) -> tuple[str, ...]:
    """The other observers with which an automatic step is shared."""
    flowing = [other for other, one in experiment.observers.items() if isinstance(one, ContinuousObserver)]
    return () if experiment.given_step is not None else tuple(other for other in flowing if other != label)


def _start(run: PreparedRun, label: str, found: Equations) -> np.ndarray:
    design = run.experiment.designs[label]
    return design.initial(run.plant, has_alpha="alpha" in found.block.states, recorded=run.recorded)


def _lateness(run: PreparedRun, output: int) -> float:
    """How late samples of an output are known at most; rounding of equal times is no lateness."""
    samples = run.channels[output].samples
    if samples.taken is samples.arrival or not samples.arrival.size:
        return 0.0
    late = float(np.max(samples.arrival - samples.taken))
    return late if late > 1e-12 * run.span else 0.0


def _usual_gap(run: PreparedRun) -> float:
    """The median of the times between events; those of a long run are alike."""
    schedule = run.schedule
    return median(np.diff(schedule.events)) if isinstance(schedule, Schedule) else run.longest_gap


def _pieces(run: PreparedRun, steps: Steps, outputs: tuple[Output, ...], lateness: float) -> int:
    """Steps of history that reach back far enough."""
    if not any(output.remembered for output in outputs):
        return 0
    for output in outputs:
        if output.delay is not None and run.smallest_delay < steps.step * (1 - 1e-9):
            raise Problem(
                ("solver", "step"),
                f"the delay of {output.name} falls below the step {steps.step:g}: it would look into the step that is "
                "being made; shorter steps can be exported",
            )
    plan = steps.plan().whole()
    counts = plan.counts[:, 2] - plan.counts[:, 1]
    return history_pieces(plan.spans[:, :2], counts, max(run.reach, lateness))
