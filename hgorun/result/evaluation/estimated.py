"""The estimates of a run's observers, or what they estimate, where the engine has written them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False, repr=False)
class Estimated:
    """The estimates of m observers, or the m truths that they estimate, which are columns of one array.

    Attributes
    ----------
    values : ndarray, shape (Nt, any)
    places : sequence of sequence of int
        Of every observer the columns of the n states.
    """

    values: np.ndarray
    places: Sequence[Sequence[int]]

    @classmethod
    def same(cls, x: np.ndarray, count: int) -> Estimated:
        """So many times the same, from an array of shape (Nt, n)."""
        return cls(x, [range(x.shape[1])] * count)

    @classmethod
    def of_stack(cls, xhat: np.ndarray) -> Estimated:
        """Of an array of shape (Nt, m, n)."""
        count, m, n = xhat.shape
        places = [range(j * n, (j + 1) * n) for j in range(m)]
        return cls(np.ascontiguousarray(xhat, dtype=float).reshape(count, m * n), places)

    def stack(self) -> np.ndarray:
        """An array of shape (Nt, m, n) in the order of C."""
        places = np.asarray(self.places, dtype=int)
        return np.take(self.values, places.ravel(), axis=1).reshape(len(self.values), *places.shape)

    def distinct(self) -> np.ndarray:
        """Those that differ, an array of shape (Nt, m, n), or (Nt, 1, n) where all are the same columns."""
        same = all(list(places) == list(self.places[0]) for places in self.places)
        return Estimated(self.values, self.places[:1] if same else self.places).stack()

    def of(self, observer: int) -> np.ndarray:
        """The estimates of one observer, shape (Nt, n): a view where its columns are neighbours."""
        return columns_of(self.values, self.places[observer])

    def finite(self) -> bool:
        """Whether everything in the array is finite; False, too, where numbers are so large that their sum is not."""
        with np.errstate(over="ignore", invalid="ignore"):
            return bool(np.isfinite(self.values.sum()))

    def at(self, points: slice) -> Estimated:
        """Those at some of the times, which do not keep the others in memory."""
        return Estimated(np.ascontiguousarray(self.values[points]), self.places)


def columns_of(values: np.ndarray, places: Sequence[int]) -> np.ndarray:
    """Some columns of an array, without copying them where they are neighbours."""
    first, stop = places[0], places[-1] + 1
    return values[:, first:stop] if list(places) == list(range(first, stop)) else np.take(values, places, axis=1)
