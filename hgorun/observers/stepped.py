"""Observers that step from one measurement to the next, whether the output is sampled or continuous."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from hgorun.observers.base import Arrival, CorrectedObserver, DecidedObserver
from hgorun.observers.common import CopyT, FormT
from hgorun.symbolic.symbols import Symbols


class SteppedObserver(CorrectedObserver[FormT, CopyT], DecidedObserver[FormT, CopyT]):
    """Base of the observers that are corrected by samples, and take samples of continuous outputs themselves.

    A continuous output is measured at the end of every step of the solver, which is the period then and has to be
    given. :meth:`correct` gets these samples like any others; it has to leave the observer as it is when it is called
    again at the same time.
    """

    def decide(self, plant: CopyT, s: Symbols, e: ca.SX, k: Symbols) -> Mapping[str, ca.SX]:
        """Asked for where outputs are continuous: the innovation is that of now."""
        y = plant.output(self.estimate(s, k)) - e
        return self.correct(plant, s, Arrival(y, ca.SX.ones(y.shape)), k)
