"""Inputs that begin after the measurements, or end before them: what is taken for them there is told."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hgorun.data.clocks import shown
from hgorun.data.faults.faults import GAP, usual_step
from hgorun.data.recording import InputSignal, Note, Origin, Signal


def inputs_beyond(inputs: Mapping[str, InputSignal], outputs: Mapping[str, Signal], origin: Origin) -> Iterator[Note]:
    """Before its first value every input, and behind its last one with usual steps: others are written on a change.

    Parameters
    ----------
    inputs, outputs : mapping
        Signals in the order of their times.
    origin : Origin
        Of their times.
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
            at, since = shown(begins, origin), shown(first, origin)
            yield _note(
                name,
                signal,
                0,
                f"its values begin at {at}, the outputs at {since}: the first value is taken until then",
            )
        if last - ends > longest > 0:
            at, until = shown(ends, origin), shown(last, origin)
            yield _note(
                name, signal, -1, f"its values end at {at}, the outputs at {until}: the last value is held until then"
            )


def _note(name: str, signal: InputSignal, k: int, message: str) -> Note:
    file, line = signal.place(k)
    return Note(kind="gaps", signal=f"inputs.{name}", file=file, line=line, message=message)
