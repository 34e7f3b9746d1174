"""What can be refused of a prepared run before its first step."""

from __future__ import annotations

import numpy as np

from hgorun.engine.history_room import history_bytes, history_pieces
from hgorun.errors import Problem
from hgorun.measurement.channels import continuous_delays
from hgorun.measurement.samples import AnySamples
from hgorun.measurement.schedule import Schedule
from hgorun.measurement.signals import delay_range
from hgorun.observers.base import AnyObserver, CorrectedObserver, DecidedObserver
from hgorun.observers.hold import Shrinking
from hgorun.observers.stepped import SteppedObserver
from hgorun.observers.treatment import late_to, treatment_of, why_punctual
from hgorun.simulation.checks.jump_checks import check_jumps
from hgorun.simulation.checks.start import check_outputs, check_start
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.timeline.steps import counted_steps, steps_between

_COARSE = 0.01  # of a step: so far apart neighbouring numbers may be
_OVERLAP = 0.05  # of a step: delays shorter than that are followed inside the step


def check_run(run: PreparedRun) -> None:
    """Refuse a run that cannot be simulated.

    Raises
    ------
    Problem
    """
    _check_memory(run)
    check_steps(run, run.step, adaptive=run.adaptive)
    _check_clock(run)
    _check_samples(run)
    check_start(run)
    check_outputs(run)
    _check_noise(run)


def check_events(run: PreparedRun) -> None:
    """Refuse samples, noise or delays with which a run cannot be simulated.

    Raises
    ------
    Problem
    """
    check_steps(run, run.step, adaptive=run.adaptive)
    _check_samples(run)
    _check_noise(run)


def _check_samples(run: PreparedRun) -> None:
    """What observers and controllers ask of the samples."""
    check_jumps(run)
    _check_law(run)
    check_punctual(run)
    check_corrections(run)
    _check_decisions(run)
    check_holds(run)


def _check_noise(run: PreparedRun) -> None:
    """Noise that is not a number at some sample is reported before any run starts, but for a long one."""
    for channel in run.channels if isinstance(run.schedule, Schedule) else []:
        _ = channel.gain_and_bias


def check_punctual(run: PreparedRun) -> None:
    """Some observers take outputs without delay only; samples that they leave out, or go back to, are not late to them.

    Raises
    ------
    Problem
    """
    late = [c.name for c in run.channels if c.samples.late]
    continuous = [c.name for c in run.channels if any(s.continuous and not s.undelayed for s in c.stretches)]
    for b in run.observers:
        sampled = late if late_to(b.observer) else []
        for name in [*sampled, *continuous][:1]:
            why = why_punctual(b.observer, f"{name} is late", sampled=bool(sampled))
            if why is not None:
                raise Problem(("observers", b.label), why)


def _check_clock(run: PreparedRun) -> None:
    """Times must be told apart much finer than steps."""
    time = run.experiment.blocks.time
    key = "start" if abs(time.start) > abs(time.end) else "end"
    step = min(run.step, time.output_step)
    looked_at = [(run.time.end, step)]
    if run.origin:  # steps are counted from the start: where it lies matters to functions of the clock, and to files
        looked_at.append((getattr(time, key), step if _reads_the_clock(run) else time.output_step))
    for number, needed in looked_at:
        finest = float(np.spacing(abs(number)))
        if finest > _COARSE * needed:
            raise Problem(
                ("time", key),
                f"numbers as large as {number:g} are {finest:.1g} apart, too coarse for steps of {needed:.3g}: "
                "count time from a later origin",
            )


def _reads_the_clock(run: PreparedRun) -> bool:
    """Whether some function of the system depends on time itself."""
    return any(regime.flow.jac_sparsity(0, 0).nnz() for regime in run.structure.system.regimes)


def longest_step(run: PreparedRun, step: float, *, adaptive: bool = False) -> float:
    """The longest step: no longer than decisions allow, nor than the delays, unless these are very short.

    Parameters
    ----------
    step : float
        The nominal step.
    adaptive : bool
        Whether steps are controlled and only the delays limit them.
    """
    longest = min(np.inf if adaptive else step, _between_decisions(run)[0])
    return min(longest, run.smallest_delay) if run.smallest_delay > _OVERLAP * step else longest


def _between_decisions(run: PreparedRun) -> tuple[float, str]:
    """The longest step that the decisions of an observer allow, and which one's."""
    limits = [
        (b.observer.longest_step(b.form), b.label) for b in run.observers if isinstance(b.observer, DecidedObserver)
    ]
    return min(limits, default=(np.inf, ""))


