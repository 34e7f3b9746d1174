"""Samples that are set aside, to be compared with what is estimated without them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hgorun.config.nearest import among
from hgorun.data.faults.said_places import samples_said
from hgorun.data.recording import Note, Recording, Signal
from hgorun.errors import ConfigError
from hgorun.pieces import median

_HALF = 0.5  # of the samples: every second one, more than which are not held out


@dataclass(frozen=True)
class HoldOut:
    """Every so many-th sample of an output, from the one in the middle of the first so many on."""

    output: str
    every: int


def parse_holdout(text: str) -> tuple[str, str]:
    """``OUTPUT=N`` or ``OUTPUT=FILE``: the output, and what follows.

    Raises
    ------
    ConfigError
    """
    output, equals, what = text.partition("=")
    if not equals or not output or not what:
        raise ConfigError(f"--holdout {text}: expected OUTPUT=N, every N-th sample, or OUTPUT=FILE")
    return output, what


def number_of(output: str, what: str) -> HoldOut | None:
    """The hold-out of every N-th sample; None where a file is meant.

    Raises
    ------
    ConfigError
        For a number below 2.
    """
    if not what.lstrip("+-").isdigit():
        return None
    every = int(what)
    if every < 2:
        raise ConfigError(f"--holdout {output}={what}: expected a number of at least 2, or a file")
    return HoldOut(output, every)


def expected_of(output: str, what: str) -> str:
    """What may stand behind an output, and of a share of the samples which number says it."""
    expected = "expected N, of which every N-th sample is held out, or a file"
    try:
        share = float(what.removesuffix("%")) / (100 if what.endswith("%") else 1)
    except ValueError:
        return expected
    return f"{expected}; {what} of them is {output}={round(1 / share)}" if 0 < share <= _HALF else expected


def held_out(recording: Recording, chosen: list[HoldOut]) -> tuple[Recording, Mapping[str, Signal]]:
    """A recording without some samples, and these.

    Raises
    ------
    ConfigError
        For an output that is not recorded, or has too few samples.
    """
    outputs, aside, notes = dict(recording.outputs), {}, list[Note]()
    for one in chosen:
        if one.output not in outputs:
            known = among(one.output, recording.outputs)
            raise ConfigError(f"--holdout {one.output}: no such output is recorded; there are {known}")
        signal = outputs[one.output]
        out = np.zeros(signal.taken.size, dtype=bool)
        out[one.every // 2 :: one.every] = True
        if not out.any() or out.all():
            are = "is" if out.size == 1 else "are"
            raise ConfigError(f"--holdout {one.output}={one.every}: there {are} {samples_said(out.size)} only")
        given, told = given_of(signal, ~out)
        if not given.taken.size:
            raise ConfigError(f"--holdout {one.output}={one.every}: no sample is left that is not held out")
        aside[one.output], outputs[one.output] = part(signal, out), given
        notes += told
    return replace(recording, outputs=outputs, notes=(*recording.notes, *notes)), aside


def given_of(signal: Signal, given: np.ndarray) -> tuple[Signal, list[Note]]:
    """The samples of a signal that observers get where the others are held out, and what is told.

    A sample that stands in the log twice, ``repeated: keep``, is not given if it is held out once.
    """
    again = given & _equal(signal, ~given)
    return part(signal, given & ~again), list(given_to_none(signal, again))


def given_to_none(signal: Signal, which: np.ndarray) -> Iterator[Note]:
    """What is told of samples that observers do not get, as the same ones are held out."""
    if count := int(np.count_nonzero(which)):
        samples = samples_said(count, " of this output has", " of this output have")
        told = f"{samples} the time and the value of one that is held out: not given to observers either"
        yield note_of(f"outputs.{signal.name}", signal, which, told)


def note_of(key: str, signal: Signal, which: np.ndarray, told: str) -> Note:
    """What is told of some samples, at the first of them."""
    file, line = signal.place(int(which.argmax()))
    return Note(kind="used", signal=key, file=file, line=line, count=int(np.count_nonzero(which)), message=told)


def _equal(signal: Signal, some: np.ndarray) -> np.ndarray:
    """Which samples of a signal have the time and the value of one of some; none where no time is repeated."""
    if not np.any(signal.taken[1:] == signal.taken[:-1]):
        return np.zeros(signal.taken.size, dtype=bool)
    both = signal.taken + 1j * signal.values
    return np.isin(both, both[some])


def thinned(recording: Recording, period: float | None) -> tuple[Recording, Mapping[str, Signal]]:
    """A recording with samples that are at least a period apart, and those between them, of outputs that have some.

    Half of the median step is let pass, so that stamps that jitter do not cost a sample. Nothing is filtered.
    """
    outputs = dict(recording.outputs)
    between: dict[str, Signal] = {}
    if period is None:
        return recording, between
    for name, signal in recording.outputs.items():
        given = _apart(signal.taken, period)
        if not given.all():
            outputs[name] = part(signal, given)
            unseen = ~given & ~_equal(signal, given)
            if unseen.any():
                between[name] = part(signal, unseen)
    return replace(recording, outputs=outputs), between


def of_one_time(whole: Recording, left: Recording) -> Iterator[Note]:
    """What is told where nothing but samples of one time is left of a recording with more."""
    start, end = left.span
    first, last = whole.span
    if start == end and first < last:
        told = f"all samples but those at {start:g} are held out, of a log from {first:g} to {last:g}"
        one = next(iter(left.outputs.values()))
        yield Note(kind="used", signal=", ".join(left.outputs), file=str(one.source), message=told)


def _apart(taken: np.ndarray, period: float) -> np.ndarray:
    """Which of some times, in their order, are a period or more behind the last of them."""
    chosen = np.zeros(taken.size, dtype=bool)
    least = period - 0.5 * median(np.diff(taken)) if taken.size > 1 else period
    place = 0
    while place < taken.size:
        chosen[place] = True
        place = max(int(np.searchsorted(taken, taken[place] + least)), place + 1)
    return chosen


def part(signal: Signal, chosen: np.ndarray) -> Signal:
    """Some samples of a signal."""
    taken = signal.taken[chosen]
    same = signal.available is signal.taken
    return replace(
        signal,
        taken=taken,
        available=taken if same else signal.available[chosen],
        values=signal.values[chosen],
        lines=signal.lines[chosen],
        part=signal.part[chosen] if signal.part.size else signal.part,
    )
