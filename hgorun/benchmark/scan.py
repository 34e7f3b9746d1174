"""What is tried of a knob: values all over its range, then a search around the best of them.

The search is a compass search. It stands on a value, with a distance that is at first half of that between two values
of the range. A distance to either side is tried; it goes on to the better of the two where that beats the value it
stands on, and halves the distance where neither does. The last two values are those where a parabola through the best
and its two neighbours is least, so that what is found does not depend on where the others happened to lie. All are
compared on the same seeds, so that which one is better does not depend on luck between them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from hgorun.benchmark.parabolas import Floats, vertices
from hgorun.config.benchmark import Knob

_FINEST = 1 / 64  # of the distance between two values all over the range: nothing closer is tried
_PARABOLAS = 2  # values that are found by them
_SAME = 1e-3  # relative: closer values are not told apart
_SIDES = 3  # a value and its two neighbours


@dataclass(frozen=True)
class Scan:
    """The range of a knob on a plant, on which places run from 0 to 1.

    Attributes
    ----------
    knob : Knob
    rate : float
        Of the plant, 1/time.
    """

    knob: Knob
    rate: float = 1.0

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the largest value."""
        low, high = np.array(self.knob.range.ends) * (self.rate if self.knob.rate else 1.0)
        return float(low), float(high)

    def at(self, places: Floats) -> Floats:
        """The values at some places, whole numbers where it is one."""
        low, high = self.ends
        values = low * (high / low) ** places if self.knob.range.log else low + (high - low) * places
        values = np.where(places == 1.0, high, values)
        return np.asarray(np.round(values) if self.knob.whole else values)

    def coarse(self, count: int) -> Floats:
        """So many places all over the range, without those whose values are there already."""
        places = np.linspace(0.0, 1.0, count)
        _, first = np.unique(self.at(places), return_index=True)
        return np.asarray(places[np.sort(first)])

    def is_end(self, value: float) -> bool:
        """Whether a value is an end of the range, beyond which better ones may lie."""
        return bool(np.any(np.isclose(value, self.at(np.array([0.0, 1.0])), rtol=1e-9)))


@dataclass(eq=False)
class Search:
    """A compass search on a range.

    Attributes
    ----------
    scan : Scan
    errors_of : callable
        The errors of N values with every seed, shape (N, seeds); infinite where the estimate was lost.
    tried : dict of float to ndarray, shape (seeds,)
        Values and their errors.
    """

    scan: Scan
    errors_of: Callable[[Floats], Floats]
    tried: dict[float, Floats] = field(default_factory=dict)

    def around(self, place: float, spacing: float, count: int) -> float:
        """The best of so many values, beginning at a place, with a distance of half the spacing.

        A value tried has no better neighbour at the last distance, unless the search ends before it is found.
        """
        distance, by_compass = spacing / 2, max(count - _PARABOLAS, _SIDES)
        self._try(np.array([place, place - distance, place + distance]), count)
        while len(self.tried) < by_compass and distance >= _FINEST * spacing:
            here = self._error(place)
            sides = np.clip([place - distance, place + distance], 0.0, 1.0)
            errors = [self._error(side) for side in sides]
            if min(errors) < here:
                place = float(sides[int(np.argmin(errors))])
            else:
                distance /= 2
            self._try(np.array([place - distance, place + distance]), by_compass)
        for _ in range(_PARABOLAS):
            vertex = self._vertex()
            if np.isclose(vertex, list(self.tried), rtol=_SAME, atol=0).any():
                break
            self._try_values([vertex], count)
        return min(self.tried, key=lambda value: float(self.tried[value].mean()))

    def _error(self, place: float) -> float:
        """The mean over the seeds at a place; infinite where it has not been tried."""
        errors = self.tried.get(float(self.scan.at(np.array([place]))[0]))
        return np.inf if errors is None else float(errors.mean())

    def _vertex(self) -> float:
        """Where the parabola through the best value and its neighbours is least."""
        values = np.array(sorted(self.tried))
        means = np.array([self.tried[value].mean() for value in values.tolist()])
        ((best,), _) = vertices(values, means[:, None])
        return float(np.round(best) if self.scan.knob.whole else best)

    def _try(self, places: Floats, count: int) -> None:
        """Those of some places that are new, as many as may still be tried."""
        self._try_values(self.scan.at(np.clip(places, 0.0, 1.0)).tolist(), count)

    def _try_values(self, values: Sequence[float], count: int) -> None:
        new = [value for value in dict.fromkeys(values) if value not in self.tried][: max(count - len(self.tried), 0)]
        if new:
            self.tried.update(zip(new, self.errors_of(np.array(new)), strict=True))
