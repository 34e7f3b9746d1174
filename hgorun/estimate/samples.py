"""What was recorded, as the channels and inputs of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hgorun.data.recording import InputSignal, Recording, Signal
from hgorun.errors import Problem
from hgorun.measurement.channels import Channel, HeardBefore
from hgorun.measurement.noise import StretchNoise, deviations
from hgorun.measurement.samples import Samples
from hgorun.pieces import all_true, distinct
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.timeline.recorded_inputs import RecordedInputs, last_of


@dataclass(frozen=True, eq=False, repr=False)
class Sampled:
    """The samples of one output in the order of their arrival, counted from the start of the run.

    Attributes
    ----------
    output : str
    taken, available, values : ndarray, shape (n,)
    used : ndarray of bool, shape (n,)
        False for a sample that came after a newer one; with a gate an observer to which the newer ones were outliers
        may use it nevertheless.
    std : float or None
        Standard deviation of the noise, where it was stated with the data.
    gate : float or None
        Standard deviations of the innovation beyond which a sample is not used.
    """

    output: str
    taken: np.ndarray
    available: np.ndarray
    values: np.ndarray
    used: np.ndarray
    std: float | None
    gate: float | None

    @cached_property
    def heard(self) -> tuple[np.ndarray, np.ndarray]:
        """When those that are used were taken, and known: the same array where they are not late."""
        if all_true(self.used):
            return self.taken, self.available
        taken = self.taken[self.used]
        return taken, taken if self.available is self.taken else self.available[self.used]

    @property
    def late(self) -> int:
        """How many became known after they had been taken."""
        return 0 if self.available is self.taken else int(np.count_nonzero(self.available > self.taken))


def sampled(signal: Signal, output: str, origin: float, end: float) -> Sampled:
    """Those of a signal that were taken and known in a run.

    Parameters
    ----------
    origin, end : float
        The start of the run on the clock of the data, and how long it lasts.
    """
    which = in_order(signal, origin, end)
    taken = np.clip(signal.taken[which] - origin, 0.0, end)
    same = signal.available is signal.taken
    available = taken if same else np.clip(signal.available[which] - origin, 0.0, end)
    newest = np.maximum.accumulate(np.concatenate([[-np.inf], taken]))[:-1]
    used = taken >= newest - same_time(origin, end)
    return Sampled(output, taken, available, signal.values[which], used, signal.std, signal.gate)


def stamps(signal: Signal, origin: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """When the samples of :func:`sampled` were taken, and known, on the clock of the data: with all bits of the log."""
    which = in_order(signal, origin, end)
    taken = signal.taken[which]
    return taken, taken if signal.available is signal.taken else signal.available[which]


def in_order(signal: Signal, origin: float, end: float) -> np.ndarray:
    """The samples of a signal that were taken and known in a run, in the order of their arrival: of :func:`sampled`."""
    taken, available = signal.taken - origin, signal.available - origin
    slack = rounding_of(origin, end)
    inside = np.flatnonzero((taken >= -slack) & (available <= end + slack))
    # those known together in the order in which they were taken, so that the newest is what is held
    return np.asarray(inside[np.lexsort((taken[inside], available[inside]))])


def same_time(origin: float, end: float) -> float:
    """By how much times of a run may differ that are equal on paper; arguments as of :func:`sampled`."""
    return max(1e-12 * end, 2 * rounding_of(origin, end))


def rounding_of(origin: float, end: float) -> float:
    """How far a time of a run may be from its place, less the origin; arguments as of :func:`sampled`."""
    return float(4 * np.spacing(max(abs(origin), abs(origin + end))))


def channel(samples: Sampled, experiment: Experiment, output: int, *, heard: bool = False) -> Channel:
    """An output whose samples are there already; ``heard``: others of it have arrived before."""
    stretches = experiment.stretches[output]
    count = samples.available.size
    found = Samples(
        samples.available,
        samples.taken,
        np.arange(count),
        np.zeros(count, dtype=np.int64),
        samples.used if samples.gate is None else np.ones(count, dtype=bool),  # who uses which is decided in the run
    )
    time = experiment.time
    noise = [StretchNoise(s, (), 0, samples.output, time.start, time.end) for s in stretches]
    return (HeardBefore if heard else Channel)(samples.output, stretches, found, noise)


def recorded_inputs(
    recording: Recording, inputs: tuple[str, ...], origin: float, end: float, start: float = 0.0, *, last: bool = True
) -> RecordedInputs | None:
    """The recorded ones among the inputs of a plant, in their order there; None where none is recorded.

    Parameters
    ----------
    origin, end
        The start of the run on the clock of the data, and how long it lasts.
    start : float
        When the first line begins.
    last : bool
        Whether nothing follows: otherwise a line that begins at the end belongs to what does.
    """
    signals = [recording.inputs[name] for name in inputs if name in recording.inputs]
    if not signals:
        return None
    # all are compared as they count from the start: there and back, rounding would put a change before its own time
    since = [one.times - origin if origin else one.times for one in signals]
    later = [own[np.searchsorted(own, start, "right") :] for own in since]
    changes = distinct(np.concatenate([[start], *later]))
    changes = changes[: np.searchsorted(changes, end, "right" if last else "left")]
    lines = [_lines(signal, own, changes) for signal, own in zip(signals, since, strict=True)]
    # of a single one no copies are made
    levels, slopes = (
        part[0][:, None] if len(part) == 1 else np.column_stack(part) for part in zip(*lines, strict=True)
    )
    return RecordedInputs(changes, levels, slopes, held=all(signal.hold == "zero" for signal in signals))


def _lines(signal: InputSignal, own: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Value and slope of an input from some times on; before its first value and behind its last it is constant.

    Parameters
    ----------
    own : ndarray
        The times of the input, which count from the same start as the others.
    """
    if signal.hold == "zero":
        return signal.values[last_of(own, times)], np.zeros(times.size)
    place = np.searchsorted(own, times, side="right") - 1
    before = np.clip(place, 0, None)
    after = np.clip(place + 1, 0, own.size - 1)
    rise, run = signal.values[after] - signal.values[before], own[after] - own[before]
    slopes = np.divide(rise, run, out=np.zeros(times.size), where=run > 0)
    return signal.values[before] + slopes * np.maximum(times - own[before], 0.0), slopes


def all_sampled(recording: Recording, experiment: Experiment) -> list[Sampled]:
    """Of every output of the plant, in their order.

    Raises
    ------
    Problem
        Where no sample lies in the run.
    """
    origin, end = experiment.origin, experiment.time.end
    found = [sampled(recording.outputs[name], name, origin, end) for name in experiment.plant.model.outputs]
    if not any(one.values.size for one in found):
        raise Problem(("time",), f"no sample was taken between {origin:g} and {origin + end:g}")
    return found


def stated(experiment: Experiment) -> Mapping[str, float]:
    """Standard deviation of the noise of every output, where it is stated."""
    return deviations(experiment.stretches, experiment.plant.model.outputs)
