"""Bands that should cover 95 % of what is measured, from residuals of samples that an estimate had not seen.

Split-conformal prediction: of n residuals the one of rank ceil(0.95 (n + 1)) bounds a further one with probability
0.95 if their order means nothing. An estimate is worse the longer ago the last sample was, so residuals are sorted
into a few classes by that time, each with its own rank. What a band covers is told from halves: every other residual
is compared with the band of the others. An observer that knows the covariance of its errors has its band from that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from hgorun.native.places import places_in, since_last_in
from hgorun.pieces import distinct, quantiles
from hgorun.result.records.recorded import WIDE
from hgorun.symbolic.evaluate import Floats

LEVEL = 0.95
FEWEST = 19  # residuals from which a rank follows
_OF_A_CLASS = 40
_CLASSES = 5
_ALIKE = 1e-5  # times that differ by so small a part are one: those of a steady clock do by rounding


@dataclass(frozen=True, eq=False, repr=False)
class Band:
    """Half widths by the time since the last sample.

    Attributes
    ----------
    until : ndarray, shape (classes - 1,)
        Where one class ends and the next begins.
    widths : ndarray, shape (classes,)
    """

    until: Floats
    widths: Floats

    @property
    def level(self) -> float | None:
        """The half width where it is always the same; None where it grows."""
        return float(self.widths[0]) if not self.until.size else None

    def at(self, since: Floats) -> Floats:
        """The half width at some times since the last sample."""
        if not self.until.size or np.all(since <= self.until[0]):  # as where all are asked for when samples are taken
            return np.full(since.shape, self.widths[0])
        return np.asarray(self.widths[_classes(self.until, since)])


def band_of(residuals: Floats, since: Floats) -> Band | None:
    """A band from residuals, each with the time since the last sample; None where there are too few.

    Parameters
    ----------
    residuals, since : ndarray, shape (n,)
    """
    sound = np.isfinite(residuals) & np.isfinite(since)
    sizes, since = np.abs(residuals[sound]), since[sound]
    if sizes.size < FEWEST:
        return None
    classes = int(np.clip(sizes.size // _OF_A_CLASS, 1, _CLASSES))
    until = distinct(quantiles(since, np.arange(1, classes) / classes)) if classes > 1 else np.zeros(0)
    until = _apart(until[until < since.max()], since)
    which = _classes(until, since)
    members = [sizes[which == k] for k in range(until.size + 1)]
    if any(one.size < FEWEST for one in members):
        until, members = np.zeros(0), [sizes]
    return Band(until, np.array([_bound(one) for one in members]))


def _apart(until: Floats, since: Floats) -> Floats:
    """The ends of classes, none among times that differ by rounding: an end is then a little above these."""
    above = until * (1 + _ALIKE)
    if not any(np.any((since > low) & (since <= high)) for low, high in zip(until, above, strict=True)):
        return until
    found: list[float] = []
    for end in above.tolist():
        if end < since.max() and (not found or end > found[-1] * (1 + _ALIKE)):
            found.append(end)
    return np.array(found)


def _classes(until: Floats, since: Floats) -> np.ndarray:
    """``numpy.searchsorted``, which takes three times as long: there are few classes, and no order in the times."""
    which = np.zeros(since.shape, dtype=np.int8)
    for end in until:
        which += ~(since <= end)  # NaN is behind all
    return which


def _bound(sizes: Floats) -> float:
    """The residual of rank ceil(0.95 (n + 1))."""
    rank = int(np.ceil(LEVEL * (sizes.size + 1) - 1e-12))
    place = min(rank, sizes.size) - 1
    return float(np.partition(sizes, place)[place])  # there may be a million, of which no order is wanted


def coverage(residuals: Floats, since: Floats) -> float | None:
    """Which part of the residuals the band of the others covers; None where there are too few.

    The others are the other half; of fewer than two bands' worth all but one.
    """
    count = residuals.size
    if count < FEWEST + 1:
        return None
    parts = min(count, 2 if count >= 2 * FEWEST else count)
    fold = np.arange(count) % parts
    covered, judged = 0, 0
    for k in range(parts):
        own = fold == k
        band = band_of(residuals[~own], since[~own])
        if band is None:
            return None
        sound = own & np.isfinite(residuals)
        covered += int(np.count_nonzero(np.abs(residuals[sound]) <= band.at(since[sound])))
        judged += int(np.count_nonzero(sound))
    return covered / judged if judged else None


def coverage_of_normal(residuals: Floats, deviation: Floats) -> float | None:
    """Which part of the residuals lies in a band that their standard deviations make; None where there are too few.

    As many are asked for as for a band that is made of residuals, so that observers are compared by the same samples.

    Parameters
    ----------
    residuals, deviation : ndarray, shape (n,)
        Standard deviations are NaN where they are not known.
    """
    sound = np.isfinite(residuals) & np.isfinite(deviation)
    if residuals.size < FEWEST + 1 or not sound.any():
        return None
    return float(np.mean(np.abs(residuals[sound]) <= WIDE * deviation[sound]))


def since_last(times: Floats, taken: Floats, available: Floats, *, before: bool = False) -> Floats:
    """How long before some times the newest sample was taken that was known then; infinite before the first.

    Parameters
    ----------
    times : ndarray
    taken, available : ndarray, shape (n,)
        Of the samples, in the order of their arrival.
    before : bool
        Samples that become known just then do not count.
    """
    side: Literal["left", "right"] = "left" if before else "right"
    if taken is available and taken.size:  # in the order in which they were taken: the newest is the last
        return since_last_in(taken, times, side)
    known = places_in(available, times, side)
    newest = np.concatenate([[-np.inf], np.maximum.accumulate(taken)])
    return np.asarray(times - newest[known])
