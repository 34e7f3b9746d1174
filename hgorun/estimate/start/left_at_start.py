"""What observers leave out of the samples with which they begin: outliers to those that follow, where a gate says so.

A start that is fitted to several samples judges these. One that is the first sample of each output is judged beside the
next ones in the same way, since a gate knows nothing yet of an observer that begins there: if that sample is an
outlier, the measured state starts where the model passes that passes nearest to the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.data.recording import AUTO, Recording, Signal
from hgorun.engine.plan import Integers
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import Sampled, stated
from hgorun.estimate.start.starting import fit_of, judged_start, rounded

_STATES = 4  # of a plant: a fit of more takes seconds where it finds outliers, which nobody has asked for


@dataclass(frozen=True, eq=False, repr=False)
class AtStart:
    """What a start says of samples, by their numbers among all.

    Attributes
    ----------
    left : set of int
        Those that it has left out.
    near : set of int
        Those that it passes near whatever it is: as many of each output as there are states, of a start that is fitted.
        Their innovations say nothing of the others.
    observers : set of int
        Those that begin there.
    """

    left: set[int]
    near: set[int]
    observers: set[int]

    @classmethod
    def of(cls, prepared: PreparedEstimate) -> AtStart:
        """That of the observers that are given no start."""
        left, start = _start(prepared)
        begins = [prepared.experiment.observers[block.label].initial for block in prepared.run.observers]
        there = {j for j, initial in enumerate(begins) if any(initial.get(name) == x for name, x in start.items())}
        count = prepared.first_samples
        most = prepared.run.plant.model.n if count == AUTO else min(count, prepared.run.plant.model.n)
        near = [_order(one, out)[: most if count != 1 else 0] for one, out in zip(prepared.samples, left, strict=True)]
        return cls(_numbers(prepared, left), _numbers(prepared, near), there)


def _numbers(prepared: PreparedEstimate, which: Sequence[Integers]) -> set[int]:
    """The numbers among all of some samples of each output."""
    return {slot.start + int(k) for slot, one in zip(prepared.slots, which, strict=True) for k in one}


def _order(one: Sampled, out: Integers) -> Integers:
    """The samples of an output in the order in which they were taken, without some."""
    order = np.argsort(one.taken, kind="stable")
    return order[~np.isin(order, out)]


def first_sound(prepared: PreparedEstimate) -> dict[str, float]:
    """By state where it starts that an output measures: its first sample, or what others say where that is an outlier.

    They are none where the first samples of all outputs are sound, or no gate says what an outlier is.
    """
    left, start = _judged(prepared)
    return start if any(map(_leading, prepared.samples, left)) else {}


def told_of_first(prepared: PreparedEstimate, recording: Recording, used: np.ndarray) -> Iterator[str]:
    """What is told of outliers among the first samples: where a start is another for them, and who uses them.

    Parameters
    ----------
    prepared : PreparedEstimate
    recording : Recording
    used : ndarray of bool, shape (samples, m)
        Which samples each observer has used.
    """
    left, start = _start(prepared)
    labels = [block.label for block in prepared.run.observers]
    for one, slots, out in zip(prepared.samples, prepared.slots, left, strict=True):
        signal = recording.outputs[one.output]
        yield from _moved(prepared, one, signal, out, start)
        takes = used[slots][out]
        by = [label for label, own in zip(labels, takes.T, strict=True) if own.any()]
        if by:
            k = int(out[takes.any(axis=1).argmax()])
            uses, taken = "uses" if len(by) == 1 else "use", prepared.run.origin + one.taken[k]
            yield (
                f"{_place(signal, float(one.values[k]))}: {one.output}: {one.values[k]:g}, taken at {taken:g}, is an "
                f"outlier beside the other first samples, and {', '.join(by)} {uses} it: so early a gate cannot tell "
                "where initial is given; plausible of the column leaves it out, as does a start without initial"
            )


def _moved(
    prepared: PreparedEstimate, one: Sampled, signal: Signal, out: Integers, start: Mapping[str, float]
) -> Iterator[str]:
    """Where a measured state does not start from its first sample, since that is an outlier."""
    state, count = prepared.run.plant.model.measures.get(one.output, ""), _leading(one, out)
    observers = prepared.experiment.observers.items()
    labels = [label for label, own in observers if state in start and own.initial.get(state) == start[state]]
    if prepared.first_samples != 1 or not count or not labels:
        return
    first = _first(one)
    which, them = (
        ("the first sample is an outlier", "it") if count == 1 else (f"the first {count} are outliers", "them")
    )
    leave = "leaves" if len(labels) == 1 else "leave"
    yield (
        f"{_place(signal, first)}: {one.output}: {which} beside the next samples: {', '.join(labels)} {leave} {them} "
        f"out, and {state} starts from {start[state]:.6g}, which these say, in place of {first:g}; with "
        "first_samples: auto other states start from them, too"
    )


def _place(signal: Signal, value: float) -> str:
    """The file and the line of the first sample with a value."""
    return f"{signal.source}:{int(signal.lines[np.flatnonzero(signal.values == value)[0]])}"


def _start(prepared: PreparedEstimate) -> tuple[Sequence[Integers], Mapping[str, float]]:
    """Of each output the samples that the start leaves out, and by state where observers begin that are given none."""
    count = prepared.first_samples
    if count == 1:
        return _judged(prepared)
    found = fit_of(prepared, count)
    return (_none(prepared), {}) if found is None else (found.left, rounded(prepared, found))


def _judged(prepared: PreparedEstimate) -> tuple[Sequence[Integers], dict[str, float]]:
    """The same of a start that is the first sample of each output."""
    few = prepared.run.plant.model.n <= _STATES
    left, others = judged_start(prepared) if few and _judges(prepared) else (_none(prepared), {})
    start: dict[str, float] = {}
    measures = prepared.run.plant.model.measures
    for one, out in zip(prepared.samples, left, strict=True):
        state = measures.get(one.output)
        if state is not None and one.values.size:
            start.setdefault(state, others[state] if _leading(one, out) else _first(one))
    return left, start


def _none(prepared: PreparedEstimate) -> Sequence[Integers]:
    return [np.zeros(0, dtype=np.int64)] * len(prepared.samples)


def _judges(prepared: PreparedEstimate) -> bool:
    """Whether a gate and the noise of an output say what an outlier is."""
    known = stated(prepared.experiment)
    return any(one.gate is not None and one.output in known for one in prepared.samples)


def _first(one: Sampled) -> float:
    """The value of the sample that was taken first."""
    return float(one.values[np.argmin(one.taken)])


def _leading(one: Sampled, out: Integers) -> int:
    """How many of the samples of an output that were taken first are outliers."""
    if not out.size:
        return 0
    outlier = np.isin(np.argsort(one.taken, kind="stable"), out)
    return 0 if outlier.all() else int(outlier.argmin())
