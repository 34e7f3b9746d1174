"""Samples that a gate leaves out one after the other: too many of them are no outliers."""

from __future__ import annotations

import numpy as np

from hgorun.estimate.carrying import Carried
from hgorun.estimate.prepared import PreparedEstimate
from hgorun.estimate.start.left_at_start import AtStart
from hgorun.result.records.recorded import InARow


def in_a_row(prepared: PreparedEstimate, carried: Carried, j: int) -> dict[str, InARow]:
    """By output of which observer j has left samples out, the most of them one after the other, as they were judged.

    An observer that goes back to when late samples were taken judges them in that order, others as they arrive.
    """
    found = {}
    for one, slots in zip(prepared.samples, prepared.slots, strict=True):
        used, offered = carried.used[slots, j], carried.offered[slots, j]
        if one.gate is None or not np.any(offered & ~used):
            continue
        order = np.argsort(one.taken, kind="stable") if prepared.treatment(j) == "replay" else np.arange(used.size)
        order = order[offered[order]]
        first, last = _longest(~used[order])
        times = prepared.run.origin + one.taken[order[[first, last]]]
        found[one.output] = InARow(last - first + 1, float(times[0]), float(times[1]))
    return found


def outliers_at_start(prepared: PreparedEstimate, carried: Carried, j: int) -> dict[str, int]:
    """By output how many samples observer j has left out since its start has found them to be outliers."""
    start = AtStart.of(prepared)
    if j not in start.observers:
        return {}
    every = zip(prepared.samples, prepared.slots, start.outliers, strict=True)
    return {one.output: int(np.count_nonzero(~carried.used[slots, j][out])) for one, slots, out in every}


def _longest(marked: np.ndarray) -> tuple[int, int]:
    """The first and the last place of the most neighbours that are all marked, of which there are some."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8)))
    starts, stops = edges[::2], edges[1::2]
    which = int(np.argmax(stops - starts))
    return int(starts[which]), int(stops[which]) - 1
