"""Late samples that observers leave out (``late: drop``), and what that leaves them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from hgorun.observers.base import AnyObserver
from hgorun.observers.treatment import treatment_of
from hgorun.simulation.prepared import PreparedRun

_AT_MOST = 1  # sample that is no correction over time: one that is taken at the start has no delay yet, as a rule


def remarks_of_late(run: PreparedRun) -> Iterator[str]:
    """What is told of a run in which late samples are left out."""
    if "drop" in run.treatments:
        samples = {c.name: c.samples for c in run.channels}
        late = {name: (int(np.count_nonzero(s.arrival > s.taken)), s.size) for name, s in samples.items()}
        yield from told_left_out(run.experiment.observers, late)


def told_left_out(observers: Mapping[str, AnyObserver], late: Mapping[str, tuple[int, int]]) -> Iterator[str]:
    """The same for observers by their labels, and by output how many of its samples are late, of how many."""
    labels = [label for label, observer in observers.items() if treatment_of(observer) == "drop"]
    by = "" if len(labels) == len(observers) else f" by {', '.join(labels)}"
    for output, (count, every) in late.items() if labels else ():
        if count:
            nothing = ", so that next to nothing of it corrects an estimate" if every - count <= _AT_MOST else ""
            yield f"{count} of {every} samples of {output} were left out{by} since they were late (late: drop){nothing}"


def uncorrected(run: PreparedRun, label: str) -> Sequence[str]:
    """The outputs, where all of them are late to an observer that leaves late samples out; none otherwise."""
    if "drop" not in run.treatments or treatment_of(run.experiment.observers[label]) != "drop":
        return ()
    in_time = [np.count_nonzero(c.samples.arrival <= c.samples.taken) for c in run.channels]
    return [c.name for c in run.channels] if max(in_time) <= _AT_MOST else ()
