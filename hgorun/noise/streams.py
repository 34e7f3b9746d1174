"""The random numbers of many runs: a generator each, a child of its seed, all named alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hgorun.noise.normal import standard_normal


@dataclass(frozen=True, eq=False, repr=False)
class Streams:
    """Generators of several seeds.

    Attributes
    ----------
    seeds : ndarray of int64, shape (N,)
        Not negative.
    key : tuple of int
        The name of the child, the same for all: words of 32 bits.
    """

    seeds: NDArray[np.int64]
    key: tuple[int, ...]

    def __len__(self) -> int:
        return int(self.seeds.size)

    def generator(self, i: int) -> np.random.Generator:
        """That of one of the seeds."""
        sequence = np.random.SeedSequence(int(self.seeds[i]), spawn_key=self.key)
        return np.random.Generator(np.random.PCG64(sequence))

    def normal(self, count: int) -> NDArray[np.float64]:
        """The first normal draws of every generator, shape (N, count)."""
        return np.array([standard_normal(self.generator(i), count) for i in range(len(self))]).reshape(-1, count)

    def uniform(self, count: int) -> NDArray[np.float64]:
        """The first draws from [0, 1) of every generator, shape (N, count)."""
        return np.array([self.generator(i).random(count) for i in range(len(self))]).reshape(-1, count)
