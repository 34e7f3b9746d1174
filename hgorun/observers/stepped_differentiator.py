"""Differentiators that are recursions of samples."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping

import casadi as ca
import numpy as np

from hgorun.observers.base import Arrival, Flow, Role
from hgorun.observers.capabilities import NO_MODEL, Differentiator, Punctual
from hgorun.observers.stepped import SteppedObserver
from hgorun.symbolic.derivatives import DerivativeCopy, DerivativeForm, derivative_form
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols

_OTHERS = "alpha", "past"  # what equations find beside the states that they are for


class SteppedDifferentiator(Punctual, Differentiator, SteppedObserver[DerivativeForm, DerivativeCopy]):
    """Base of the differentiators that are recursions of samples; between them they hold still.

    What uses the sample y_k and the states of t_k is the estimate of t_(k+1), and is taken on when the sample k + 1
    arrives. A recursion that is :attr:`implicit` uses the sample that arrives, the first of them after the time since
    the start. The step is the time between samples: where one is lost, the next step is longer.
    """

    because = "a relay with a delay ends in a limit cycle"
    lacks = NO_MODEL

    form = staticmethod(derivative_form)

    @property
    def implicit(self) -> bool:
        """Whether a step uses the sample at its end."""
        return False

    @abstractmethod
    def advanced(self, s: Symbols, y: ca.SX, h: ca.SX, k: Symbols) -> Mapping[str, ca.SX]:
        """The states a step of length h later.

        Parameters
        ----------
        y : casadi.SX, shape (1,)
            The sample at the start of the step, at its end if it is :attr:`implicit`.
        """

    def states(self, form: DerivativeForm) -> Mapping[str, np.ndarray | Symmetric]:
        clock = {"age": np.zeros(1)}
        return clock if self.implicit else {**clock, "y": np.zeros(1), "seen": np.zeros(1)}

    def roles(self, form: DerivativeForm) -> dict[str, Role]:
        own: dict[str, Role] = {"age": "gain"} if self.implicit else {"age": "gain", "y": "signal", "seen": "gain"}
        return {**super().roles(form), **own}

    def equations(self, plant: DerivativeCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        still = {name: ca.SX.zeros(value.shape) for name, value in vars(s).items() if name not in _OTHERS}
        return Flow(still | {"age": ca.SX.ones(1)}, correction=ca.SX.zeros(1))

    def correct(self, plant: DerivativeCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        due = ca.logic_and(arrival.fresh > 0, s.age > 0)
        h = ca.if_else(s.age > 0, s.age, 1)
        clock = {"age": ca.if_else(arrival.fresh, 0, s.age)}
        if self.implicit:
            new = self.advanced(s, arrival.y, h, k)
        else:
            due = ca.logic_and(due, s.seen > 0)
            new = self.advanced(s, s.y, h, k)
            clock["y"] = ca.if_else(arrival.fresh, arrival.y, s.y)
            clock["seen"] = ca.fmax(arrival.fresh, s.seen)
        return {name: ca.if_else(due, value, vars(s)[name]) for name, value in new.items()} | clock
