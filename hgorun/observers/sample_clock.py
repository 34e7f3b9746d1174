"""The time since the last sample of every output, for observers whose correction depends on it."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from hgorun.observers.base import Arrival, CorrectedObserver, Role
from hgorun.observers.common import CopyT, FormT
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


class SampleClock(CorrectedObserver[FormT, CopyT]):
    """Base of the observers that are corrected with the time T since the sample of the same output before.

    T is a state, ``age``, that grows with time and is set to zero at a sample: with lost, late and replayed samples it
    is the time between those that the observer has taken in. It counts from the start of the run.
    """

    def states(self, form: FormT) -> Mapping[str, np.ndarray | Symmetric]:
        return {"age": np.zeros(len(form.plant.outputs))}

    def roles(self, form: FormT) -> Mapping[str, Role]:
        return {**super().roles(form), "age": "gain"}

    def ticking(self, s: Symbols) -> ca.SX:
        """age'."""
        return ca.SX.ones(s.age.shape)

    def due(self, s: Symbols, arrival: Arrival) -> tuple[ca.SX, ca.SX]:
        """1 for the outputs whose sample arrives some time after another, 0 for the others; and T, shapes (q,)."""
        later = s.age > 0
        return later * arrival.fresh, ca.if_else(later, s.age, 1)

    def passed(self, s: Symbols, arrival: Arrival) -> ca.SX:
        """age after samples."""
        return (1 - arrival.fresh) * s.age
