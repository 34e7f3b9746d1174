"""The values whose crossings are looked for: zero, whole numbers, or a list."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.interval_operations import Bounds


@dataclass(frozen=True, eq=False, repr=False)
class Levels:
    """The values whose crossings are looked for, numbered in ascending order.

    Attributes
    ----------
    below, up_to : callable
        How many of them lie below each value, and how many do not lie above it; from any origin.
    value : callable
        Level number k: the one that is reached when k are up to there.
    reached : bool
        Whether a level counts as crossed when it is reached (as for ``floor``), or only above it (``ceil``).
    """

    below: Callable[[Floats], np.ndarray]
    up_to: Callable[[Floats], np.ndarray]
    value: Callable[[Floats], np.ndarray]
    reached: bool

    def inside(self, bounds: Bounds) -> np.ndarray:
        """Whether a level lies within each pair of bounds."""
        return np.asarray(self.up_to(bounds[1]) > self.below(bounds[0]))

    def crossed(self, values: Floats) -> np.ndarray:
        """The number of levels crossed when the function has come from below to each value."""
        return self.up_to(values) if self.reached else self.below(values)


def zero(*, reached: bool) -> Levels:
    """The level 0."""
    return Levels(lambda v: (v > 0) * 1.0, lambda v: (v >= 0) * 1.0, np.zeros_like, reached)


def integers(*, reached: bool) -> Levels:
    """All whole numbers."""
    return Levels(lambda v: np.ceil(v) - 1, np.floor, lambda k: k, reached)


def listed(values: Floats, *, reached: bool) -> Levels:
    """Given values, in ascending order."""
    return Levels(
        lambda v: np.searchsorted(values, v, side="left").astype(float),
        lambda v: np.searchsorted(values, v, side="right").astype(float),
        lambda k: values[k.astype(int) - 1],
        reached,
    )
