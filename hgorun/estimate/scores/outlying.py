"""Samples that no observer gets, and that are outliers: what of a score is not decided by gains, but by one of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hgorun.estimate.scores.scores import rms
from hgorun.pieces import median
from hgorun.symbolic.evaluate import Floats

FAR = 10.0  # standard deviations, where no gate says how many
NORMAL = 1.4826  # standard deviations in a median of absolute deviations
_FEWEST = 8  # samples that tell how far they usually are
_PART = 0.1  # of the samples, though one may always be: more are no outliers
_ALIKE = 2.0  # times the smallest median of errors: that of gains that are as good

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False, repr=False)
class Errors:
    """Those of an output or state in a run with some gains.

    Attributes
    ----------
    name : str
    taken, values : ndarray, shape (k,)
        Times, and errors in the unit of ``noise``; innovations have no times.
    noise : float
        The standard deviation that is stated, 0 where none is.
    gate : float or None
        Beyond how many standard deviations a sample is no longer used.
    parts : int
        How many of these there are, each with the same weight.
    """

    name: str
    taken: Floats
    values: Floats
    noise: float
    gate: float | None
    parts: int


def few(far: Mask) -> Mask:
    """Which of the samples that are far off are outliers: none of too many, nor those from the first one on.

    There estimates are still on their way.
    """
    found = far.copy()
    found[: int(np.argmin(found))] = False
    return found if _so_few(found) else np.zeros(far.size, dtype=bool)


def _so_few(far: Mask) -> bool:
    """Whether that many samples may be outliers."""
    return bool(far.size >= _FEWEST and np.count_nonzero(far) <= max(1, _PART * far.size))


def outliers(runs: Sequence[Sequence[Errors]]) -> list[Mask]:
    """The samples beyond their gate in all runs with good gains; of an output without a gate none.

    Whether an estimate follows the others is told by the median of its errors, which outliers do not move. A sample
    from which the estimates are far with some of the good gains only says something of gains.
    """
    return [_beyond([run[i] for run in runs], one.gate) for i, one in enumerate(runs[0])]


def _beyond(runs: Sequence[Errors], limit: float | None) -> Mask:
    """Those of one output."""
    return few(_far(runs, limit))


def _far(runs: Sequence[Errors], limit: float | None) -> Mask:
    """The samples of one output that are beyond a limit, outliers or not."""
    sizes = [np.abs(one.values) for one in runs]
    if limit is None or not sizes[0].size:
        return np.zeros(sizes[0].size, dtype=bool)
    medians = [median(size) for size in sizes]
    good = [size for size, median in zip(sizes, medians, strict=True) if median <= _ALIKE * min(medians)]
    scale = max(NORMAL * min(medians), runs[0].noise)
    return np.asarray(np.min(good, axis=0) > (limit * scale or np.inf))


def told(run: Sequence[Errors], left_out: Sequence[Mask], whose: str) -> Iterator[str]:
    """What is told of outliers: that they are left out, or, where no gate says so, that they are most of the score.

    Also told is that the first samples are most of it, though they are beyond their gate.

    Parameters
    ----------
    run : sequence of Errors
        With the gains that were found.
    left_out : sequence of ndarray of bool
    whose : str
        For what the samples are.
    """
    for one, out in zip(run, left_out, strict=True):
        if out.any():
            which, be, them = _named(one, out, whose)
            yield f"{one.name}: {which} {be} beyond the gate with all good gains: the score is without {them}"
        if one.gate is None and one.taken.size:
            far = _beyond([one], FAR)
            if decided := _decided(one, far, out):
                which, be, them = _named(one, far, whose)
                what, decides = (
                    ("an outlier, or one was used shortly before", "decides")
                    if be == "is"
                    else ("outliers, or some were used shortly before", "decide")
                )
                yield (
                    f"{one.name}: {which} {be} far off and {decides} the score: {what}; without {them} it is "
                    f"{decided}; plausible of the column leaves outliers out, as does the gate of an output"
                )
        first = _first(one)
        if decided := _decided(one, first, out):
            which, be, them = _named(one, first, whose)
            yield (
                f"{one.name}: {which} {be} beyond the gate and counted nevertheless, since estimates may be on their "
                f"way there: without {them} the score is {decided}; plausible of the column leaves outliers out"
            )


def _first(one: Errors) -> Mask:
    """The samples beyond the gate from the first one on, so few that they may be outliers."""
    found = _far([one], one.gate)
    found[int(np.argmin(found)) if found.size else 0 :] = False
    return found if _so_few(found) else np.zeros(found.size, dtype=bool)


def _decided(one: Errors, far: Mask, out: Mask) -> str:
    """The score without some samples in place of the one with them, where they decide it."""
    whole, rest = rms(one.values[~out]) or 0.0, rms(one.values[~(far | out)]) or 0.0
    return f"{rest:.3g} in place of {whole:.3g}" if 2 * rest < whole else ""


def _named(one: Errors, out: Mask, whose: str) -> tuple[str, str, str]:
    """How many samples, and the time of the first; the verb; and how they are referred to."""
    count, at = int(np.count_nonzero(out)), float(one.taken[out.argmax()])
    if count == 1:
        return f"1 sample for the {whose}, at t = {at:g},", "is", "it"
    return f"{count} samples for the {whose}, the first at t = {at:g},", "are", "them"
