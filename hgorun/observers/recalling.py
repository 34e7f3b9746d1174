"""Observers that look back at signals of their own, besides what the innovation compares."""

from __future__ import annotations

from abc import abstractmethod

import casadi as ca

from hgorun.observers.base import ContinuousObserver, PeriodLimit
from hgorun.observers.common import CopyT, FormT
from hgorun.symbolic.symbols import Symbols

LAGS = "lags"  # among the numbers of a design: how far each signal is looked back at


class RecallingObserver(ContinuousObserver[FormT, CopyT]):
    """Base of the observers whose equations hold some of their own signals as they were a constant time before.

    Their :meth:`design` gives ``lags``, shape (M,), the times above zero by which each of the M signals is looked back
    at. ``s.past`` of :meth:`~ContinuousObserver.equations`, shape (M, 1), are the signals as they were then, and before
    the start of the run what they were at the start. What arrives is compared at once with :meth:`compared`, late
    as it may be: that is what such an observer does about delays.
    """

    @abstractmethod
    def longest_delay(self, form: FormT) -> PeriodLimit:
        """The longest delay of the outputs at which the error decays on chains of integrators, phi = 0."""

    @abstractmethod
    def signals(self, plant: CopyT, s: Symbols, k: Symbols) -> ca.SX:
        """What is looked back at, shape (M, 1)."""

    @abstractmethod
    def compared(self, plant: CopyT, s: Symbols, k: Symbols) -> ca.SX:
        """The outputs that are compared with what arrives, shape (q, 1)."""
