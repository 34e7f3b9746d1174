"""Extremes of functions of time, and functions that have too many of them to be found.

However narrow a pulse is, its extreme is an event, so that no step passes over it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.measurement.events import Irregular, Kinks
from hgorun.memo import Memo
from hgorun.pieces import distinct, medians
from hgorun.symbolic.crossings import TooMany
from hgorun.symbolic.evaluate import Floats, evaluate
from hgorun.symbolic.interval_operations import Bounds
from hgorun.symbolic.intervals import enclose

_PARTS, _LOOKS, _GOLDEN = 1024, 4096, 0.5 * (5**0.5 - 1)
_STEEP, _FEW = 4.0, 64  # times the usual steepness; parts of a span that are
_HITS = 100
EXTREMES = 40_000  # that are looked for: events, each of which ends a step
_EXTREMES: Memo[Irregular] = Memo(32)


def extremes(slopes: Kinks, values: Floats, start: float, end: float) -> Irregular:
    """Where functions of time have extremes.

    Where there are too many of them, only those are looked for where a function is much steeper than elsewhere.
    """

    def found() -> Irregular:
        try:
            return slopes.between(values, start, end, EXTREMES)
        except TooMany:
            return Irregular(_steep(slopes, values, start, end), ((start, end),))

    return _EXTREMES.get((slopes, values.tobytes(), start, end), found)


def _steepness(kinks: Kinks, values: Floats, start: float, end: float) -> tuple[Floats, Floats]:
    """Bounds of how often in a unit of time a part may change by its own range, on equal cells of a span.

    Returns
    -------
    edges : ndarray, shape (cells + 1,)
    rates : ndarray, shape (parts, cells)
        Infinite where that is not known.
    """
    edges = np.linspace(start, end, _PARTS + 1)
    if kinks.parts is None or not kinks.parts.numel_out(0):
        return edges, np.zeros((0, _PARTS))

    def bounds(which: int, entry: int) -> Bounds:
        return (edges[:-1], edges[1:]) if which == 0 else (np.array(values[entry]),) * 2

    _, slopes = enclose(kinks.parts, bounds)
    steepest = np.array([np.broadcast_to(np.fmax(np.abs(low), np.abs(high)), _PARTS) for low, high in slopes])
    times = start + (end - start) * np.mod(np.arange(1, _LOOKS + 1) * _GOLDEN, 1.0)
    with np.errstate(all="ignore"):
        found = evaluate(kinks.parts, times[:, None], values)[0]
        rates = steepest / (found.max(axis=0) - found.min(axis=0))[:, None]
    return edges, np.where(steepest > 0, np.where(np.isnan(rates), np.inf, rates), 0.0)


def _steep(slopes: Kinks, values: Floats, start: float, end: float) -> Floats:
    """Extremes in those parts of a span where a function may be much steeper than in most of them."""
    edges, rates = _steepness(slopes, values, start, end)
    steep = np.flatnonzero(np.any(rates > _STEEP * medians(rates, 1)[:, None], axis=0))
    times = [np.zeros(0)]
    for cell in steep if steep.size <= _FEW else []:
        try:
            times.append(slopes.between(values, edges[cell], edges[cell + 1], EXTREMES).times)
        except TooMany:
            continue
    return distinct(np.concatenate(times))


def usual_rate(slopes: Kinks, values: Floats, start: float, end: float) -> float:
    """How often in a unit of time a function may change by its own range in most of a span."""
    _, rates = _steepness(slopes, values, start, end)
    return float(np.max(medians(rates, 1), initial=0.0))


@dataclass(frozen=True)
class Unknown:
    """Functions of time whose extremes may not all have been found.

    Attributes
    ----------
    what : str
        How they are told.
    of_plant : bool
        Whether they are the plant's; otherwise noise and delay of an output.
    lost : tuple of (float, float)
        Where, on the clock of the configuration.
    rate : float
        How often in the run they may change by their own range.
    """

    what: str
    of_plant: bool
    lost: tuple[tuple[float, float], ...]
    rate: float

    def seen(self, evaluations: float) -> bool:
        """Whether so many evaluations meet a hundred of the pulses, at least half as many as the extremes.

        What is missed of them shows in the difference of two passes then.
        """
        return self.rate * _HITS <= 0.5 * EXTREMES * evaluations

    @property
    def reason(self) -> str:
        """What is said of a run that may not have seen all of it."""
        first, last = min(a for a, _ in self.lost), max(b for _, b in self.lost)
        return (
            f"{self.what}: there are too many extremes between t = {first:.6g} and t = {last:.6g} to find all of "
            "them; pulses that are shorter than the steps may have been missed"
        )
