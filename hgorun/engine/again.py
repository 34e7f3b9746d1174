"""Flows that are made again with shorter steps, where those that were asked for lose an observer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.engine.layout import HybridSystem
from hgorun.engine.plan import Floats

_DOUBLINGS, _MOST = 10, 1 << 20  # of the steps of a flow: an observer that is lost with the last is so with any steps
_BEYOND = 1e12  # times all that there is at the start


@dataclass(frozen=True, eq=False, repr=False)
class Again:
    """Which observers a flow has lost: what it follows from is known at the start of a run.

    Each that is lost becomes what the fewest steps give that do not lose it; nothing else changes.

    Attributes
    ----------
    blocks : sequence of (start, stop, end)
        As those of :class:`~hgorun.engine.layout.HybridSystem`.
    bound : float
        An observer is lost whose states are beyond it, or no numbers.
    """

    blocks: Sequence[tuple[int, int, int]]
    bound: float

    @classmethod
    def of(cls, system: HybridSystem, start: Floats) -> Again:
        """Of a run that begins with these states."""
        known = np.abs(start[np.isfinite(start)])
        return cls(system.blocks, _BEYOND * float(np.max(known, initial=1.0)))

    def more(self, steps: int) -> Iterator[int]:
        """How many times the steps of a flow are tried that has so many, one after the other."""
        return (1 << k for k in range(1, _DOUBLINGS + 1) if steps << k <= _MOST)

    def lost(self, z: Floats) -> frozenset[int]:
        """The numbers of those that are lost."""
        return frozenset(
            j for j, (start, stop, _) in enumerate(self.blocks) if not np.all(np.abs(z[start:stop]) <= self.bound)
        )
