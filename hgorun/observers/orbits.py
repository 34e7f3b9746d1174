"""Many orbits at once, each with steps of its own: a kink on the way of one shortens the steps of no other."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from hgorun.symbolic.evaluate import Floats

Rate = Callable[[Floats, Floats], Floats]
"""(times (N,), states (N, k)) -> slopes (N, k)."""

_FIRST = 1e-2  # of the way: the first step
_SHRINKS, _GROWS, _SAFE = 0.2, 10.0, 0.9  # from step to step
_ORDER = 8
_SHORTEST = 10.0  # neighbouring numbers


class Escaped(Exception):
    """An orbit that does not stay near its start ``x``, ``after`` some time."""

    def __init__(self, x: Floats, after: float) -> None:
        self.x, self.after = x, after
        super().__init__(f"from {x} after {after:g}")


class Orbits:
    """Orbits that begin at the time 0, by Dormand and Prince's method of order 8 with controlled steps.

    Parameters
    ----------
    rate : Rate
    start : ndarray, shape (N, k)
    accuracy : float
        Of each step, relative; a hundredth of it absolute.
    first : float
        The first step.
    most : int
        Steps of one orbit.

    Attributes
    ----------
    y : ndarray, shape (N, k)
        The states now.
    """

    def __init__(self, rate: Rate, start: Floats, accuracy: float, first: float, most: int) -> None:
        self._rate, self._start, self._accuracy, self._most = rate, start, accuracy, most
        count = len(start)
        self.y, self._now, self._steps = start.copy(), np.zeros(count), np.zeros(count, dtype=int)
        self._wished, self._slope = np.full(count, first), rate(self._now, start)

    def go_on(self, end: float) -> None:
        """Up to a time.

        Raises
        ------
        Escaped
            Where an orbit needs too many steps, or too short ones; with all that is integrated.
        """
        moving = np.flatnonzero(self._now < end)
        with np.errstate(all="ignore"):  # what escapes is told
            while moving.size:
                self._step(moving, end)
                moving = moving[self._now[moving] < end]

    def _step(self, moving: np.ndarray, end: float) -> None:
        """One step of some orbits, or shorter ones the next time."""
        from scipy.integrate import DOP853

        t, y, wished = self._now[moving], self.y[moving], self._wished[moving]
        h = np.minimum(wished, end - t)
        self._steps[moving] += 1
        lost = (wished <= _SHORTEST * np.spacing(t)) | (self._steps[moving] > self._most)
        if lost.any():
            worst = int(np.argmax(lost))
            raise Escaped(self._start[moving[worst]], float(t[worst]))
        slopes = [self._slope[moving]]
        for a, c in zip(DOP853.A[1:], DOP853.C[1:], strict=True):
            slopes.append(self._rate(t + c * h, y + h[:, None] * _weighted(a[: len(slopes)], slopes)))
        new = y + h[:, None] * _weighted(DOP853.B, slopes)
        slopes.append(self._rate(t + h, new))
        scale = self._accuracy * (0.01 + np.maximum(np.abs(y), np.abs(new)))
        fifth, third = (np.sum((_weighted(e, slopes) / scale) ** 2, axis=1) for e in (DOP853.E5, DOP853.E3))
        both = (fifth + 0.01 * third) * y.shape[1]
        error = h * fifth / np.sqrt(np.where(both > 0, both, 1.0))
        factor = np.clip(_SAFE * np.maximum(error, 1e-300) ** (-1 / _ORDER), _SHRINKS, _GROWS)
        factor[np.isnan(error)] = _SHRINKS
        taken = error < 1  # not of what is no number
        cut = taken & (h < wished)  # at the end
        self._wished[moving] = np.where(cut, np.maximum(wished, h * factor), h * factor)
        done = moving[taken]
        self._now[done] = np.where(h < end - t, t + h, end)[taken]
        self.y[done], self._slope[done] = new[taken], slopes[-1][taken]


def followed(rate: Rate, start: Floats, times: Floats, accuracy: float, most: int) -> Iterator[Floats]:
    """The states at ascending times after 0, as :class:`Orbits` follows them."""
    orbits = Orbits(rate, start, accuracy, _FIRST * float(times[-1]), most)
    for end in times.tolist():
        orbits.go_on(end)
        yield orbits.y


def _weighted(weights: Floats, slopes: list[Floats]) -> Floats:
    """A sum, term by term: its bits are those of any machine."""
    found = np.zeros_like(slopes[0])
    for weight, slope in zip(weights.tolist(), slopes, strict=True):
        if weight:
            found += weight * slope
    return found
