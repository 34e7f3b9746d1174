"""What random numbers decide: those of one seed, or of many seeds made at once, which are the same numbers.

Each thing that is drawn has a generator of its own, a child of the seed named by a channel, so a draw depends on the
seed and on the channel and on nothing else.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from hgorun.noise.base import RandomNoise
from hgorun.noise.streams import Streams

_LONG = 100_000  # draws that are made as those of many runs are, in machine code


def streams(seeds: np.ndarray, *channel: object) -> Streams:
    """The random numbers of a channel, for each of several seeds."""
    digest = hashlib.sha256("/".join(map(str, channel)).encode()).digest()
    return Streams(seeds, tuple(int(word) for word in np.frombuffer(digest[:16], dtype="<u4")))


def generator(seed: int, *channel: object) -> np.random.Generator:
    """The random numbers of a channel."""
    return streams(np.array([seed]), *channel).generator(0)


class Chance(Protocol):
    """The random numbers of a run."""

    def uniform(self, count: int, *channel: object) -> np.ndarray:
        """The first draws from [0, 1) of a channel, shape (count,)."""
        ...

    def draws(self, item: RandomNoise, count: int, *channel: object) -> np.ndarray:
        """The first draws of some noise, as it gives them."""
        ...


@dataclass(frozen=True)
class OfSeed:
    """Those of a seed."""

    seed: int

    def uniform(self, count: int, *channel: object) -> np.ndarray:
        return generator(self.seed, *channel).random(count)

    def draws(self, item: RandomNoise, count: int, *channel: object) -> np.ndarray:
        of = streams(np.array([self.seed]), *channel)
        if count >= _LONG and type(item).draw_many is not RandomNoise.draw_many:
            return np.asarray(item.draw_many(of, count)[0])
        return np.asarray(item.draw(of.generator(0), count))


@dataclass(frozen=True, eq=False, repr=False)
class OfSeeds:
    """Those of runs that differ in their seeds alone, all made when the first of them is asked for.

    Attributes
    ----------
    seeds : ndarray of int64, shape (N,)
    """

    seeds: np.ndarray
    _made: dict[tuple[object, ...], np.ndarray] = field(default_factory=dict)

    def of(self, i: int) -> Chance:
        """Those of one of the runs."""
        return _OfOne(self, i)

    def uniform(self, count: int, *channel: object) -> np.ndarray:
        """The first draws from [0, 1) of a channel in every run, shape (N, count)."""
        return self.known(count, channel, lambda of: of.uniform(count))

    def known(self, count: int, channel: tuple[object, ...], make: Callable[[Streams], np.ndarray]) -> np.ndarray:
        """The first draws of a channel of every run, shape (N, count)."""
        if channel not in self._made or self._made[channel].shape[-1] < count:
            self._made[channel] = make(streams(self.seeds, *channel))
        return np.asarray(self._made[channel][:, :count])


@dataclass(frozen=True, eq=False, repr=False)
class _OfOne:
    """Those of one of several runs."""

    all: OfSeeds
    i: int

    def uniform(self, count: int, *channel: object) -> np.ndarray:
        return np.asarray(self.all.uniform(count, *channel)[self.i])

    def draws(self, item: RandomNoise, count: int, *channel: object) -> np.ndarray:
        return np.asarray(self.all.known(count, channel, lambda of: item.draw_many(of, count))[self.i])
