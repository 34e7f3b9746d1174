"""What has been tried of a knob, and what is tried next."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hgorun.config.benchmark import Knob

Floats = NDArray[np.float64]


@dataclass(eq=False)
class Scan:
    """Values of a knob with the mean errors that belong to them.

    Attributes
    ----------
    knob : Knob
    rate : float
        Of the plant, 1/time.
    values, errors : ndarray, shape (N,)
        What has been tried; an error is infinite where an estimate was lost with any seed.
    """

    knob: Knob
    rate: float = 1.0
    values: Floats = field(default_factory=lambda: np.empty(0))
    errors: Floats = field(default_factory=lambda: np.empty(0))

    def coarse(self, count: int) -> Floats:
        """Values all over the range."""
        low, high = np.array(self.knob.range.ends) * (self.rate if self.knob.rate else 1.0)
        return self._between(low, high, count)

    def around_best(self, count: int) -> Floats:
        """The best value so far and others between its neighbours."""
        order = np.argsort(self.values)
        at = int(np.flatnonzero(order == np.argmin(self.errors))[0])
        low, high = (self.values[order[np.clip(at + d, 0, order.size - 1)]] for d in (-1, 1))
        return np.union1d(self._between(low, high, count), self.best)

    def _between(self, low: float, high: float, count: int) -> Floats:
        values = np.geomspace(low, high, count) if self.knob.range.log else np.linspace(low, high, count)
        return np.unique(np.round(values)) if self.knob.whole else np.unique(values)

    def add(self, values: Floats, errors: Floats) -> None:
        """Mean errors at values."""
        self.values, self.errors = np.append(self.values, values), np.append(self.errors, errors)

    def begin_again(self) -> Scan:
        """Nothing tried: means over other seeds are not compared with those of before."""
        return Scan(self.knob, self.rate)

    @property
    def best(self) -> float:
        """The value with the smallest error."""
        return float(self.values[np.argmin(self.errors)])

    def is_end(self, value: float) -> bool:
        """Whether a value is an end of the range, beyond which better ones may lie."""
        ends = self.coarse(2)
        return bool(np.any(np.isclose(value, ends, rtol=1e-9)))
