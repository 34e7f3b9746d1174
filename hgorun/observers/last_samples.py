"""What observers share that keep the last samples: a window of them, with their ages."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from hgorun.observers.base import Arrival, Flow, Role
from hgorun.symbolic.derivatives import DerivativeCopy, DerivativeForm
from hgorun.symbolic.symbols import Symbols


class LastSamples:
    """The last ``window`` samples y, the newest one first, how old they are, and 1 where there is one.

    Between samples nothing but the ages changes.
    """

    window: int

    def states(self, form: DerivativeForm) -> dict[str, np.ndarray]:
        """All of them zero at the start."""
        return {name: np.zeros(self.window) for name in ("y", "age", "there")}

    def roles(self, form: DerivativeForm) -> Mapping[str, Role]:
        """What of this scales like a signal."""
        return {"y": "signal", "age": "gain", "there": "gain"}

    def with_newest(self, s: Symbols, arrival: Arrival) -> tuple[ca.SX, ca.SX, ca.SX]:
        """y, age and there once a sample has arrived: a second one at the same time takes the place of the first."""
        again = ca.logic_and(s.there[0] > 0, s.age[0] <= 0)
        y, age, there = (
            ca.if_else(again, ca.vertcat(new, past[1:]), ca.vertcat(new, past[:-1]))
            for new, past in ((arrival.y, s.y), (ca.SX(0), s.age), (arrival.fresh, s.there))
        )
        return y, age, there

    def equations(self, plant: DerivativeCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        """Samples that are there grow older."""
        still = {name: ca.SX.zeros(value.shape) for name, value in vars(s).items() if name in ("xhat", "y", "there")}
        return Flow(still | {"age": s.there}, correction=ca.SX.zeros(1))
