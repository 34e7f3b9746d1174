"""Noise amplification that says nothing, as its moving mean is of one point."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from hgorun.ensemble.collected.collected import Collected
from hgorun.result.metrics.smoothness import HF


def said_of_hf(members: Collected, metrics: Collection[str]) -> str:
    """What is said of hf where it is among some metrics, and 0 of every member although errors are not.

    Of a run the points of the mean are known; a file of many has their metrics. An error that is not 0 leaves an hf of
    exactly 0 where no other point is in the mean, but hardly ever otherwise, and not in all members.
    """
    if HF.name not in metrics or HF.name not in members.metrics:
        return ""
    found = members.metrics[HF.name]
    known = found[np.isfinite(found)]
    largest = members.metrics.get("sup", members.metrics.get("rmse"))
    if not known.size or known.any() or (largest is not None and not largest.any()):
        return ""
    why = "its moving mean is no longer than a step; set metrics.average"
    return f"hf is 0 of all members, whatever their errors are: {why}"
