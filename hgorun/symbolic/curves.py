"""A trajectory between the times at which it is known: a cubic on every cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.symbolic.evaluate import Floats

_BEYOND = 0.32  # of what four values differ by: no cubic through them goes further


@dataclass(frozen=True, eq=False)
class Curve:
    """A trajectory: a cubic on every cell of time.

    Attributes
    ----------
    low, high : ndarray, shape (cells,)
    coefficients : ndarray, shape (cells, states, 4)
        Of 1, r, r^2 and r^3, where r goes from 0 to 1 on each cell.
    least, most : ndarray, shape (cells, states)
        Bounds of the states on each cell.
    """

    low: Floats
    high: Floats
    coefficients: Floats
    least: Floats
    most: Floats

    @classmethod
    def through(cls, low: Floats, high: Floats, values: Floats) -> Curve:
        """From the states at the start, at a third, at two thirds and at the end of every cell, (cells, 4, states)."""
        whole = np.all(np.isfinite(values), axis=(1, 2)) & (high > low)
        thirds = np.array([[0.0, 0.0, 0.0], [1, 1, 1], [2, 4, 8], [3, 9, 27]]) / np.array([3, 9, 27])
        inverse = np.linalg.inv(np.column_stack([np.ones(4), thirds]))
        values = values[whole]
        least, most = values.min(axis=1), values.max(axis=1)
        beyond = _BEYOND * (most - least)
        coefficients = np.einsum("kj,cjs->csk", inverse, values)
        return cls(low[whole], high[whole], coefficients, least - beyond, most + beyond)

    def where(self, chosen: np.ndarray) -> Curve:
        """The cells that are chosen."""
        parts = (self.low, self.high, self.coefficients, self.least, self.most)
        return Curve(*(part[chosen] for part in parts))

    def at(self, times: Floats) -> np.ndarray:
        """The cells in which times lie."""
        return np.clip(np.searchsorted(self.low, times, side="right") - 1, 0, None)
