"""What may be narrow in a state: when a trajectory that is known between the steps passes it.

A force that acts within 1e-4 of a position, or a peak exp(-(x/1e-4)^2), lasts as long as the state takes to pass it,
which may be less than a step. Comparisons, signs and the like have such features where their arguments cross a value,
exponentials and quotients where their arguments have an extreme. Along a trajectory that is a cubic between
neighbouring times these are functions of time, whose crossings and extremes are found as those of inputs are. What
features equations have is in :mod:`hgorun.symbolic.narrow`.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from hgorun.symbolic.crossings import Search, TooMany
from hgorun.symbolic.curves import Curve
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.functions_of_time import Smooth
from hgorun.symbolic.interval_operations import Bounds
from hgorun.symbolic.intervals import enclose
from hgorun.symbolic.levels import Levels, zero

_TOGETHER = 64  # cells
_MOST = 20_000  # passages of a feature
_NOTHING = 40.0  # e to the power of minus that is nothing beside 1
_CHANGE = 1.0  # of an argument, or of the logarithm of a divisor: less makes nothing narrow
_NODES = np.polynomial.chebyshev.chebpts1(6)  # of a cell, -1 to 1
_TO_SERIES = np.linalg.inv(np.polynomial.chebyshev.chebvander(_NODES, _NODES.size - 1)).T
_TAIL = 4.0  # what follows in a series is taken for no more than that many of its last two terms
_WORK = 2e8  # cells of a search times the instructions of its function
_ZERO = zero(reached=False)


@dataclass(frozen=True, eq=False)
class Feature:
    """A place in the space of states where equations change quickly.

    Attributes
    ----------
    argument : Smooth
        What decides it, as a function of time on a cell: s are the cell's start, 1 over its length, and the
        coefficients of the states.
    states_alone : casadi.Function
        The same from (t, p, states).
    slope : Smooth or None
        Of what has a peak: the slope of the argument.
    levels : Levels or None
        Of what switches: the values that the argument crosses.
    states : tuple of int
        On which it depends.
    ratio : bool
        Whether the argument counts by its logarithm.
    ramp : bool
        Whether it switches smoothly.
    jump : bool
        Whether it switches from one value to another, so that equations are not continuous there.
    even : bool
        Whether both signs of the argument make a peak.
    operation : str
        What switches, as it is written in an expression; empty where that is something else.
    """

    argument: Smooth
    states_alone: ca.Function
    slope: Smooth | None
    levels: Levels | None
    states: tuple[int, ...]
    ratio: bool = False
    ramp: bool = False
    jump: bool = False
    even: bool = False
    operation: str = ""

    def found(self, curve: Curve, p: Floats, step: int = 1) -> Floats:
        """When a curve passes it, in ascending order; ``step``: how many cells a step may be as long as."""
        curve = curve.where(self._near(curve, p)) if step == 1 else curve
        if not curve.low.size:
            return np.zeros(0)
        s = self._cells(curve)
        value, _ = self.argument.bounds(curve.low, curve.high, p, s)
        may = self._may(value, step)
        if self.slope is not None and np.any(may):
            may &= self._may(self._by_series(curve, p, s, may, value), step)
        some = np.flatnonzero(may)
        if not some.size:
            return np.zeros(0)
        function = self.slope or self.argument
        budget = _WORK / function.slope.n_instructions()
        search = Search(function, p, s[some], self.levels or _ZERO, limit=_MOST, budget=budget)
        passed = search.between(curve.low[some], curve.high[some])
        if passed.unseen:
            raise TooMany(np.inf)
        times = passed.times
        return times if self.slope is None else times[self._counts(curve, p, times)]

    def _by_series(self, curve: Curve, p: Floats, s: Floats, some: np.ndarray, value: Bounds) -> Bounds:
        """Bounds of the argument on all cells, on some of them by a Chebyshev series through a few of its values.

        Interval arithmetic knows nothing of what cancels, so that its bounds of a determinant say little. What
        could be so narrow in the argument that a series does not see it is a feature of its own.
        """
        low, high = curve.low[some], curve.high[some]
        times = low[:, None] + 0.5 * (1 + _NODES) * (high - low)[:, None]
        found = self.argument.at(times.ravel(), p, np.repeat(s[some], _NODES.size, axis=0))
        series = found.reshape(times.shape) @ _TO_SERIES
        size = np.abs(series)
        reach = size[:, 1:].sum(axis=1) + _TAIL * size[:, -2:].sum(axis=1)
        least, most = value[0].copy(), value[1].copy()
        least[some] = np.fmax(least[some], series[:, 0] - reach)
        most[some] = np.fmin(most[some], series[:, 0] + reach)
        return least, most

    def _near(self, curve: Curve, p: Floats) -> np.ndarray:
        """The cells of those neighbourhoods in which it may be passed, by bounds of the states alone."""
        first = np.arange(0, curve.low.size, _TOGETHER)
        if not first.size:
            return np.zeros(0, dtype=bool)
        last = np.append(first[1:], curve.low.size) - 1
        least, most = np.minimum.reduceat(curve.least, first), np.maximum.reduceat(curve.most, first)
        return np.repeat(self.near(curve.low[first], curve.high[last], least, most, p), last - first + 1)

    def near(self, low: Floats, high: Floats, least: Floats, most: Floats, p: Floats) -> np.ndarray:
        """Whether it may be passed.

        Parameters
        ----------
        low, high : ndarray, shape (N,)
            Times between which the states are within bounds.
        least, most : ndarray, shape (N, states, ...)
            What follows is for several runs, as with p.
        p : ndarray, shape (parameters, ...)

        Returns
        -------
        ndarray, shape (N, ...)
        """
        shape = least[:, 0].shape
        times = low.reshape(-1, *(1,) * (len(shape) - 1)), high.reshape(-1, *(1,) * (len(shape) - 1))

        def bounds(which: int, entry: int) -> Bounds:
            if which == 0:
                return times
            if which == 1:
                return np.asarray(p[entry]), np.asarray(p[entry])
            return least[:, self.states[entry]], most[:, self.states[entry]]

        value = enclose(self.states_alone, bounds)[0][0]
        may = self._may((np.broadcast_to(value[0], shape).ravel(), np.broadcast_to(value[1], shape).ravel()))
        return may.reshape(shape)

    def _may(self, value: Bounds, step: int = 1) -> np.ndarray:
        """Whether it may be passed where the argument has such bounds."""
        some = np.ones(value[0].size, dtype=bool) if self.levels is None else self.levels.inside(value)
        return some & self._changes(_over(value, step)) if self.levels is None or self.ramp else some

    def _counts(self, curve: Curve, p: Floats, times: Floats) -> np.ndarray:
        """Whether the peaks at some times are not nothing beside others, or what is there at the ends of cells."""
        s = self._cells(curve)
        size = self._size(self.argument.at(times, p, s[curve.at(times)]))
        elsewhere = self._size(self.argument.at(curve.low, p, s))
        return size >= max(np.max(size, initial=-np.inf), np.max(elsewhere, initial=-np.inf)) - _NOTHING

    def _size(self, argument: Floats) -> Floats:
        """The logarithm of what an argument brings about."""
        if not self.ratio:
            return np.abs(argument) if self.even else argument
        with np.errstate(divide="ignore"):
            return -np.log(np.abs(argument))

    def differs(self, curve: Curve, p: Floats, times: Floats, others: Floats) -> np.ndarray:
        """Whether the argument at some times is far from what it is at others, or these are on cells farther away."""
        s, cells, there = self._cells(curve), curve.at(times), curve.at(others)
        a, b = self.argument.at(times, p, s[cells]), self.argument.at(others, p, s[there])
        with np.errstate(all="ignore"):
            gap = np.log(np.abs(a / b)) if self.ratio else a - b
        return np.asarray(~((np.abs(gap) <= _CHANGE) & (np.abs(cells - there) <= 1)))

    def _changes(self, value: Bounds) -> np.ndarray:
        """Whether an argument within such bounds may change much."""
        low, high = value
        if not self.ratio:
            return np.asarray(~(high - low <= _CHANGE))
        with np.errstate(all="ignore"):
            little = (low > 0) & (high <= np.exp(_CHANGE) * low) | (high < 0) & (low >= np.exp(_CHANGE) * high)
        return np.asarray(~little)

    def _cells(self, curve: Curve) -> Floats:
        own = curve.coefficients[:, list(self.states)].reshape(curve.low.size, -1)
        return np.column_stack([curve.low, 1 / (curve.high - curve.low), own])


def _over(value: Bounds, step: int) -> Bounds:
    """Bounds over all cells that a step may share with each."""
    if step == 1:
        return value
    first = np.arange(0, value[0].size, step)
    low, high = np.minimum.reduceat(value[0], first), np.maximum.reduceat(value[1], first)
    low, high = np.append(low, np.inf), np.append(high, -np.inf)
    around = np.arange(value[0].size) // step
    return (
        np.minimum(np.minimum(low[around - 1], low[around]), low[around + 1]),
        np.maximum(np.maximum(high[around - 1], high[around]), high[around + 1]),
    )
