"""Instruments that lag behind: what they would have shown of an estimate."""

from __future__ import annotations

import numpy as np

from hgorun.pieces import distinct
from hgorun.symbolic.evaluate import Floats

_REACH = 40.0  # time constants: nothing is left in a number of what was longer ago
_MOST = 1 << 18  # points between what an instrument has shown
_LITTLE = 1e-6  # of the shortest time between arrivals


class Instrument:
    """An instrument with a lag of the first order, lag v' = x - v, that is shown estimates in place of the plant.

    It begins with what it has shown in fact, and again behind moments at which an estimate is not known. Estimates
    come piece by piece, with the same result, bit by bit, as all at once.

    Parameters
    ----------
    taken : ndarray, shape (k,)
        When it has shown something; these times do not fall.
    lag : float
        The time constant, > 0.
    count : int
        Observers, m.
    period : float or None
        Of the quantity, if it is known up to whole periods.
    """

    def __init__(self, taken: Floats, lag: float, count: int, period: float | None = None) -> None:
        self.taken, self.lag, self._period = taken, lag, period
        self._felt = np.zeros((count, taken.size))  # since the time before, as it is left at each one
        self._seen = np.full((count, taken.size), np.nan)
        self._last, self._turns = (np.zeros(0), np.zeros((count, 0))), np.zeros((count, 1))

    def see(self, times: Floats, values: Floats) -> None:
        """Estimates, on straight lines from one time to the next.

        Parameters
        ----------
        times : ndarray, shape (N,)
            They rise, from those seen before on. All in ``taken`` that lie between them are among them.
        values : ndarray, shape (m, N)
            NaN where an estimate is not known.
        """
        if not times.size:
            return
        known, taken, lag = self._last[0].size, self.taken, self.lag
        t, x = np.concatenate([self._last[0], times]), np.concatenate([self._last[1], values], axis=1)
        self._last = t[-1:], x[:, -1:].copy()
        with np.errstate(invalid="ignore"):
            if self._period is not None:
                turns = np.nan_to_num(np.rint(np.diff(x) / self._period), posinf=0.0, neginf=0.0)
                turns = np.cumsum(np.concatenate([self._turns, -turns], axis=1), axis=1)
                x, self._turns = x + self._period * turns, turns[:, -1:].copy()
            until = np.searchsorted(taken, t[1:])
            between = (until > 0) & (until < taken.size)
            until, steps = until[between], np.diff(t)[between] / lag
            gone = -np.expm1(-steps)
            ramp = 1 - gone / steps  # of the end of a line, beside what its beginning has
            left = np.exp((t[1:][between] - taken[until]) / lag)
            for felt, own in zip(self._felt, x, strict=True):
                added = left * ((gone - ramp) * own[:-1][between] + ramp * own[1:][between])
                np.add.at(felt, until, added)  # one after the other, wherever a piece ends
        some = slice(*np.searchsorted(taken, (times[0], np.nextafter(times[-1], np.inf))).tolist())
        self._seen[:, some] = x[:, known:][:, np.searchsorted(times, taken[some])]

    def residuals(self, shown: Floats) -> Floats:
        """What it has shown, shape (k,), minus what it would have shown of all that was seen, shape (m, k)."""
        with np.errstate(invalid="ignore"):
            begun = np.where(np.isfinite(self._seen), shown + self._whole(self._seen - shown), np.nan)
            found, left = begun.copy(), np.exp(-np.diff(self.taken) / self.lag)
            for k in range(left.size):
                after = left[k] * found[:, k] + self._felt[:, k + 1]
                found[:, k + 1] = np.where(np.isfinite(after), after, begun[:, k + 1])
            residuals = shown - found
            return np.asarray(residuals - self._whole(residuals))

    def _whole(self, values: Floats) -> Floats | float:
        """The whole periods in values."""
        return 0.0 if self._period is None else self._period * np.rint(values / self._period)


def points_between(taken: Floats, lag: float, step: float) -> Floats:
    """Where estimates are wanted for an instrument: between the times at which it shows something.

    Parameters
    ----------
    taken : ndarray, shape (k,)
        They do not fall.
    lag : float
        The time constant.
    step : float
        Of the integration: between its steps nothing happens to an estimate. Where that were too many points they are
        farther apart.
    """
    spans = np.minimum(np.diff(taken), _REACH * lag)
    apart = max(step, float(np.sum(spans)) / _MOST)
    counts = np.ceil(spans / apart).astype(np.int64)
    reaches = np.diff(taken) > spans  # and the first of them is not the time before
    points = np.maximum(counts - 1, 0) + reaches
    which = np.repeat(np.arange(points.size), points)
    back = np.arange(which.size) - np.repeat(np.cumsum(points) - points, points) + 1
    return np.asarray(taken[1:][which] - back * (spans / np.maximum(counts, 1))[which])


def felt_of(times: Floats, taken: Floats, lag: float) -> Floats:
    """Those of some times of which something is left when the instrument shows something next."""
    following = np.searchsorted(taken, times)
    inside = (following > 0) & (following < taken.size)
    times, following = times[inside], following[inside]
    return np.asarray(times[taken[following] - times <= _REACH * lag])


def just_before(arrivals: Floats) -> Floats:
    """The moments before samples arrive, when nothing has jumped yet."""
    gaps = np.diff(distinct(arrivals))
    little = _LITTLE * (float(gaps.min()) if gaps.size else 1.0)
    return np.maximum(arrivals - little, 0.0)
