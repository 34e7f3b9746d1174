"""Samples that are compared with estimates, and stand among those that observers get as well."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hgorun.data.faults.said_places import samples_said
from hgorun.data.recording import Note, Recording, Signal
from hgorun.data.times.time_steps import median_step
from hgorun.errors import ConfigError
from hgorun.estimate.holdout import given_to_none, note_of, part

_SAME_TIME = 1e-3  # of the median step: stamps are rounded and converted otherwise in another file
_SAME_VALUE = 1e-7  # of a value: single precision
_DIGITS = range(3, 8)  # that values may have been rounded to: with fewer they are those of a coarse sensor
_RARE = 20  # of so many samples of equal times one may be equal by chance, whatever the values are
_PIECE = 1 << 15  # samples at a time: there may be many
_LOOKED_AT = 1 << 16  # values at least that show to how many digits all were written, and their steps


@dataclass(frozen=True, eq=False, repr=False)
class Twins:
    """Where the samples of two signals are the same.

    Attributes
    ----------
    given : ndarray of bool, shape (n,)
        Which samples of the first have the time and the value of one of the second.
    compared, otherwise : ndarray of bool, shape (k,)
        Which samples of the second have the time and the value of one of the first, and which the time only.
    next_to : int
        How many of the latter have a value that is one step of the values' resolution away.
    """

    given: np.ndarray
    compared: np.ndarray
    otherwise: np.ndarray
    next_to: int

    @classmethod
    def of(cls, given: Signal, compared: Signal) -> Twins:
        """Of samples that observers get, and of others."""
        slack = _slack(given.taken, compared.taken)
        shown = [one.values[:: max(one.values.size // _LOOKED_AT, 1)] for one in (given, compared)]
        rounding = np.maximum(*(_rounding(values, compared.values) for values in shown))
        step = max(map(_step, shown))
        same, known, near, timed = (np.zeros(n, dtype=bool) for n in (given.taken.size, *3 * (compared.taken.size,)))
        for start in range(0, compared.taken.size, _PIECE):
            piece = slice(start, start + _PIECE)
            taken, values = compared.taken[piece], compared.values[piece]
            first = np.searchsorted(given.taken, taken - slack, side="left")
            count = np.searchsorted(given.taken, taken + slack, side="right") - first
            timed[piece] = count > 0
            for k in range(int(count.max())):
                at = np.flatnonzero(count > k)
                other, value = given.values[first[at] + k], values[at]
                far = np.abs(other - value)
                equal = far <= np.maximum(_SAME_VALUE * np.maximum(np.abs(other), np.abs(value)), rounding[start + at])
                near[start + at] |= np.abs(far / step - 1) < 1 / 2
                same[first[at[equal]] + k] = True
                known[start + at[equal]] = True
        otherwise = timed & ~known
        return cls(same, known, otherwise, int(np.count_nonzero(near & otherwise)))

    @property
    def by_chance(self) -> bool:
        """Whether the second signal is another measurement, of which some values are equal as those of coarse ones are.

        Where two of these differ it is mostly by one step. What was taken from the log is the same but for what was
        corrected, by whatever that needed.
        """
        equal, other = (int(np.count_nonzero(one)) for one in (self.compared, self.otherwise))
        return _RARE * equal < equal + other or 2 * self.next_to > min(other, equal)


def _rounding(written: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Half of the last place of some values, where numbers were written with few digits or decimals; otherwise 0."""
    sizes, found = np.abs(written), np.zeros(values.shape)
    if not sizes.any():
        return found
    for of in (_decade, lambda numbers: np.full(numbers.shape, _decade(sizes.max()))):  # digits, and decimals
        first, own = of(sizes), of(np.abs(values))
        for digits in _DIGITS:
            places = written / first * 10.0 ** (digits - 1)
            if np.all(np.abs(places - np.rint(places)) <= _SAME_VALUE * np.abs(places)):
                found = np.maximum(found, own / 10.0 ** (digits - 1) * (0.5 + _SAME_VALUE))
                break
    return found


def _decade(sizes: np.ndarray) -> np.ndarray:
    """The power of ten of the first digit."""
    return np.asarray(10.0 ** np.floor(np.log10(np.where(sizes > 0, sizes, 1.0))))


def _step(values: np.ndarray) -> float:
    """The resolution of some values: the smallest difference between two; infinite of one value."""
    steps = np.diff(np.sort(values))
    steps = steps[steps > _SAME_VALUE * np.abs(values).max(initial=0.0)]
    return float(steps.min(initial=np.inf))


def _slack(given: np.ndarray, compared: np.ndarray) -> float:
    """By how much times may differ that are equal on paper."""
    latest = max((float(np.abs(times).max()) for times in (given, compared) if times.size), default=0.0)
    steps = [step for step in map(median_step, (given, compared)) if np.isfinite(step)]
    return max(4 * float(np.spacing(latest)), _SAME_TIME * min(steps, default=0.0))


def without_twins(given: Signal, held: Signal, words: str) -> tuple[Signal, list[Note]]:
    """An output without the samples that are held out from a file and stand in the log as well, and what is told.

    A file with another measurement of the same holds nothing out.

    Parameters
    ----------
    words : str
        The option.

    Raises
    ------
    ConfigError
        Where observers would get nothing.
    """
    twins, notes = Twins.of(given, held), list[Note]()
    if twins.given.all():
        raise ConfigError(
            f"{words}: all samples of the output {held.name} stand there, if under another name, and observers would "
            f"get none: hold out some of them, --holdout {held.name}=5"
        )
    held_out = twins.given & (not twins.by_chance)
    notes += given_to_none(given, held_out)
    if other := int(np.count_nonzero(twins.otherwise)):
        samples = samples_said(other, " that is held out has", " that are held out have")
        told = f"{samples} the time of one in the log, but not its value: observers get the one in the log"
        if twins.by_chance and twins.compared.any():
            told += ", also where values are equal, since this is another measurement"
        notes.append(note_of(held.name, held, twins.otherwise, told))
    return (part(given, ~held_out) if held_out.any() else given), notes


def used_nevertheless(recording: Recording, compared: Signal, key: str, what: str) -> Iterator[Note]:
    """What is told of samples for comparison most of which observers get, of that output or of another.

    Single ones may be equal by chance, and so are many of a quantity that rests.

    Parameters
    ----------
    key, what : str
        What the samples are called, and what they are.
    """
    for name, given in recording.outputs.items():
        found = Twins.of(given, compared)
        twins = found.compared
        count = int(np.count_nonzero(twins))
        moves = np.ptp(compared.values[twins]) > 0 if count else False
        if 2 * count > twins.size and not found.by_chance and (moves or name == compared.name):
            which = "the only sample" if twins.size == 1 else f"{count} of {twins.size} samples"
            told = f"observers get {which} {what} as the output {name}: estimates are compared with what they use"
            yield note_of(key, compared, twins, told)


def of_references(recording: Recording) -> Iterator[Note]:
    """The same of every reference whose column is not told of already."""
    known = {note.signal for note in recording.notes if note.kind == "used"}
    for name, signal in recording.reference.items():
        if (key := f"reference.{name}") not in known:
            yield from used_nevertheless(recording, signal, key, "of the reference")
