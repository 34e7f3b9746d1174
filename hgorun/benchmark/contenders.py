"""How fast and how quiet contestants are: the points of a benchmark's figure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hgorun.benchmark.benchmark import Entry, of_cells
from hgorun.figures.benchmark import Contender


def contenders(entries: Sequence[Entry], scenarios: Sequence[str]) -> dict[str, list[Contender]]:
    """The points of the figure: geometric means over the plants, each in units of the smallest there."""
    logs: dict[tuple[str, str], list[tuple[float, float]]] = {}
    groups = {entry.label: entry.group for entry in entries}
    for (_, scenario), cell in of_cells(list(entries)):
        scores = {e.label: e.score for e in cell if e.score is not None and not e.score.lost}
        if not scores:
            continue
        sizes = {
            label: (max(s.converged, np.finfo(float).tiny), float(np.mean(s.steady))) for label, s in scores.items()
        }
        best = np.min(list(sizes.values()), axis=0)
        for label, size in sizes.items():
            speed, steady = np.log(np.array(size) / best)
            logs.setdefault((scenario, label), []).append((float(speed), float(steady)))
    return {
        name: [
            Contender(label, groups[label], *map(float, np.exp(np.mean(logs[name, label], axis=0))))
            for label in groups
            if (name, label) in logs
        ]
        for name in scenarios
    }
