"""Inputs that begin after the measurements, or end before them: what is taken for them there is told."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hgorun.data.faults import GAP, usual_step
from hgorun.data.recording import InputSignal, Note, Signal


def inputs_beyond(inputs: Mapping[str, InputSignal], outputs: Mapping[str, Signal]) -> Iterator[Note]:
    """Before its first value every input, and behind its last one with usual steps: others are written on a change.

    Parameters
    ----------
    inputs, outputs : mapping
        Signals in the order of their times.
    """
    taken = [signal.taken for signal in outputs.values() if signal.taken.size]
    if not taken:
        return
    first, last = min(float(times[0]) for times in taken), max(float(times[-1]) for times in taken)
    step = max(usual_step(times) for times in taken)
    for name, signal in inputs.items():
        if not signal.times.size:
            continue
        longest = GAP * usual_step(signal.times)
        begins, ends = float(signal.times[0]), float(signal.times[-1])
        if begins - first > (longest or step):
            message = (
                f"its values begin at {begins:.6g}, the outputs at {first:.6g}: the first value is taken until then"
            )
            yield _note(name, signal, 0, message)
        if last - ends > longest > 0:
            message = f"its values end at {ends:.6g}, the outputs at {last:.6g}: the last value is held until then"
            yield _note(name, signal, -1, message)


def _note(name: str, signal: InputSignal, k: int, message: str) -> Note:
    return Note(
        kind="gaps", signal=f"inputs.{name}", file=str(signal.source), line=int(signal.lines[k]), message=message
    )
