"""A log of very many samples as stretches, each of which is a short recording of its own."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hgorun.config.models import Time
from hgorun.data.faults import faults
from hgorun.data.recording import InputSignal, Recording
from hgorun.engine.moments import ROUNDING, SNAP
from hgorun.estimate.prepared import PreparedEstimate, prepare_estimate
from hgorun.estimate.samples import Sampled, channel, recorded_inputs, rounding_of
from hgorun.estimate.scores.output_points import OutputPoints
from hgorun.measurement.channels import Channel, HeardBefore
from hgorun.measurement.samples import Samples
from hgorun.measurement.schedule import Schedule, build_schedule, kinds_of, tolerances, variants_of
from hgorun.observers.base import CorrectedObserver, SampledObserver
from hgorun.observers.covariance import KnownCovariance
from hgorun.pieces import ascending
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.plant_alone import plant_kinks
from hgorun.simulation.system.structure import structure_of
from hgorun.simulation.timeline.steps import count_steps
from hgorun.symbolic.evaluate import Floats

LONG = 1 << 20  # samples and changes of inputs of a log that is gone through stretch by stretch
_STRETCH = 1 << 16  # samples in a stretch, of the output that has most
_APART = 1e-6  # of the time between samples: what is closer to the end of a stretch than that belongs to the next one
_TRIES = 1000  # samples at which a stretch could end


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Stretch:
    """A part of a run.

    Attributes
    ----------
    start, end : float
        Its own first and last event; what happens at the last one belongs to the next stretch, where there is one.
    until : float
        Output points from here on belong to the next stretch.
    prepared : PreparedEstimate
        What is carried out.
    """

    start: float
    end: float
    until: float
    prepared: PreparedEstimate


class Stretches:
    """The stretches of a log whose samples are known when they are taken.

    Parameters
    ----------
    experiment : Experiment
    recording : Recording
        With :func:`is_plain`.

    Attributes
    ----------
    samples : list of Sampled
        All of every output.
    stamps : list of ndarray
        When they were taken, on the clock of the data.
    first : PreparedEstimate
        The first stretch, of which all checks are made.
    """

    def __init__(self, experiment: Experiment, recording: Recording) -> None:
        self._experiment, self._recording = experiment, recording
        self._end = experiment.time.end
        self.samples, self.stamps = _all_samples(experiment, recording)
        self._kinks = plant_kinks(experiment.plant, experiment.time, experiment.origin).times
        self._ends = self._find_ends()
        cut = _first_part(experiment, recording, self._ends[0])
        self.first = prepare_estimate(experiment, cut)
        self._channels: dict[int, Channel] = {}  # those of the last stretch, of outputs that had been heard before
        self._before: Schedule | None = None

    def __iter__(self) -> Iterator[Stretch]:
        start = 0.0
        for end in self._ends:
            yield self._stretch(start, end)
            start = end

    def _find_ends(self) -> list[float]:
        """Samples before which nothing happens for a while, and the end of the run."""
        most = max(self.samples, key=lambda one: one.taken.size).taken
        origin = self._experiment.origin
        others = [self._kinks, *(one.taken for one in self.samples)]
        inputs = [one.times for one in self._recording.inputs.values()]
        ends, at = [], _STRETCH
        margin = _APART * (self._end / most.size)
        while at < most.size - 1:
            for k in range(at, min(at + _TRIES, most.size - 1)):
                t = float(most[k])
                if all(_free_before(of, t, margin) for of in others) and all(
                    _free_before(of, t, margin, origin) for of in inputs
                ):
                    ends.append(t)
                    at = k
                    break
            at += _STRETCH
        return [*ends, self._end]

    def _stretch(self, start: float, end: float) -> Stretch:
        experiment, first = self._experiment, self.first
        origin, last = experiment.origin, end == self._end
        samples, channels = [], []
        known: dict[int, tuple[int, int, Floats]] = {}  # by the clocks that outputs share
        for i, one in enumerate(self.samples):
            if id(one.taken) not in known:
                a = int(np.searchsorted(one.taken, start, side="left")) if start > 0 else 0
                b = one.taken.size if last else int(np.searchsorted(one.taken, end, side="left"))
                known[id(one.taken)] = a, b, one.taken[a:b]
            a, b, taken = known[id(one.taken)]
            some = replace(one, taken=taken, available=taken, values=one.values[a:b], used=one.used[a:b])
            samples.append(some)
            channels.append(self._channel(some, i, heard=a > 0))
        recording, since = _inputs_from(self._recording, origin, start, end)
        inputs = recorded_inputs(recording, experiment.plant.model.inputs, origin, end, since, last=last)
        time = experiment.time.model_copy(update={"start": start, "end": end})
        kinks = self._kinks[(self._kinks >= start) & (self._kinks <= end)]
        changes = np.zeros(0) if inputs is None else inputs.times
        schedule = self._at_samples(channels, time, kinks, changes)
        if schedule is None:
            schedule = build_schedule(channels, time, kinks, first.run.step, changes)
        structure = first.run.structure
        if schedule.variants != first.run.schedule.variants:
            structure = structure_of(
                [group.truth for group in structure.groups],
                [list(experiment.designs.values())],
                experiment.stretches,
                schedule.variants,
                experiment.plant.everything,
                innovations=True,
            )
        run = replace(first.run, structure=structure, channels=channels, schedule=schedule)
        prepared = PreparedEstimate(run=run, samples=tuple(samples), inputs=inputs)
        return Stretch(start=start, end=end, until=np.inf if last else end, prepared=prepared)

    def _at_samples(self, channels: Sequence[Channel], time: Time, kinks: Floats, changes: Floats) -> Schedule | None:
        """The schedule where all happens when all outputs are measured, as in a log of one clock; None elsewhere."""
        taken = channels[0].samples.taken
        if kinks.size or taken.size < 2 or taken[0] != time.start or taken[-1] >= time.end:
            return None
        sampled = all(len(one.stretches) == 1 and not one.stretches[0].continuous for one in channels)
        if not sampled or any(one.samples.taken is not taken for one in channels):
            return None
        if changes.size and not np.array_equal(changes, taken):
            return None
        events = np.append(taken, time.end)
        _, tolerance = tolerances(channels, self.first.run.step)
        if not np.all(np.diff(events) > tolerance):
            return None
        system = self.first.run.structure.system
        heard = all(isinstance(one, HeardBefore) for one in channels)
        by_number = heard and not (system.stepped or system.corrections or system.acting)  # and not by times between
        alike = (taken.size, changes.size) if by_number else None
        if self._before is not None and alike is not None and alike == self._before.alike:
            schedule = replace(self._before, events=events)
        else:
            variants, _ = variants_of(kinds_of(channels, events[:2]))
            none, same = np.broadcast_to(0.0, events.shape), np.broadcast_to(np.int64(0), taken.shape)
            schedule = Schedule(events=events, inward=none, variants=variants, variant=same, alike=alike)
        self._before = schedule
        return schedule

    def _channel(self, samples: Sampled, output: int, *, heard: bool) -> Channel:
        """An output in a stretch; that of the one before at other times, where there are as many samples."""
        before = self._channels.get(output)
        if (
            heard
            and before is not None
            and isinstance(known := before.samples, Samples)
            and known.size == samples.taken.size
        ):
            made = replace(before, samples=replace(known, arrival=samples.available, taken=samples.taken))
        else:
            made = channel(samples, self._experiment, output, heard=heard)
        if heard:
            self._channels[output] = made
        return made


def is_plain(experiment: Experiment, recording: Recording) -> bool:
    """Whether a stretch of a log follows from what is held at its start, and nothing is told of a sample but once."""
    outputs = recording.outputs.values()
    clocks = {id(one.taken): one.taken for one in outputs}.values()  # that outputs share
    punctual = all(one.available is one.taken for one in outputs)
    in_order = punctual and all(faults.ascending(taken) or ascending(taken, strictly=False) for taken in clocks)
    blocks = experiment.observers.values()
    simple = not any(isinstance(o, SampledObserver | CorrectedObserver | KnownCovariance) for o in blocks)
    return in_order and simple and bool(blocks) and not any(one.gate is not None for one in outputs)


def count_of(recording: Recording) -> int:
    """Samples of all outputs, and changes of inputs."""
    outputs = (one.taken.size for one in recording.outputs.values())
    return sum(outputs) + sum(one.times.size for one in recording.inputs.values())


def points_before(grid: Floats | OutputPoints, stretch: Stretch, step: float) -> int:
    """How many points of a grid lie before the end of a stretch, as the engine has it."""
    if not np.isfinite(stretch.until):
        return grid.size
    before, end = stretch.prepared.run.schedule.events[-2:]
    h = (end - before) / float(count_steps(np.array([end - before]), step)[0])
    until = end - max(SNAP * h + ROUNDING * end, stretch.prepared.tolerance)
    return grid.before(until) if isinstance(grid, OutputPoints) else int(np.searchsorted(grid, until, side="left"))


def _free_before(times: Floats, t: float, margin: float, origin: float = 0.0) -> bool:
    """Whether none of some times, less an origin, lies just before another one."""
    return len({bisect_left(times, at, key=lambda time: time - origin) for at in (t, t - margin)}) == 1


def _all_samples(experiment: Experiment, recording: Recording) -> tuple[list[Sampled], list[np.ndarray]]:
    """As :func:`hgorun.estimate.samples.all_sampled`, of samples that are in order; and the times in the log.

    Few copies are made.
    """
    origin, end = experiment.origin, experiment.time.end
    slack = rounding_of(origin, end)
    known: dict[int, tuple[slice, Floats]] = {}
    found, stamps = [], []
    for name in experiment.plant.model.outputs:
        signal = recording.outputs[name]
        if id(signal.taken) not in known:
            taken = signal.taken - origin if origin else signal.taken
            ends = np.searchsorted(taken, [-slack, np.nextafter(end + slack, np.inf)]).tolist()
            inside = slice(*ends)
            taken = taken[inside]
            if taken.size and not (taken[0] >= 0.0 and taken[-1] <= end):
                taken = np.clip(taken, 0.0, end)
            known[id(signal.taken)] = inside, taken
        inside, taken = known[id(signal.taken)]
        used = np.broadcast_to(np.True_, taken.shape)
        found.append(Sampled(name, taken, taken, signal.values[inside], used, signal.std, signal.gate))
        stamps.append(signal.taken[inside])
    return found, stamps


def _first_part(experiment: Experiment, recording: Recording, end: float) -> Recording:
    """The recording up to a time, with what comes just behind it."""
    until = experiment.origin + end
    outputs = {}
    for name, one in recording.outputs.items():
        some = slice(0, max(1, int(np.searchsorted(one.taken, until, side="right"))))
        taken = one.taken[some]
        outputs[name] = replace(
            one,
            taken=taken,
            available=taken,
            values=one.values[some],
            lines=one.lines[some],
            part=one.part[some],
        )
    inputs, _ = _inputs_from(recording, experiment.origin, 0.0, end)
    return replace(recording, outputs=outputs, inputs=inputs.inputs)


def _inputs_from(recording: Recording, origin: float, start: float, end: float) -> tuple[Recording, float]:
    """The recording with what its inputs are in a stretch, and when the line begins that holds at its start."""
    inputs: dict[str, InputSignal] = {}
    since = 0.0
    for name, one in recording.inputs.items():
        # their times are compared as they count from the start: the sum of start and origin is rounded
        first, stop = (bisect_right(one.times, t, key=lambda time: time - origin) for t in (start, end))
        if first:
            since = max(since, float(one.times[first - 1] - origin))
        some = slice(max(first - 4, 0), stop + 4)
        inputs[name] = replace(
            one,
            times=one.times[some],
            values=one.values[some],
            lines=one.lines[some],
            part=one.part[some],
        )
    return replace(recording, inputs=inputs), since
