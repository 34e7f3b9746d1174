"""Which runs have the same truth, and how the truths of a figure are drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hgorun.figures.style import OTHER_TRUTHS, TRUTH
from hgorun.result.records.data import ResultData
from hgorun.tables.typeset import words

_UNSEEN = 1e-3  # of a state's range: less than half the width of a line


def truth_looks(panels: Sequence[Sequence[str]], results: Mapping[str, ResultData]) -> dict[str, Mapping[str, Any]]:
    """How the truth of every run is drawn.

    Black and dashed; only where a panel shows runs whose truths can be told apart does each have a look of
    its own, with the name of its first run.

    Parameters
    ----------
    panels : sequence of sequence of str
        The runs whose truths each panel shows; recordings have none.
    results : mapping of str to ResultData
    """
    groups: dict[str, int] = {}
    firsts: list[str] = []
    for run in dict.fromkeys(run for panel in panels for run in panel if results[run].recorded is None):
        same = (i for i, first in enumerate(firsts) if _same_truth(results[first], results[run]))
        groups[run] = next(same, len(firsts))
        if groups[run] == len(firsts):
            firsts.append(run)
    looks: dict[str, Mapping[str, Any]] = dict.fromkeys((run for panel in panels for run in panel), TRUTH)
    if all(len({groups[run] for run in panel if run in groups}) <= 1 for panel in panels):
        return looks
    own = [
        {**OTHER_TRUTHS[i % len(OTHER_TRUTHS)], "label": f"{words(first)}: {TRUTH['label']}"}
        for i, first in enumerate(firsts)
    ]
    return looks | {run: own[group] for run, group in groups.items()}


def _same_truth(a: ResultData, b: ResultData) -> bool:
    """Whether the lines lie on each other while both runs last.

    The grids of two runs may differ, and their steps, and so the roundings.
    """
    if a is b:
        return True
    fine, coarse = (a, b) if len(a.time) >= len(b.time) else (b, a)
    both = (coarse.time >= fine.time[0]) & (coarse.time <= fine.time[-1]) if fine.time.size else np.empty(0, dtype=bool)
    if a.states != b.states or a.outputs != b.outputs or 2 * np.count_nonzero(both) < both.size or not both.any():
        return False
    for x, other in zip(coarse.x[both].T, fine.x.T, strict=True):
        gap = np.max(np.abs(np.interp(coarse.time[both], fine.time, other) - x))
        if not gap <= _UNSEEN * np.ptp(x) + 1e-12 * np.max(np.abs(x)):
            return False
    return True
