"""Times at which a step of a run ends, although nothing happens then."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hgorun.engine.plan import Floats


class Breaks(Protocol):
    """Such times of a run whose events are not known before they happen."""

    @property
    def settled(self) -> float:
        """From then on there is none."""
        ...

    def between(self, t: float, end: float) -> Iterator[float]:
        """Those between two times, ascending."""
        ...

    def clear(self, t: float) -> tuple[float, float]:
        """Between these there is none, as far as is looked; a time before ``settled`` that is not between is one."""
        ...

    def inward(self, t: float) -> float:
        """How far from there functions of time are evaluated, so that they show one side of a kink or jump."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class Early:
    """Times close behind the start: the first steps are shorter than others.

    Attributes
    ----------
    times : ndarray
        Ascending.
    apart : float
        As close to the ends of a flow one of them counts as such an end.
    """

    times: Floats
    apart: float

    @property
    def settled(self) -> float:
        """From then on there is none."""
        return float(self.times[-1]) if self.times.size else -np.inf

    def between(self, t: float, end: float) -> Iterator[float]:
        """Those between two times, ascending."""
        first = np.searchsorted(self.times, t + self.apart, side="right")
        yield from self.times[first : np.searchsorted(self.times, end - self.apart)].tolist()

    def clear(self, t: float) -> tuple[float, float]:
        """From the one before, or at, a time up to the next one."""
        k = int(np.searchsorted(self.times, t, side="right"))
        low = float(np.nextafter(self.times[k - 1], -np.inf)) if k else -np.inf
        return low, float(self.times[k]) - self.apart if k < self.times.size else np.inf

    def inward(self, t: float) -> float:  # nothing breaks
        """No function of time breaks."""
        return 0.0


NONE = Early(np.zeros(0), 0.0)
