"""How contestants stand: in each scenario, over all plants, relative to the best one of each.

In a cell, one plant in one scenario, a contestant's ratio is its mean error over the seeds divided by the smallest
such mean. Over the plants that it takes, ratios are averaged geometrically: 1 is the best everywhere, 2 has twice the
error of the best on average.

The interval is that of :mod:`hgorun.benchmark.intervals`: where tables lie that are made with other seeds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.benchmark.benchmark import Entry, of_cells
from hgorun.benchmark.intervals import remade, resampled
from hgorun.benchmark.parabolas import Floats

_MOST_LOST = 0.5  # of the seeds: with more, a contestant has no mean


@dataclass(frozen=True)
class Standing:
    """A contestant in a scenario.

    Attributes
    ----------
    ratio : float
        Its error in units of that of the best, averaged over plants; NaN where it takes none.
    low, high : float
        Where it lies in 99 % of the tables that are made with other seeds.
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
        kept = {label: score for label, score in scored.items() if score.lost <= _MOST_LOST * len(score.total)}
        if not kept:
            continue
        means = np.stack([resampled(score) for score in kept.values()])
        best = means.min(axis=0)
        for label, mean in zip(kept, means, strict=True):
            logs.setdefault((scenario, label), []).append(np.log(mean / best))
    found = {}
    for key in dict.fromkeys((entry.scenario, entry.label) for entry in entries):
        ratios = np.exp(np.mean(logs[key], axis=0)) if key in logs else np.full(3, np.nan)
        low, high = remade(ratios)
        found[key] = Standing(float(ratios[0]), float(low), float(high), len(logs.get(key, [])), lost.get(key, 0))
    return found
