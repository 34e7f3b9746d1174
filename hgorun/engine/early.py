"""Steps close behind the start of a run that are shorter than others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.engine.plan import Floats


@dataclass(frozen=True, eq=False, repr=False)
class Early:
    """Times close behind the start at which a step ends, whatever happens.

    Attributes
    ----------
    times : ndarray
        Ascending.
    apart : float
        As close to the ends of a flow one of them counts as such an end.
    """

    times: Floats
    apart: float

    def between(self, t: float, end: float) -> Floats:
        """Those between two times."""
        first = np.searchsorted(self.times, t + self.apart, side="right")
        return self.times[first : np.searchsorted(self.times, end - self.apart)]


NONE = Early(np.zeros(0), 0.0)
