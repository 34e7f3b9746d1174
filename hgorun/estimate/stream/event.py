"""What happens at a time while samples are followed as they come."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

Places: TypeAlias = tuple[tuple[int, int], ...]  # output, slot
Samples: TypeAlias = tuple[tuple[int, int, float], ...]  # output, slot, value
Inputs: TypeAlias = tuple[tuple[int, float], ...]  # input, value


@dataclass(eq=False, repr=False, slots=True)
class Event:
    """What happens at a time; one is made for every sample, which a frozen class would do in three times the time.

    Attributes
    ----------
    t : float
    take : tuple of (output, slot)
        What of the estimates is kept for samples that come later.
    samples : tuple of (output, slot, value)
        What arrives.
    inputs : tuple of (input, value)
        What changes.
    taken : float
        When the samples were measured.
    """

    t: float
    take: Places = ()
    samples: Samples = ()
    inputs: Inputs = ()
    taken: float = math.nan

    def joined(self, other: Event) -> Event:
        """With the samples and inputs of another event at the same time."""
        take, samples = sorted(self.take + other.take), sorted(self.samples + other.samples)
        return Event(self.t, tuple(take), tuple(samples), self.inputs + other.inputs, self.taken)

    def told(self) -> list[Any]:
        """For a checkpoint."""
        return [self.t, self.take, self.samples, self.inputs, self.taken]

    @classmethod
    def of(cls, told: Sequence[Any]) -> Event:
        """From what :meth:`told` gave, read back from JSON."""
        t, take, samples, inputs, taken = told
        return cls(
            t,
            tuple((int(i), int(slot)) for i, slot in take),
            tuple((int(i), int(slot), float(value)) for i, slot, value, *_ in samples),  # older checkpoints told more
            tuple((int(i), float(value)) for i, value in inputs),
            taken,
        )
