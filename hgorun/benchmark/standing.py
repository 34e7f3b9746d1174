"""How contestants stand: in each scenario, over all plants, relative to the best one of each.

In a cell, one plant in one scenario, a contestant's ratio is its mean error over the seeds divided by the smallest
such mean. Over the plants that it takes, ratios are averaged geometrically: 1 is the best everywhere, 2 has twice the
error of the best on average.

The interval says where 95 % of the tables lie that are made anew with other seeds. Seeds are drawn anew with
repetition, the same ones for all contestants, since they have met the same noise: those of scoring, and those of
tuning, among which another value of the knob may be the best. Two such tables, one in the place of this one and one in
that of the other, differ as this one and another do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hgorun.benchmark.benchmark import Entry, of_cells
from hgorun.benchmark.scan import vertices
from hgorun.benchmark.trial import Score

Floats = NDArray[np.float64]
_RESAMPLED, _SEED = 2000, 20_240_229
_QUANTILES = (0.025, 0.975)
_MOST_LOST = 0.5  # of the seeds: with more, a contestant has no mean


@dataclass(frozen=True)
class Standing:
    """A contestant in a scenario.

    Attributes
    ----------
    ratio : float
        Its error in units of that of the best, averaged over plants; NaN where it takes none.
    low, high : float
        Where it lies in 95 % of the tables that are made with other seeds.
    plants : int
        How many it takes without losing the estimate with more than half of the seeds.
    lost : int
        Runs that have lost the estimate, on all plants.
    """

    ratio: float
    low: float
    high: float
    plants: int
    lost: int


def standings(entries: Sequence[Entry]) -> dict[tuple[str, str], Standing]:
    """By (scenario, label)."""
    logs: dict[tuple[str, str], list[Floats]] = {}
    lost: dict[tuple[str, str], int] = {}
    for (_, scenario), cell in of_cells(list(entries)):
        scored = {entry.label: entry.score for entry in cell if entry.score is not None}
        for label, score in scored.items():
            lost[scenario, label] = lost.get((scenario, label), 0) + score.lost
        totals = {label: np.array(score.total) for label, score in scored.items()}
        kept = {label: total for label, total in totals.items() if np.mean(np.isinf(total)) <= _MOST_LOST}
        if not kept:
            continue
        means = np.stack([_resampled(total) * chosen_anew(scored[label]) for label, total in kept.items()])
        best = means.min(axis=0)
        for label, mean in zip(kept, means, strict=True):
            logs.setdefault((scenario, label), []).append(np.log(mean / best))
    found = {}
    for key in dict.fromkeys((entry.scenario, entry.label) for entry in entries):
        ratios = np.exp(np.mean(logs[key], axis=0)) if key in logs else np.full(1 + _RESAMPLED, np.nan)
        low, high = ratios[0] * np.quantile(ratios[1:] / ratios[:0:-1], _QUANTILES)
        found[key] = Standing(float(ratios[0]), float(low), float(high), len(logs.get(key, [])), lost.get(key, 0))
    return found


def chosen_anew(score: Score) -> Floats:
    """By what factor the error grows where the knob is chosen with other seeds, over resamplings; first 1, for these.

    Shape (1 + resamplings,). The value that other seeds choose is the vertex of a parabola through the best of what was
    tried and its two neighbours, and so is the one that these have chosen: how far both are apart is how far the knob is
    uncertain, and the error that all seeds of tuning have there, by the same parabola, is what that costs.
    """
    values = np.array([value for value, _ in score.tried])
    errors = np.array([found for _, found in score.tried])
    kept = np.isfinite(errors).all(axis=1)
    values, errors = values[kept], errors[kept]
    if not len(errors):
        return np.ones(1 + _RESAMPLED)
    order, random = np.argsort(values), np.random.default_rng(_SEED + 1)
    errors = errors[order]
    chosen = _draws(errors.shape[1], random)
    _, costs = vertices(values[order], np.mean(errors[:, chosen], axis=2), errors.mean(axis=1))
    return np.asarray(np.maximum(costs / costs[0], 1.0))


def _draws(count: int, random: np.random.Generator) -> NDArray[np.int64]:
    """Which seeds are taken: first these, then resamplings with repetition; shape (1 + resamplings, seeds)."""
    return np.vstack([np.arange(count), random.integers(0, count, (_RESAMPLED, count))])


def _resampled(total: Floats) -> Floats:
    """The mean over the seeds, then those over resamplings of them; of the seeds that kept the estimate."""
    values = np.where(np.isfinite(total), total, np.nan)[_draws(total.size, np.random.default_rng(_SEED))]
    whole = float(np.nanmean(values[0]))
    counts = np.sum(np.isfinite(values), axis=1)
    return np.where(counts > 0, np.nansum(values, axis=1) / np.maximum(counts, 1), whole)
