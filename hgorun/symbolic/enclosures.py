"""Where the values of a function of a vector lie on boxes, and the largest of them: by interval arithmetic."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.symbolic.instructions import Instruction, read
from hgorun.symbolic.intervals import Bounds, enclose


@dataclass(frozen=True, eq=False, repr=False)
class Enclosure:
    """A function of a vector, evaluated on boxes.

    Parameters
    ----------
    function : casadi.Function
        One vector in, one dense column of numbers out, made of SX.
    """

    function: ca.Function

    @cached_property
    def _instructions(self) -> list[Instruction]:
        """Read once for all boxes."""
        return read(self.function)

    def each(self, low: np.ndarray, high: np.ndarray) -> Bounds:
        """Bounds (M, m) of the m values on M boxes with corners low and high, shapes (M, d)."""
        (found,) = enclose(
            self.function, lambda _, column: (low[:, column], high[:, column]), instructions=self._instructions
        )
        sides = tuple(np.zeros((low.shape[0], len(found))) for _ in range(2))
        for column, bounds in enumerate(found):
            for side, value in zip(sides, bounds, strict=True):
                side[:, column] = value
        return sides[0], sides[1]

    def __call__(self, low: np.ndarray, high: np.ndarray) -> Bounds:
        """Bounds (M,) of the only value."""
        smallest, largest = self.each(low, high)
        return smallest[:, 0], largest[:, 0]

    def at(self, points: np.ndarray) -> np.ndarray:
        """The values (M,) at M points (M, d)."""
        return np.asarray(self.function(ca.DM(points.T)).full()).ravel()


@dataclass(frozen=True, eq=False, repr=False)
class Extent:
    """The largest modulus of a function on a box: it lies between ``reached`` and ``bound``."""

    bound: float
    reached: float


def largest(
    function: ca.Function, low: np.ndarray, high: np.ndarray, *, limit: int = 4096, gap: float = 0.01
) -> Extent:
    """Enclose the largest modulus of a function on a box by cutting the box into ever smaller ones.

    Parameters
    ----------
    function : casadi.Function
        One vector (d,) in, one number out.
    low, high : ndarray, shape (d,)
    limit : int
        Boxes looked at, together, at most.
    gap : float
        Good enough: bound <= (1 + gap) reached.
    """
    enclosure = Enclosure(function)
    lows, highs = low[None, :].astype(float), high[None, :].astype(float)
    closed = reached = 0.0
    matters = np.zeros(low.size, dtype=bool)
    matters[list(function.jac_sparsity(0, 0).get_col())] = True
    for turn in range(60):
        inner, outer = enclosure(lows, highs)
        bounds = np.maximum(np.abs(inner), np.abs(outer))
        middles = enclosure.at(0.5 * (lows + highs))
        reached = max(reached, float(np.max(np.abs(middles), initial=0.0, where=np.isfinite(middles))))
        open_ = bounds > (1 + gap) * reached
        closed = max(closed, float(np.max(bounds[~open_], initial=0.0)))
        widths = np.where(matters, highs - lows, 0.0)
        if not open_.any() or 2 * open_.sum() > limit or not np.any(widths[open_] > 0):
            return Extent(max(closed, float(np.max(bounds[open_], initial=0.0))), reached)
        lows, highs, widths = lows[open_], highs[open_], widths[open_]
        # every direction in turn, so that none is left out for being short
        order = np.flatnonzero(np.any(widths > 0, axis=0))
        j = order[turn % order.size]
        middle = 0.5 * (lows[:, j] + highs[:, j])
        left, right = highs.copy(), lows.copy()
        left[:, j], right[:, j] = middle, middle
        lows, highs = np.vstack([lows, right]), np.vstack([left, highs])
    inner, outer = enclosure(lows, highs)
    return Extent(max(closed, float(np.max(np.maximum(np.abs(inner), np.abs(outer)), initial=0.0))), reached)
