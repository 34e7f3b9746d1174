"""How good estimates are where no truth is known."""

from __future__ import annotations

import math
from itertools import accumulate

import numpy as np

from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.samples import Sampled, stated
from hgorun.estimate.scores.bands import coverage, coverage_of_normal, since_last
from hgorun.estimate.scores.evaluated import Evaluated
from hgorun.pieces import all_true, everywhere
from hgorun.symbolic.evaluate import Floats

_LAGS = 10
_PIECE = 1 << 16  # numbers that are squared at a time
_SETTLED = 0.1  # of the samples: so many at the start are no matter of the noise


def scores_of(
    prepared: PreparedEstimate, found: Evaluated, j: int, *, spare: bool = False
) -> dict[str, dict[str, float]]:
    """The scores of observer j.

    ``holdout_rmse``, ``holdout_mean``, ``holdout_coverage``
        Of samples that were held out: size of measured minus estimated, its mean, and which part a band of 95 % covers
        that was made of the others, or that follows from the covariance of the observer and the noise of a sample.
    ``innovation_mean``, ``innovation_rms``
        Of measured minus estimated at every sample before it was used, behind the first tenth of them.
    ``whiteness``
        p-value of the test of Ljung and Box with ten lags: small where innovations follow from those before, that is,
        where something could still be learnt from them.
    ``size``
        Their standard deviation over the one that is stated for the noise; where it is below 1, noise is followed.
    ``gated``
        Outliers.
    ``reference_rmse``
        Against what was measured for comparison alone.

    ``spare``: whether the innovations are arrays that nobody else has, which may be written to.
    """
    scores: dict[str, dict[str, float]] = {}

    def add(score: str, of: str, value: float | None) -> None:
        if value is not None:
            scores.setdefault(score, {})[of] = float(value)

    noise, room = stated(prepared.experiment), np.empty(0)
    lost = bool(np.isfinite(found.carried.raw.diverged[j, 0]))
    for name, one in found.held_out.items():
        residuals = _defined(one.residuals[j], lost=lost)
        add("holdout_rmse", name, rms(residuals))
        add("holdout_mean", name, float(np.mean(residuals)) if residuals.size else None)
        if (normal := found.normal[j]) is None:
            add("holdout_coverage", name, coverage(one.residuals[j], _since(prepared, name, one.taken)))
        else:
            add("holdout_coverage", name, coverage_of_normal(one.residuals[j], normal.aside[name]))
    for i, sampled in enumerate(prepared.samples):
        used = found.carried.used[prepared.slots[i], j]
        every = found.predicted[i].of(j, room=room if spare else None)
        innovations = settled(every if all_true(used) else every[used])
        name = sampled.output
        add("innovation_mean", name, float(np.mean(innovations)) if innovations.size else None)
        add("innovation_rms", name, rms(innovations))
        size = float(np.std(innovations)) / noise[name] if name in noise and innovations.size > 1 else None
        if spare:
            room = every
        elif room.size < innovations.size:
            room = np.empty(innovations.size)
        add("whiteness", name, ljung_box(innovations, room=innovations if spare else room))
        add("size", name, size)
        del every, innovations  # before the next ones are made
        if sampled.gate is not None:
            offered = found.carried.offered[prepared.slots[i], j]
            add("gated", name, float(np.count_nonzero(offered & ~used)))
    for name, one in found.reference.items():
        add("reference_rmse", name, rms(_defined(one.residuals[j], lost=lost)))
    return scores


def _since(prepared: PreparedEstimate, name: str, times: Floats) -> Floats:
    """The time since the last sample of an output; of a state that is none no sample is ever taken."""
    sampled = next((one for one in prepared.samples if one.output == name), None)
    return np.zeros(times.size) if sampled is None else since(sampled, times)


def since(sampled: Sampled, times: Floats, *, before: bool = False) -> Floats:
    """How long ago the newest sample was taken that was known at some times; see :func:`since_last`."""
    return since_last(times, *sampled.heard, before=before)


def settled(innovations: Floats) -> Floats:
    """Without those at the start, when the estimate is still on its way."""
    sound = innovations[settled_from(innovations.size) :]
    return sound if everywhere(np.isfinite, sound) else np.asarray(sound[np.isfinite(sound)])


def settled_from(count: int) -> int:
    """The first of so many innovations that is not of the start."""
    return int(np.ceil(_SETTLED * count))


def _defined(residuals: Floats, *, lost: bool) -> Floats:
    """Without those where the estimate is undefined for moments; all where it is lost, or mostly undefined."""
    sound = np.isfinite(residuals)
    return residuals if lost or 2 * np.count_nonzero(sound) < sound.size else np.asarray(residuals[sound])


def rms(values: Floats) -> float | None:
    """Root of the mean square; None of nothing, infinite where an estimate is lost.

    The mean is ``np.mean(np.square(values))`` bit by bit. A system takes longer to give memory for the squares of
    millions of numbers than they take, so they are made in pieces.
    """
    if not values.size:
        return None
    size = float(np.sqrt(_sum_of_squares(values) / values.size))
    return size if np.isfinite(size) else float("inf")


def _sum_of_squares(values: Floats) -> np.float64:
    """Added pairwise as numpy adds an array: it halves it, the first half being a multiple of 8."""
    if values.size <= _PIECE:
        return np.float64(np.add.reduce(np.square(values)))
    half = values.size // 2
    half -= half % 8
    return np.float64(_sum_of_squares(values[:half]) + _sum_of_squares(values[half:]))


def ljung_box(values: Floats, lags: int = _LAGS, *, room: Floats | None = None) -> float | None:
    """The p-value of the test of Ljung and Box: no correlation of values up to so many places apart.

    Q = n (n + 2) sum_k r_k^2 / (n - k) is compared with chi^2 of as many degrees of freedom as there are lags. None
    where values are few, constant or too large to be squared; ``lags`` is even. ``room`` for as many values, which may
    be these themselves, is written to.
    """
    n = values.size
    if n < 3 * lags:
        return None
    centred = np.subtract(values, np.mean(values), out=None if room is None else room[:n])
    with np.errstate(over="ignore"):
        power = float(centred @ centred)
    if not 0 < power < np.inf:
        return None
    correlations = np.array([float(centred[k:] @ centred[:-k]) / power for k in range(1, lags + 1)])
    statistic = n * (n + 2) * float(np.sum(correlations**2 / (n - np.arange(1, lags + 1))))
    return chi_squared_beyond(statistic, lags)


def chi_squared_beyond(value: float, degrees: int) -> float:
    """The probability that chi^2 of an even number of degrees of freedom is larger than a value.

    It is that of fewer than ``degrees / 2`` events of a Poisson process in ``value / 2``: a sum of few positive terms.
    To import a library for it takes longer than all else that is said of a short log.
    """
    assert degrees % 2 == 0
    half = value / 2
    return sum(accumulate(range(1, degrees // 2), lambda term, k: term * half / k, initial=math.exp(-half)))
