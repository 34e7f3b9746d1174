"""What an observer asks of the times of its samples, one small base class each.

They are beside those in :mod:`hgorun.observers.capabilities`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np

from hgorun.config.types import Block


class EvenSamples(Block):
    """Derivatives that are right where the samples are even."""

    @property
    @abstractmethod
    def even_only(self) -> bool:
        """Whether those from the second on are not, on other samples, with the keys that are given."""


class OnePeriod(Block):
    """A step from sample to sample that is that of one period: no sample can be left out."""

    @abstractmethod
    def one_period(self, form: Any) -> float:
        """That of which it is."""


class BeginsWithASample(Block):
    """An observer with states that belong to the first sample, whose time a stream does not know before."""

    @property
    @abstractmethod
    def begins(self) -> float:
        """When that is due, counted from the start of the run: for then the states at the start are meant."""

    @abstractmethod
    def begun(self, form: Any, xhat: np.ndarray) -> Mapping[str, np.ndarray]:
        """These states where the first sample comes at another time, from the estimate then, shape (n,)."""
