"""When a trajectory passes what is narrow in its states, and which of it no evaluation has seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.pieces import distinct
from hgorun.symbolic.curves import Curve
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.features import Feature

_ROUNDING = 1e-12  # of a run


@dataclass(frozen=True, eq=False)
class Passages:
    """When a curve passes features of one block of states.

    Attributes
    ----------
    switches : ndarray
        Of those that have levels, in ascending order.
    jumps : ndarray
        Of those among them at which equations are not continuous.
    peaks : ndarray
        Of those between the times at which the equations were evaluated.
    """

    switches: Floats
    jumps: Floats
    peaks: Floats

    @classmethod
    def of(cls, features: Sequence[Feature], curve: Curve, p: Floats, seen: Floats, step: int = 1) -> Passages:
        """Those of a curve.

        Parameters
        ----------
        seen : ndarray
            The times of evaluation, in ascending order.
        step : int
            How many cells a step may be as long as.
        """
        switches, jumps, peaks = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
        for feature in features:
            times = feature.found(curve, p, step)
            if feature.levels is not None:
                switches.append(times)
                jumps += [times] if feature.jump else []
            elif times.size:
                after = np.clip(np.searchsorted(seen, times), 1, seen.size - 1)
                alone = np.all([feature.differs(curve, p, times, seen[k]) for k in (after - 1, after)], axis=0)
                peaks.append(times[alone])
        return cls(*(distinct(np.concatenate(times)) for times in (switches, jumps, peaks)))

    def narrow(self, seen: Floats, longest: float = np.inf) -> Floats:
        """The ends of what lies between two evaluations; what lasts longer than ``longest`` does not."""
        return distinct(np.concatenate([between(self.switches, seen, longest), self.peaks]))


def between(times: Floats, seen: Floats, longest: float = np.inf) -> Floats:
    """Those of some times, in ascending order, that follow one another without an evaluation between them.

    Where a trajectory begins at what is narrow, as a motor at rest does with its friction, it does not pass it: that
    it is found a moment later is rounding.
    """
    times = times[times > seen[0] + _ROUNDING * (seen[-1] - seen[0])]
    empty = np.searchsorted(seen, times[:-1], side="left") == np.searchsorted(seen, times[1:], side="right")
    narrow = empty & (np.diff(times) < longest)
    return distinct(np.concatenate([times[:-1][narrow], times[1:][narrow]]))
