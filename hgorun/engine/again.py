"""Flows that are made again with shorter steps, where those that were asked for lose an observer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.engine.layout import HybridSystem
from hgorun.engine.memory import Memory
from hgorun.engine.plan import Floats

_DOUBLINGS, _MOST = 10, 1 << 20  # of the steps of a flow: an observer that is lost with the last is so with any steps


@dataclass(frozen=True, eq=False, repr=False)
class Again:
    """Which observers a flow has lost.

    Each that is lost becomes what the fewest steps give that do not lose it; nothing else changes.

    Attributes
    ----------
    blocks : sequence of (start, stop, end)
        As those of :class:`~hgorun.engine.layout.HybridSystem`.
    """

    blocks: Sequence[tuple[int, int, int]]

    @classmethod
    def of(cls, system: HybridSystem) -> Again:
        """Of a run of a system."""
        return cls(system.blocks)

    def more(self, steps: int) -> Iterator[int]:
        """How many times the steps of a flow are tried that has so many, one after the other."""
        return (1 << k for k in range(1, _DOUBLINGS + 1) if steps << k <= _MOST)

    @staticmethod
    def bound(memory: Memory) -> float:
        """Beyond that an observer has diverged by now."""
        return memory.real("bound_offset") + memory.real("bound_factor") * float(memory.arrays["largest"][0])

    def lost(self, z: Floats, bound: float) -> frozenset[int]:
        """The numbers of those whose states are beyond a bound, or no numbers."""
        return frozenset(
            j for j, (start, stop, _) in enumerate(self.blocks) if not np.all(np.abs(z[start:stop]) <= bound)
        )
