"""Two signals that take turns in one column, row by row, without a column that names them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hgorun.pieces import quantiles

_FEWEST = 60  # samples that show it
_LOOKED_AT, _AT_ONCE = 1_000_000, 1000  # samples, and those of which it is seen that they do not
_TURNS = 0.95  # of all samples are of the other signal than the one before
_APART = 2.0  # times the range of either: so far one is from the other
_SLOW = 10.0  # times the usual step of a signal from its sample to the next: less is no way that it has gone
_OWN = 2.0  # times the usual steps: less is no way that it has gone alone
_ENDS = np.array([0.01, 0.05, 0.95, 0.99])


@dataclass(frozen=True, eq=False, repr=False)
class InTurn:
    """That values are of two signals.

    Attributes
    ----------
    place : int
        Of the second sample.
    shown : sequence of float
        The first samples.
    low, high : float
        Between which those of the first signal lie.
    """

    place: int
    shown: tuple[float, ...]
    low: float
    high: float

    def sentence(self, *, measured: bool) -> str:
        """What may be wrong, and what takes the rows of one signal; inputs have no ``plausible``."""
        digits = 3 + math.ceil(max(0.0, math.log10(max(abs(self.low), abs(self.high)) / (self.high - self.low))))
        shown = ", ".join(f"{value:.{digits + 3}g}" for value in self.shown)
        right = (
            f"plausible: [{self.low:.{digits}g}, {self.high:.{digits}g}] takes those of one"
            if measured
            else "an input needs a file with its own rows"
        )
        return f"two signals may take turns in this column, row by row ({shown}, ...), and are read as one: {right}"


def in_turn(values: np.ndarray, plausible: tuple[float, float] | None = None) -> InTurn | None:
    """That samples are of two signals in turn; None where nothing says so.

    A square wave does not say it, whose levels stay where they are, nor does one on top of a signal, or whose height
    changes: both of its levels move alike. Each of two signals goes a way of its own, far from the other.

    Parameters
    ----------
    values : ndarray, shape (n,)
        As they stand in the file.
    plausible : (float, float), optional
        Between what values are used.
    """
    low, high = plausible or (-math.inf, math.inf)
    values = values[:_LOOKED_AT]
    places = np.flatnonzero(np.isfinite(values) & (values >= low) & (values <= high))
    if places.size < _FEWEST:
        return None
    with np.errstate(all="ignore"):  # differences of the largest numbers
        return _of(values[places], places)


def _of(values: np.ndarray, places: np.ndarray) -> InTurn | None:
    """That of the samples that are used, and where they stand."""
    rises = np.sign(np.diff(values[:_AT_ONCE]))
    if np.mean(rises[1:] * rises[:-1] < 0) < _TURNS:
        return None
    upper = values > quantiles(values, np.array([0.25, 0.75])).mean()  # half of the samples are of each
    if np.mean(upper[1:] != upper[:-1]) < _TURNS:
        return None
    one, other = values[upper == upper[0]], values[upper != upper[0]]
    ends = [quantiles(signal, _ENDS) for signal in (one, other)]
    ranges = [float(of[2] - of[1]) for of in ends]
    gap = float(max(ends[0][0] - ends[1][-1], ends[1][0] - ends[0][-1]))
    usual = [float(np.abs(np.diff(signal)).mean()) for signal in (one, other)]
    slow = all(moved > _SLOW * step for moved, step in zip(ranges, usual, strict=True))
    if not (gap > _APART * max(ranges) and slow and _go_alone(one, other, usual)):
        return None
    return InTurn(int(places[1]), tuple(values[:3].tolist()), float(one.min()) - gap / 2, float(one.max()) + gap / 2)


def _go_alone(one: np.ndarray, other: np.ndarray, usual: list[float]) -> bool:
    """Whether no line makes one signal of the other, but for their usual steps."""
    size = min(one.size, other.size)
    a, b = (signal[:size] - signal[:size].mean() for signal in (one, other))
    slope = float(a @ b / (a @ a))
    left = float(np.sqrt(np.mean((b - slope * a) ** 2)))
    return left > _OWN * (usual[1] + abs(slope) * usual[0])
