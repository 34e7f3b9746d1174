"""What can be refused of observers, and plants, that step from sample to sample, before the first step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hgorun.errors import Problem
from hgorun.measurement.channels import Channel
from hgorun.measurement.late import are_late, stepped_between
from hgorun.observers.base import AnySampled, SampledObserver, SampleSchedule
from hgorun.observers.together import not_beside
from hgorun.observers.treatment import treatment_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.truth import Recording
from hgorun.symbolic.forms import Form


def check_jumps(run: PreparedRun) -> None:
    """What is stepped at samples needs all outputs sampled, together and in time, but for those that are left out."""
    stepped = [("observers", b.label) for b in run.observers if isinstance(b.observer, SampledObserver)]
    if run.plant.block.discretise:
        stepped.insert(0, ("plant", "discretise"))
    if not stepped:
        return
    if run.closed and run.plant.block.discretise:
        message = "a plant that a controller drives is integrated; observers may step from sample to sample"
        raise Problem(("plant", "discretise"), message)
    for channel in run.channels:
        if any(s.continuous for s in channel.stretches):
            raise Problem(stepped[0], f"this needs sampled outputs, but {channel.name} is continuous")
    channels = run.channels
    if are_late(channels):
        _require_left_out(run)
        q = len(channels)
        first = run.heard.index(stepped_between(run.heard))
        channels = run.heard[first : first + q]
    _require_together(run, channels)
    samples = channels[0].samples
    _check_schedules(run, samples.arrival[samples.used])


def _require_left_out(run: PreparedRun) -> None:
    """Refuse what steps to late samples, too."""
    late = next(c.name for c in run.channels if c.samples.late)
    dropping = not run.closed and not run.plant.block.discretise
    if run.plant.block.discretise:
        raise Problem(("plant", "discretise"), _is_late(run, late, dropping))
    for b in run.observers:
        if isinstance(b.observer, SampledObserver) and not (dropping and treatment_of(b.observer) == "drop"):
            raise Problem(("observers", b.label), _is_late(run, late, dropping))


def _is_late(run: PreparedRun, late: str, dropping: bool) -> str:
    return f"this takes samples without delay, but {late} is late: {_instead(run, dropping)}"


def _instead(run: PreparedRun, dropping: bool) -> str:
    """What can be done where samples are late of which each is stepped from to the next."""
    if isinstance(run.structure.groups[0].truth, Recording):
        right = "leave late samples out (late: drop), or `available`, as if all samples had been known at once"
    else:
        right = "run it apart, without the delay" + (", or leave late samples out (late: drop)" if dropping else "")
    return f"{right}; observers that are corrected by samples, as ekf and impulsive, go back to late ones"


def _require_together(run: PreparedRun, channels: Sequence[Channel]) -> None:
    """Refuse samples of one output without one of every other."""
    first = channels[0]
    for channel in channels[1:]:
        samples = channel.samples
        if samples.identity != first.samples.identity and not np.array_equal(samples.arrival, first.samples.arrival):
            raise Problem(_label(run), _not_together(run, first, channel))


def _label(run: PreparedRun) -> tuple[str, ...]:
    """Of what is stepped, the first."""
    if run.plant.block.discretise:
        return "plant", "discretise"
    return "observers", next(b.label for b in run.observers if isinstance(b.observer, SampledObserver))


def _not_together(run: PreparedRun, first: Channel, channel: Channel) -> str:
    """Where samples of an output are not those of the first one."""
    one, other = ((c.name, np.sort(c.samples.arrival)) for c in (first, channel))
    recorded = isinstance(run.structure.groups[0].truth, Recording)
    right = "leave such rows out of the data" if recorded else "give all outputs one sampling"
    where = not_beside(one, other, run.origin)
    return f"this needs all outputs sampled at the same times, but {where}: {right}, or take ekf or impulsive_riccati"


def _check_schedules(run: PreparedRun, times: np.ndarray) -> None:
    """What each discrete-time observer asks of the times between samples."""
    first, *others = run.channels[0].stretches
    begin = float(times[0]) if times.size else 0.0
    recorded = isinstance(run.structure.groups[0].truth, Recording)
    steps = None if others else first.steps
    schedule = SampleSchedule(np.diff(times), steps, first.paths["sampling"], begin, recorded=recorded)
    for b in run.observers:
        if isinstance(b.observer, SampledObserver):
            check_schedule(b.label, b.observer, b.form, schedule)


def check_schedule(label: str, observer: AnySampled, form: Form, schedule: SampleSchedule) -> None:
    """Refuse times of samples that are not for an observer.

    Raises
    ------
    Problem
    """
    try:
        observer.check_samples(form, schedule)
    except Problem as problem:
        inside = problem.path[:1] != ("measurement",)
        path = ("observers", label, *problem.path) if inside else problem.path
        raise Problem(path, problem.message) from problem
