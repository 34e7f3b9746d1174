"""A run as tables: segments between events, what happens at events, where output is wanted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Plan:
    """Everything of a run that is known before it starts.

    Attributes
    ----------
    spans : ndarray, shape (segments, 4)
        Start and end of each segment, and the times at which functions of time are evaluated there: a few
        ulp inside where such a function has a kink or a jump.
    counts : ndarray of int64, shape (segments, 7)
        Number of equal steps between the two events, the first and last step of this piece of them,
        regime, range of actions, and whether the slope at the end is needed.
    actions : ndarray of int64, shape (actions, 5)
        Kind, output, slot or index, and a range of slots.
    grid : ndarray, shape (rows,)
        Output times.
    slots : int
        Samples on their way, over all outputs.
    gain, bias : ndarray, shape (slots,)
        A measured sample is gain * output + bias.
    holds : ndarray, shape (hold values,)
        Successive values of held noise.
    reach : float
        The longest continuous delay.
    origin : float
        What is added to a time where it is told to somebody.
    """

    spans: Floats
    counts: Integers
    actions: Integers
    grid: Floats
    slots: int
    gain: Floats
    bias: Floats
    holds: Floats
    reach: float = 0.0
    origin: float = 0.0

    @property
    def steps(self) -> int:
        """Steps of the whole run (fixed step)."""
        return int(np.sum(self.counts[:, 2] - self.counts[:, 1]))
