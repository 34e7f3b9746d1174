"""When a smooth function of time takes given values: all such times, found for certain.

Interval arithmetic encloses the function and its slope on cells of the time axis. A cell whose enclosure holds none
of the values is done with; on a cell where the slope has one sign the function is monotone, and its crossings are
told by the values at the two ends; any other cell is cut in two. So no crossing is lost, however short the pulse
that it begins. Where the function only touches a value, and rounding hides its sign, cutting stops: such cells are
crossings if the sign differs on their two sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.pieces import distinct
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.functions_of_time import Smooth
from hgorun.symbolic.interval_operations import Bounds
from hgorun.symbolic.levels import Levels

_CELLS = 1 << 15  # that are looked at together: bounds the memory
_EARLY, _SAMPLES, _LARGE = 1 << 13, 4, 100_000  # cells; looks for each crossing that is allowed, where that is few
_PER_CROSSING = 100  # more cells for each crossing that was found
_ZERO = 1e-290  # a slope that is zero but for rounding outwards
_GOLDEN = 0.5 * (5**0.5 - 1)
_LOOKS = (0.137, 0.618, 0.389, 0.891)  # where a cell is looked at: no simple function has all its roots there
_NOISE = 64.0  # bounds of a cell are those of rounding if they are no further apart than that many of a point's
_DOUBTFUL = 20_000  # cells of which it is unknown what rounding hides
_WIDE = 1e-3  # of a piece: rounding hides the sign of a function that touches a value on much less


class TooMany(Exception):
    """More crossings than there is memory for; the argument is their number as far as it is known."""


@dataclass(frozen=True, eq=False, repr=False)
class Cells:
    """Parts of the time axis, each inside a piece on which the function is smooth; arrays of one shape (N,)."""

    low: Floats
    high: Floats
    piece: np.ndarray

    def where(self, chosen: np.ndarray) -> Cells:
        """Those chosen."""
        return Cells(self.low[chosen], self.high[chosen], self.piece[chosen])

    def halves(self) -> Cells:
        """Each cut in two."""
        middle = 0.5 * (self.low + self.high)
        return _together([Cells(self.low, middle, self.piece), Cells(middle, self.high, self.piece)])


def _where(bounds: Bounds, chosen: np.ndarray) -> Bounds:
    return bounds[0][chosen], bounds[1][chosen]


def _together(cells: list[Cells]) -> Cells:
    parts = [(c.low, c.high, c.piece) for c in cells] or [(np.zeros(0), np.zeros(0), np.zeros(0, dtype=int))]
    return Cells(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


@dataclass(frozen=True, eq=False, repr=False)
class Found:
    """What :func:`crossings` finds.

    Attributes
    ----------
    times : ndarray
        In ascending order, each the first double on the far side.
    lost : tuple of (float, float)
        Where the function could not be followed: crossings there are found on a grid only, or not at all.
    unseen : bool
        Whether the search ended because its budget was spent.
    """

    times: Floats
    lost: tuple[tuple[float, float], ...] = ()
    unseen: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class Search:
    """A search for the crossings of a function.

    Attributes
    ----------
    p : ndarray
    s : ndarray, shape (pieces, size)
        What is constant on each piece.
    touches : bool
        Whether times at which a level is touched count, too.
    limit : float
        More crossings than that are refused.
    budget : float
        How many cells are looked at, beside some for each crossing that is found.
    """

    function: Smooth
    p: Floats
    s: Floats
    levels: Levels
    touches: bool = False
    limit: float = np.inf
    budget: float = 4e6

    def between(self, low: Floats, high: Floats) -> Found:
        """The crossings on all pieces.

        Parameters
        ----------
        low, high : ndarray, shape (pieces,)

        Raises
        ------
        TooMany
        """
        finest = 1e-3 * np.spacing(max(abs(low[0]), abs(high[-1])))  # near t = 0 doubles are finer than need be
        stack = [Cells(low, high, np.arange(low.size))]
        crossed, flat, looked, doubtful, found = [], [], 0, 0, 0
        while stack and looked < self.budget + _PER_CROSSING * found:
            cells = stack.pop()
            if cells.low.size > _CELLS:
                rest = np.arange(cells.low.size) >= _CELLS
                stack.append(cells.where(rest))
                cells = cells.where(~rest)
            if looked < _EARLY <= looked + cells.low.size:
                self._not_too_many(low, high)
            looked += cells.low.size
            monotone, hidden, doubted, left = self._sorted(cells, finest)
            doubtful += doubted.low.size
            crossed.append(self._crossed(monotone, found))
            found += crossed[-1][1].size
            flat += [hidden, doubted] if doubtful > _DOUBTFUL else [hidden]
            stack += [c.halves() for c in ([left] if doubtful > _DOUBTFUL else [left, doubted]) if c.low.size]
        unseen, touched = _together(stack), _joined(_together(flat))
        crossed += [self._crossed(cells, found) for cells in (unseen, touched)]
        times = [np.zeros(0), *(self._first_beyond(*one) for one in crossed if one[1].size)]
        middle = 0.5 * (touched.low + touched.high)
        if self.touches:
            times.append(middle)
        value, _ = self.function.bounds(touched.low, touched.high, self.p, self.s[touched.piece])
        loud = np.maximum(np.abs(value[0]), np.abs(value[1])) > _ZERO
        known = np.isfinite(self.function.at(middle, self.p, self.s[touched.piece]))
        least = np.maximum(_WIDE * (high - low)[touched.piece], 1e6 * finest)
        wide = touched.where(known & loud & (touched.high - touched.low > least))
        lost = [(float(c.low.min()), float(c.high.max())) for c in (wide, unseen) if c.low.size]
        return Found(distinct(np.concatenate(times)), tuple(lost), bool(unseen.low.size))

    def _not_too_many(self, low: Floats, high: Floats) -> None:
        """End a search early that would find too many crossings: levels passed from one look to the next are as many.

        Raises
        ------
        TooMany
        """
        count = int(_SAMPLES * self.limit) if self.limit < _LARGE else 0
        if not count:
            return
        times = low[0] + (high[-1] - low[0]) * np.sort(np.mod(np.arange(count) * _GOLDEN, 1.0))
        piece = np.clip(np.searchsorted(low, times, side="right") - 1, 0, None)
        passed = self.levels.crossed(self.function.at(times, self.p, self.s[piece]))
        inside = (times < high[piece]) & np.isfinite(passed)
        same = (piece[1:] == piece[:-1]) & inside[1:] & inside[:-1]
        found = float(np.abs(np.diff(passed))[same].sum())
        if found > self.limit:
            raise TooMany(found)

    def _sorted(self, cells: Cells, finest: float) -> tuple[Cells, Cells, Cells, Cells]:
        """The cells in which there may be a crossing, in four kinds.

        Parameters
        ----------
        finest : float
            Shorter cells are not cut.

        Returns
        -------
        monotone : Cells
        hidden, doubtful : Cells
            Rounding hides the sign all over the cell, or at the few times at which it was looked at.
        left : Cells
            To be cut.
        """
        value, slope = self.function.bounds(cells.low, cells.high, self.p, self.s[cells.piece])
        some = self.levels.inside(value) & (np.maximum(np.abs(slope[0]), np.abs(slope[1])) > _ZERO)
        one = some & np.isfinite(value[0]) & np.isfinite(value[1]) & ((slope[0] > 0) | (slope[1] < 0))
        some &= ~one
        monotone, rest = cells.where(one), cells.where(some)
        value = self._by_mean_value(rest, _where(value, some), _where(slope, some))
        some = self.levels.inside(value)
        rest, value = rest.where(some), _where(value, some)
        doubtful, noise = self._looked_at(rest)
        middle = 0.5 * (rest.low + rest.high)
        short = (middle <= rest.low) | (middle >= rest.high) | (rest.high - rest.low <= finest)
        hidden = short | (doubtful & (value[1] - value[0] <= _NOISE * noise))
        doubtful &= ~hidden
        return monotone, rest.where(hidden), rest.where(doubtful), rest.where(~hidden & ~doubtful)

    def _looked_at(self, cells: Cells) -> tuple[np.ndarray, Floats]:
        """Whether rounding hides the sign at a few times of each cell, and how uncertain the values are there."""
        hidden, noise = np.ones(cells.low.size, dtype=bool), np.zeros(cells.low.size)
        for look in _LOOKS:
            some = np.flatnonzero(hidden)
            c = cells.where(some)
            bounds = self.function.bounds_at(c.low + look * (c.high - c.low), self.p, self.s[c.piece])
            hidden[some] = self.levels.inside(bounds)
            noise[some] = np.maximum(noise[some], bounds[1] - bounds[0])
        return hidden, noise

    def _by_mean_value(self, cells: Cells, value: Bounds, slope: Bounds) -> Bounds:
        """The bounds of the values inside g(m) + g'(cell)(cell - m), too, which is tighter on short cells."""
        middle = 0.5 * (cells.low + cells.high)
        at_middle = self.function.bounds_at(middle, self.p, self.s[cells.piece])
        steepest = np.maximum(np.abs(slope[0]), np.abs(slope[1]))
        with np.errstate(invalid="ignore"):  # what is not a number bounds nothing
            reach = 0.5 * (cells.high - cells.low) * steepest * (1 + 1e-12)
        around = np.nextafter(at_middle[0] - reach, -np.inf), np.nextafter(at_middle[1] + reach, np.inf)
        return np.fmax(value[0], around[0]), np.fmin(value[1], around[1])

    def _crossed(self, cells: Cells, before: int) -> tuple[Cells, Floats]:
        """A cell and the number of the level for every crossing of a function that is monotone on cells.

        They are counted from the values at the ends, before the time of any is looked for.

        Parameters
        ----------
        before : int
            How many have been found before.
        """
        if not cells.low.size:
            return cells, cells.low
        s = self.s[cells.piece]
        first, last = (self.levels.crossed(self.function.at(x, self.p, s)) for x in (cells.low, cells.high))
        with np.errstate(invalid="ignore"):
            count = np.nan_to_num(np.abs(last - first), nan=0.0, posinf=np.inf)
        if before + count.sum() > self.limit:
            raise TooMany(float(before + count.sum()))
        many = count.astype(int)
        cell = np.repeat(np.arange(many.size), many)
        number = np.arange(cell.size) - np.repeat(np.cumsum(many) - many, many) + 1 + np.minimum(first, last)[cell]
        return cells.where(cell), number

    def _first_beyond(self, cells: Cells, number: Floats) -> Floats:
        """The first double at which the level is crossed; each cell holds one crossing of one level.

        Newton's method comes near, a few doubles to either side hold the crossing, and bisection ends it.
        """
        low, high, s = cells.low, cells.high, self.s[cells.piece]
        level = self.levels.value(number)
        before = self.levels.crossed(self.function.at(low, self.p, s)) >= number

        def kept(x: Floats, values: Floats) -> tuple[Floats, Floats]:
            same = (self.levels.crossed(values) >= number) == before
            inside = (x > low) & (x < high)
            return np.where(inside & same, x, low), np.where(inside & ~same, x, high)

        x = 0.5 * (low + high)
        for _ in range(6):
            values, slopes = self.function.both(x, self.p, s)
            low, high = kept(x, values)
            with np.errstate(all="ignore"):
                x = x - (values - level) / slopes
            x = np.where((x >= low) & (x <= high), x, 0.5 * (low + high))
        for units in (2.0, 64.0, 2.0**14):
            for side in (-units, units):
                there = x + side * np.spacing(np.abs(x))
                low, high = kept(there, self.function.at(there, self.p, s))
        # near t = 0 doubles are finer than need be
        floor = 1e-3 * np.spacing(np.maximum(np.abs(cells.low), np.abs(cells.high)))
        for _ in range(80):
            middle = 0.5 * (low + high)
            if not np.any((middle > low) & (middle < high) & (high - low > floor)):
                break
            low, high = kept(middle, self.function.at(middle, self.p, s))
        return high


def _joined(cells: Cells) -> Cells:
    """Neighbouring cells of a piece as one."""
    if not cells.low.size:
        return cells
    ordered = cells.where(np.lexsort((cells.low, cells.piece)))
    new = (ordered.low[1:] != ordered.high[:-1]) | (ordered.piece[1:] != ordered.piece[:-1])
    first = np.concatenate([[True], new])
    return Cells(ordered.low[first], ordered.high[np.concatenate([new, [True]])], ordered.piece[first])
