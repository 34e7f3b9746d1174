"""From a run to its observers as they are exported: with the steps of the run, or why an observer cannot be."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.config.nearest import nearest
from hgorun.engine.memory import history_pieces
from hgorun.engine.methods import METHODS, Method
from hgorun.engine.plan import Plan
from hgorun.errors import ConfigError, Problem
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.export.equations import Equations, Output, equations_of, outputs_of
from hgorun.export.names import identifier
from hgorun.export.observer import Exported
from hgorun.observers.base import ContinuousObserver, CorrectedObserver, DecidedObserver
from hgorun.observers.capabilities import NotExported
from hgorun.observers.recalling import RecallingObserver
from hgorun.observers.stepped import SteppedObserver
from hgorun.observers.treatment import treatment_of
from hgorun.simulation.checks import longest_step
from hgorun.simulation.passes import Pass, as_given, plan_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.truth import Recording

_OUTPUTS = 32
_ADVICE = "give a fixed one, as in solver: {method: rk4, step: 0.01}"


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What is to be exported of a run, and how.

    Attributes
    ----------
    labels : tuple of str
        The observers; all of them where it is empty.
    late : float
        How late samples may be known; the longest delay of the configuration where that is more.
    inputs_given : bool
        Whether inputs are told to the observer, in place of the configuration's functions of time.
    steps : bool
        Whether it is integrated where it is exported to: otherwise any method will do.
    """

    labels: tuple[str, ...] = ()
    late: float = 0.0
    inputs_given: bool = False
    steps: bool = True


@dataclass(frozen=True, eq=False, repr=False)
class _Steps:
    """How a run is integrated.

    Attributes
    ----------
    method : str
    step : float
        The longest step.
    plan : callable
        The tables of the run with these steps.
    """

    method: str
    step: float
    plan: Callable[[], Plan]


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
    return _all(run, wanted, told, lambda: _steps(run))


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
    return _all(run, wanted, told, lambda: _steps_of_data(prepared))


def _all(run: PreparedRun, wanted: Wanted, told: tuple[int, ...], find: Callable[[], _Steps]) -> list[Exported]:
    labels = _labels(run, wanted.labels)
    with run.experiment.located():
        flows = any(isinstance(run.experiment.observers[label], ContinuousObserver) for label in labels)
        steps = find() if flows and wanted.steps else None
        return [
            _or_others(run, label, labels, lambda one: _exported(run, one, steps, wanted, told)) for label in labels
        ]


def _or_others(run: PreparedRun, label: str, labels: Sequence[str], export: Callable[[str], Exported]) -> Exported:
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


def _labels(run: PreparedRun, chosen: Iterable[str]) -> list[str]:
    known = list(run.experiment.observers)
    for label in chosen:
        if label not in known:
            near = nearest(label, known)
            raise ConfigError(f"--observer: no observer is called {label!r}.{near} Known: {', '.join(known)}")
    labels = [label for label in known if not chosen or label in chosen]
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


def _steps(run: PreparedRun) -> _Steps:
    """The method and the fixed step of a run: those of the configuration, or those that error control has found.

    Raises
    ------
    Problem
        Where steps are not fixed, or the method solves equations in each of them.
    """
    solver = run.solver
    _check_method(solver.method)
    if solver.adaptive:
        raise Problem(("solver", "rtol"), f"the number of steps between two samples has no bound with rtol; {_ADVICE}")
    how = as_given(run)
    if solver.controlled:
        from hgorun.simulation.control import controlled

        found = controlled(run).integration
        if found.step is None or found.method is None:
            message = (
                f"no fixed step reaches the accuracy {solver.accuracy:g} in this run (where a right-hand side "
                "jumps, as with sign, none may): give one, as in solver: {method: rk4, step: 0.01}; hgorun simulate "
                "--check-step tells its error"
            )
            raise Problem(("solver", "step"), message)
        how = Pass(method=found.method, step=found.step)  # type: ignore[arg-type]  # one of the methods
    return _Steps(how.method, longest_step(run, how.step), lambda: plan_of(run, how)[0])


def _steps_of_data(prepared: PreparedEstimate) -> _Steps:
    """Those of an estimate of recorded data."""
    solver, grid = prepared.run.solver, np.array([0.0, prepared.run.span])
    _check_method(solver.method)
    step = prepared.run.step
    if solver.controlled:
        from hgorun.estimate.carrying import carry_out

        step = carry_out(prepared, grid).step
    return _Steps(prepared.method, step, lambda: prepared.plan(grid, step))


def _check_method(method: str) -> None:
    if method == "rodas5p":
        raise Problem(
            ("solver", "method"),
            "rodas5p solves linear equations in every step; exported observers take explicit steps: choose euler, rk4 "
            "or dopri5",
        )


def _exported(run: PreparedRun, label: str, steps: _Steps | None, wanted: Wanted, told: tuple[int, ...]) -> Exported:
    experiment, plant = run.experiment, run.plant
    design = experiment.designs[label]
    path = "observers", label
    if treatment_of(design.observer) in run.treatments:
        raise Problem(
            (*path, "late"),
            "exported code takes late samples into the innovation or not at all: it does not go back to the time of a "
            f"sample, and leaves none out; {_without_lateness(run, label)}",
        )
    if isinstance(design.observer, NotExported):
        raise Problem((*path, "type"), design.observer.not_exported)
    steps_alone = isinstance(design.observer, SteppedObserver) and experiment.sampled()
    if isinstance(design.observer, DecidedObserver) and not steps_alone:
        raise Problem(
            (*path, "type"),
            f"{design.observer.type} decides at the ends of the solver's steps, and exported code only follows the "
            "flow and takes samples in: there is no place in it for decisions",
        )
    if isinstance(design.observer, RecallingObserver):
        raise Problem((*path, "type"), "it looks back at its own past, which is kept in simulations alone")
    flows = isinstance(design.observer, ContinuousObserver)
    compares = flows and not isinstance(design.observer, CorrectedObserver)
    lateness = [max(_lateness(run, i), wanted.late if compares else 0.0) for i in range(len(plant.model.outputs))]
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
        method=method,
        step=step,
        pieces=pieces,
        sides=bool(np.any(run.schedule.inward)),
        origin=run.origin,
        gap=run.longest_gap,
        unit=experiment.blocks.time.unit,
        equations=found.flow,
        jump=found.jump,
        held=found.held,
    )


def _without_lateness(run: PreparedRun, label: str) -> str:
    """What to change for an observer that goes back to late samples."""
    data = run.experiment.blocks.data
    recorded = {} if data is None else data.outputs
    keys = [f"data.outputs.{name}.available" for name, one in recorded.items() if one.available is not None]
    said = f"take {' and '.join(keys)} out" if keys else "leave measurement.delay out"
    corrected = isinstance(run.experiment.observers[label], CorrectedObserver)
    return said if corrected else f"say `late: innovation`, or {said}"


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


def _pieces(run: PreparedRun, steps: _Steps, outputs: tuple[Output, ...], lateness: float) -> int:
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
