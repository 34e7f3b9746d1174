"""How far apart the points of an estimate are, where the configuration does not say it."""

from __future__ import annotations

import math

FEWEST = 100
"""Intervals that show how an estimate moves between few samples."""
_FINER = 4  # times as many, so that the end is a point
_ROUND = ("1", "2", "5")  # times a power of ten: parts whose points have few digits
_NEAR = 1e-9  # of an interval


def output_step(gap: float, span: float, least: int = FEWEST) -> float:
    """The median gap between samples, or a part of it in a short log.

    An output grid of the gaps of few samples would show straight lines from one to the next, whatever the model does
    there. With fewer intervals than these the gap is divided by a whole number, so that even samples stay on the grid,
    and the end of the run is a point of it; where no small number does that, the run is divided.

    Parameters
    ----------
    gap : float
        NaN of a single sample.
    span : float
        Of the run.
    least : int
        Intervals.
    """
    whole = min(gap, span) if math.isfinite(gap) else span
    intervals = span / whole if whole > 0 else math.inf
    if intervals >= least * (1 - _NEAR):
        return float(whole)
    fewest = math.ceil(least / intervals - _NEAR)
    for parts in sorted(range(fewest, _FINER * fewest + 1), key=lambda count: str(count).rstrip("0") not in _ROUND):
        if abs(intervals * parts - round(intervals * parts)) < _NEAR * intervals * parts:
            return float(whole / parts)
    return float(span / math.ceil(intervals * fewest))
