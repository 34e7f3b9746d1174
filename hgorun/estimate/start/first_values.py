"""The first samples of a log, from which measured states start, and what is told of samples that became known late."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hgorun.data.recording import Recording, Signal
from hgorun.errors import ConfigError
from hgorun.simulation.experiment.experiment import Experiment

_BEYOND = 1e6  # times the length of a log: no run goes on for so long behind it


def first_values(experiment: Experiment, recording: Recording) -> dict[str, float]:
    """By state the first sample of an output that measures it, not before the start of the run."""
    return {state: float(signal.values[k]) for state, (signal, k) in _first_samples(experiment, recording).items()}


def known_later(experiment: Experiment, recording: Recording) -> Iterator[str]:
    """Where an estimate starts from a sample that became known after it was taken: who estimates live lacks it."""
    for state, (signal, k) in _first_samples(experiment, recording).items():
        taken, known = (float(numbers[k]) for numbers in (signal.taken, signal.available))
        labels = [label for label in experiment.observers if experiment.begun.get(label, {}).get(state) == "sample"]
        if known > taken and labels:
            yield (
                f"{', '.join(labels)}: {state} starts from the first sample, taken at {taken:g} and known at {known:g} "
                "only: give observers.*.initial where the time before counts"
            )


def known_too_late(recording: Recording) -> Iterator[str]:
    """Where most samples of an output become known after the log's last one is taken: that is hardly meant."""
    end = max((float(one.taken[-1]) for one in recording.outputs.values() if one.taken.size), default=0.0)
    for name, signal in recording.outputs.items():
        if signal.available is signal.taken:
            continue
        known = signal.available
        late = int(np.count_nonzero(known > end))
        if 2 * late > known.size:
            many = known.size > 1
            what = f"{late} of {known.size} samples become" if many else "its one sample becomes"
            when = f"one at {float(known.max()):g}" if many else f"at {float(known[0]):g}"
            yield (
                f"{name}: {what} known only after the last of the log is taken, at "
                f"t = {end:g}, {when}: is data.outputs.{name}.available right?"
            )


def known_far_behind(experiment: Experiment, recording: Recording) -> Iterator[str]:
    """Where few samples become known so late that the run goes on for longer than the log, for them alone."""
    outputs = [one for one in recording.outputs.values() if one.taken.size]
    first = min((float(one.taken[0]) for one in outputs), default=0.0)
    last = max((float(one.taken[-1]) for one in outputs), default=0.0)
    for signal in outputs:
        if signal.available is signal.taken:
            continue
        k = int(np.argmax(signal.available))
        known = float(signal.available[k])
        few = 2 * int(np.count_nonzero(signal.available > last)) <= signal.taken.size  # of most it is told otherwise
        if few and known - last > last - first > 0 and experiment.blocks.time.end >= known:
            file, line = signal.place(k)
            yield (
                f"{file}:{line}: {signal.name}: a sample becomes known at t = {known:g} only, "
                f"and the last of the log is taken at {last:g}: the run goes on until then; is "
                f"data.outputs.{signal.name}.available right? With time.end it ends before"
            )


def require_known(recording: Recording) -> None:
    """Refuse a log with a sample that becomes known beyond all that can be a run with its steps.

    Raises
    ------
    ConfigError
        At the line of the sample.
    """
    outputs = [one for one in recording.outputs.values() if one.taken.size]
    span = max(float(one.taken[-1]) for one in outputs) - min(float(one.taken[0]) for one in outputs)
    for signal in outputs:
        if signal.available is signal.taken:
            continue
        k = int(np.argmax(signal.available))
        behind = float(signal.available[k] - signal.taken[k])
        if behind > _BEYOND * span > 0:
            message = (
                f"{signal.name}: the sample taken at {signal.taken[k]:g} becomes known {behind:g} later, and the whole "
                f"log is {span:g} long: is data.outputs.{signal.name}.available right? With time.end the run ends "
                "before"
            )
            file, line = signal.place(k)
            raise ConfigError(message, file=file, line=line)


def _first_samples(experiment: Experiment, recording: Recording) -> dict[str, tuple[Signal, int]]:
    """By state the signal that measures it, and which of its samples is the first of the run."""
    found: dict[str, tuple[Signal, int]] = {}
    start = experiment.blocks.time.start
    for output, state in experiment.plant.model.measures.items():
        signal = recording.outputs[output]
        k = int(np.searchsorted(signal.taken, start))
        if k < signal.taken.size and state not in found:
            found[state] = signal, k
    return found
