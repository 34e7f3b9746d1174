"""Where the numbers of a table lie that is made anew, with other seeds of tuning and of scoring.

Seeds are drawn anew with repetition, the same ones for all contestants, since they have met the same noise. Other seeds
of scoring give another mean. Other seeds of tuning give another knob, and with it another error; of that a mean over
seeds tells nothing where noise hardly matters. Two such tables, one in the place of this one and one in that of the
other, differ as this one and another do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hgorun.benchmark.parabolas import Floats, vertices
from hgorun.benchmark.trial import Score

_RESAMPLED, _SEED = 2000, 20_240_229
_QUANTILES = (0.005, 0.995)


def remade(numbers: Floats) -> tuple[float, float]:
    """Where 99 % of the tables have a number, from what it is and what it is with seeds drawn anew, shape (1 + N,)."""
    low, high = numbers[0] * np.quantile(numbers[1:] / numbers[:0:-1], _QUANTILES)
    return float(low), float(high)


def resampled(score: Score) -> Floats:
    """The mean error over the seeds that kept the estimate, and what it is with seeds drawn anew, shape (1 + N,)."""
    return _scored_anew(np.array(score.total)) * chosen_anew(score)


def chosen_anew(score: Score) -> Floats:
    """By what factor the error grows where the knob is chosen with other seeds, shape (1 + N,); first 1, for these.

    The value that other seeds choose is the vertex of a parabola through the best of what was tried and its two
    neighbours, and so is the one that these have chosen: how far both are apart is how far the knob is uncertain, and
    the error that all seeds of tuning have there, by the same parabola, is what that costs.
    """
    values = np.array([value for value, _ in score.tried])
    errors = np.array([found for _, found in score.tried])
    kept = np.isfinite(errors).all(axis=1)
    if not kept.any():
        return np.ones(1 + _RESAMPLED)
    order = np.argsort(values[kept])
    values, errors = values[kept][order], errors[kept][order]
    chosen = _draws(errors.shape[1], _SEED + 1)
    _, costs = vertices(values, np.mean(errors[:, chosen], axis=2), errors.mean(axis=1))
    return np.asarray(np.maximum(costs / costs[0], 1.0))


def _scored_anew(total: Floats) -> Floats:
    """The mean over the seeds, then those over resamplings of them; of the seeds that kept the estimate."""
    values = np.where(np.isfinite(total), total, np.nan)[_draws(total.size, _SEED)]
    whole = float(np.nanmean(values[0]))
    counts = np.sum(np.isfinite(values), axis=1)
    return np.where(counts > 0, np.nansum(values, axis=1) / np.maximum(counts, 1), whole)


def _draws(count: int, seed: int) -> NDArray[np.int64]:
    """Which seeds are taken: first all, each once, then resamplings with repetition; shape (1 + resamplings, seeds)."""
    random = np.random.default_rng(seed)
    return np.vstack([np.arange(count), random.integers(0, count, (_RESAMPLED, count))])
