"""What observers leave out of the samples with which they begin: outliers to those that follow, where a gate says so.

A start that is fitted to several samples judges these. One that is the first sample of each output is judged beside the
next ones in the same way, since a gate knows nothing yet of an observer that begins there: if that sample is an
outlier, the measured state starts where the model passes that passes nearest to the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from hgorun.data.recording import Recording, Signal
from hgorun.engine.plan import Integers
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import Sampled, in_order, stated
from hgorun.estimate.start.starting import fit_of, judged_start

_STATES = 4  # of a plant: a fit of more takes seconds where it finds outliers, which nobody has asked for


@dataclass(frozen=True, eq=False, repr=False)
class AtStart:
    """What a start says of samples.

    Attributes
    ----------
    outliers : sequence of ndarray of int
        Of each output the numbers of those that it has left out, among its own.
    left : set of int
        The same by their numbers among all.
    near : set of int
        Those that it passes near whatever it is: as many of each output as there are states, of a start that is fitted.
        Their innovations say nothing of the others.
    observers : set of int
        Those that begin there: a state of theirs was taken from it, where no start is given.
    """

    outliers: Sequence[Integers]
    left: set[int]
    near: set[int]
    observers: set[int]

    @classmethod
    def of(cls, prepared: PreparedEstimate) -> AtStart:
        """That of a run, found once."""
        known = _KNOWN.get(prepared)
        if known is None:
            known = _KNOWN[prepared] = cls._of(prepared)
        return known

    @classmethod
    def _of(cls, prepared: PreparedEstimate) -> AtStart:
        begun, n = prepared.experiment.begun, prepared.run.plant.model.n
        there = {j for j, block in enumerate(prepared.run.observers) if begun.get(block.label)}
        if prepared.first_samples == 1:
            left, _ = _judged(prepared)
            return cls(left, _numbers(prepared, left), set(), there)
        found = fit_of(prepared, prepared.first_samples)
        left = near = _none(prepared)
        if found is not None:
            left = found.left
            near = [own[~np.isin(own, out)][:n] for own, out in zip(found.task.numbers, left, strict=True)]
        return cls(left, _numbers(prepared, left), _numbers(prepared, near), there)


_KNOWN: WeakKeyDictionary[PreparedEstimate, AtStart] = WeakKeyDictionary()  # a run has several passes


def _numbers(prepared: PreparedEstimate, which: Sequence[Integers]) -> set[int]:
    """The numbers among all of some samples of each output."""
    return {slot.start + int(k) for slot, one in zip(prepared.slots, which, strict=True) for k in one}


def first_moved(prepared: PreparedEstimate) -> dict[str, float]:
    """By state where it starts that an output measures whose first sample is an outlier: what the others say.

    It is none where the first samples of all outputs are sound, or no gate says what an outlier is.
    """
    left, others = _judged(prepared)
    measures, found, known = prepared.run.plant.model.measures, dict[str, float](), set[str]()
    for one, out in zip(prepared.samples, left, strict=True):
        state = measures.get(one.output)
        if state is not None and one.values.size and state not in known:
            known.add(state)
            found |= {state: others[state]} if _leading(one, out) else {}
    return found


def told_of_first(prepared: PreparedEstimate, recording: Recording, used: np.ndarray) -> Iterator[str]:
    """What is told of outliers among the first samples: where a start is another for them, and who uses them.

    Parameters
    ----------
    prepared : PreparedEstimate
    recording : Recording
    used : ndarray of bool, shape (samples, m)
        Which samples each observer has used.
    """
    if not prepared.gated:
        return
    labels = [block.label for block in prepared.run.observers]
    for one, slots, out in zip(prepared.samples, prepared.slots, AtStart.of(prepared).outliers, strict=True):
        signal = recording.outputs[one.output]
        yield from _moved(prepared, one, signal, out)
        takes = used[slots][out]
        by = [label for label, own in zip(labels, takes.T, strict=True) if own.any()]
        if by:
            k = int(out[takes.any(axis=1).argmax()])
            uses, taken = "uses" if len(by) == 1 else "use", prepared.run.origin + one.taken[k]
            yield (
                f"{_place(prepared, signal, k)}: {one.output}: {one.values[k]:g}, taken at {taken:g}, is an "
                f"outlier beside the other first samples, and {', '.join(by)} {uses} it: so early a gate cannot tell "
                "where initial is given; plausible of the column leaves it out, as does a start without initial"
            )


def _moved(prepared: PreparedEstimate, one: Sampled, signal: Signal, out: Integers) -> Iterator[str]:
    """Where a measured state does not start from its first sample, since that is an outlier."""
    state, count = prepared.run.plant.model.measures.get(one.output, ""), _leading(one, out)
    begun = prepared.experiment.begun
    labels = [label for label in prepared.experiment.observers if begun.get(label, {}).get(state) == "model"]
    if prepared.first_samples != 1 or not count or not labels:
        return
    first, start = int(np.argmin(one.taken)), prepared.experiment.observers[labels[0]].initial[state]
    which, them = (
        ("the first sample is an outlier", "it") if count == 1 else (f"the first {count} are outliers", "them")
    )
    leave = "leaves" if len(labels) == 1 else "leave"
    yield (
        f"{_place(prepared, signal, first)}: {one.output}: {which} beside the next samples: {', '.join(labels)} "
        f"{leave} {them} out, and {state} starts from {start:.6g}, which these say, in place of {one.values[first]:g}; "
        "with first_samples: auto other states start from them, too"
    )


def _place(prepared: PreparedEstimate, signal: Signal, k: int) -> str:
    """The file and the line of a sample of a run."""
    file, line = signal.place(int(in_order(signal, prepared.run.origin, prepared.run.time.end)[k]))
    return f"{file}:{line}"


def _judged(prepared: PreparedEstimate) -> tuple[Sequence[Integers], dict[str, float]]:
    """Of a start that is the first sample of each output what it leaves out of each, and what the others say."""
    few = prepared.run.plant.model.n <= _STATES
    return judged_start(prepared) if few and _judges(prepared) else (_none(prepared), {})


def _none(prepared: PreparedEstimate) -> Sequence[Integers]:
    return [np.zeros(0, dtype=np.int64)] * len(prepared.samples)


def _judges(prepared: PreparedEstimate) -> bool:
    """Whether a gate and the noise of an output say what an outlier is."""
    known = stated(prepared.experiment)
    return any(one.gate is not None and one.output in known for one in prepared.samples)


def _leading(one: Sampled, out: Integers) -> int:
    """How many of the samples of an output that were taken first are outliers."""
    if not out.size:
        return 0
    outlier = np.isin(np.argsort(one.taken, kind="stable"), out)
    return 0 if outlier.all() else int(outlier.argmin())