def _check_decisions(run: PreparedRun) -> None:
    """A step that is given has to be short enough for decisions."""
    longest, label = _between_decisions(run)
    given = run.experiment.given_step
    if not run.adaptive and given is not None and given > longest * (1 + 1e-9):
        raise Problem(
            ("solver", "step"),
            f"observer {label} decides at the ends of steps, which must not be longer than {longest:.4g}: found "
            f"{given:g}",
        )


def check_steps(run: PreparedRun, step: float, *, adaptive: bool) -> None:
    """Refuse steps for which there is no time, or no memory for those that a continuous delay spans.

    Parameters
    ----------
    step : float
        The nominal step.
    adaptive : bool
        Whether steps are controlled.
    """
    longest = longest_step(run, step, adaptive=adaptive)
    if adaptive:
        counted_steps(run.schedule, run.solver.max_step or np.inf, "max_step")
    elif not run.structure.system.remembers:
        counted_steps(run.schedule, longest)
    if not run.structure.system.remembers:
        return
    steps = None if adaptive else steps_between(run.schedule, longest)
    events = run.schedule.events
    pieces = history_pieces(np.column_stack([events[:-1], events[1:]]), steps, run.reach)
    size = history_bytes(run.structure.system, pieces)
    if size > run.time.max_memory:
        late = max(continuous_delays(run.channels), key=lambda stretch: delay_range(stretch)[1], default=None)
        recalling = [("observers", b.label) for b in run.observers if b.recalled]
        raise Problem(
            recalling[0] if late is None else late.paths["delay"],
            f"with steps of {longest:.3g} the history of a delay of {run.reach:.3g} takes "
            f"{size / 2**30:.3g} GiB; time.max_memory allows {run.time.max_memory / 2**30:.3g} GiB",
        )


def _check_memory(run: PreparedRun) -> None:
    """The output must fit, now that its width is known."""
    states = run.structure.system.states
    size = run.grid.size * (states + 1) * 8
    if size > run.time.max_memory:
        raise Problem(
            ("time", "output_step"),
            f"{run.grid.size:.4g} output points of {states} states take "
            f"{size / 2**30:.3g} GiB; time.max_memory allows {run.time.max_memory / 2**30:.3g} GiB",
        )


def _check_law(run: PreparedRun) -> None:
    """A state that the law uses must be estimated, and an observer's own one be that of some observer."""
    law, controller = run.plant.symbolic.controller, run.experiment.controller
    if law is None or controller is None:
        return
    for b in run.observers:
        for name in b.observer.unestimated(b.form):
            if name in controller.seen():
                raise Problem(("observers", b.label), f"it does not estimate {name}, which the controller needs")
    for name in law.own:
        known = dict.fromkeys(own for b in run.observers for own in b.own_names)
        if run.observers and name not in known:
            raise Problem(
                ("controller", "truth", name),
                f"no observer has a state {name}; beside the estimates they have: {', '.join(known) or 'none'}",
            )


def check_corrections(run: PreparedRun) -> None:
    """What is corrected at samples needs all outputs sampled."""
    for b in run.observers:
        if isinstance(b.observer, CorrectedObserver):
            for channel in run.channels:
                continuous = [s for s in channel.stretches if s.continuous]
                if continuous and not isinstance(b.observer, SteppedObserver):
                    message = f"this needs sampled outputs, but {channel.name} is continuous"
                    raise Problem(("observers", b.label), message)
                if not all(s.undelayed for s in continuous):
                    message = (
                        "it measures a continuous output at the steps, as it is then: sample "
                        f"{channel.name}, which is late"
                    )
                    raise Problem(("observers", b.label), message)
            times = {c.name: np.sort(_corrected_at(b.observer, c.samples)) for c in run.channels}
            try:
                b.observer.check_times(b.form, times, run.origin)
            except Problem as problem:
                raise Problem(("observers", b.label, *problem.path), problem.message) from problem


def _corrected_at(observer: AnyObserver, samples: AnySamples) -> np.ndarray:
    """When the samples come that an observer takes, in its own time."""
    treatment = treatment_of(observer)
    if treatment == "drop" and samples.late:
        return samples.arrival[samples.taken >= samples.arrival]
    return samples.taken if treatment == "replay" else samples.arrival


def check_holds(run: PreparedRun) -> None:
    """What shrinks between samples needs samples: a continuous output that is late is not one."""
    for b in run.observers:
        if isinstance(b.observer.hold, Shrinking):
            for channel in run.channels:
                if any(s.continuous and not s.undelayed for s in channel.stretches):
                    message = f"shrink is for sampled outputs, but {channel.name} is continuous and late"
                    raise Problem(("observers", b.label, "hold"), message)
