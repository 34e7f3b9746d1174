"""The samples of an output: as arrays, or as arithmetic where they follow from their numbers."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b

import numpy as np

from hgorun.measurement.trains import Train
from hgorun.memo import same

_COMPARED = 100_000  # samples whose times are compared; more are the same only where they are one object


@dataclass(frozen=True, eq=False, repr=False)
class Samples:
    """Samples of one output, in the order of their arrival.

    Attributes
    ----------
    arrival, taken : ndarray, shape (Nk,)
        When a sample arrives and the time it was measured.
    number : ndarray of int, shape (Nk,)
        k, counted from the start of its stretch and with the lost ones.
    stretch : ndarray of int, shape (Nk,)
        The stretch that each belongs to.
    used : ndarray of bool, shape (Nk,)
        False for a sample that came after a newer one.
    """

    arrival: np.ndarray
    taken: np.ndarray
    number: np.ndarray
    stretch: np.ndarray
    used: np.ndarray

    @cached_property
    def identity(self) -> Hashable:
        """Equal for samples that are known to be the same: those of one seed, made for two members of an ensemble."""
        if self.size > _COMPARED:
            return same(self)
        digest = blake2b(digest_size=16)
        for array in (self.arrival, self.taken, self.number, self.stretch, self.used):
            digest.update(array.tobytes())
        return digest.digest()

    @property
    def size(self) -> int:
        """How many there are."""
        return int(self.arrival.size)

    @property
    def late(self) -> bool:
        """Whether any sample arrives later than it is taken."""
        return self.taken is not self.arrival and bool(np.any(self.taken < self.arrival))

    def before(self, t: float) -> int:
        """How many samples arrive before a time."""
        return int(np.searchsorted(self.arrival, t))

    def part(self, first: int, stop: int, every: int = 1) -> Samples:
        """Some of them, one after the other, or only some of these."""
        some = slice(first, stop, every)
        arrival = self.arrival[some]
        taken = arrival if self.taken is self.arrival else self.taken[some]
        return Samples(arrival, taken, self.number[some], self.stretch[some], self.used[some])

    def first_used(self, t: float) -> float:
        """When the first sample arrives from a time on that is used; infinite where there is none."""
        heard = self.arrival[self.used]
        place = int(np.searchsorted(heard, t))
        return float(heard[place]) if place < heard.size else np.inf


@dataclass(frozen=True, eq=False, repr=False)
class RegularSamples:
    """Periodic samples of one output that are neither moved nor lost nor late: arithmetic of k, which takes no memory.

    Attributes
    ----------
    trains : tuple of (int, Train)
        The samples of every sampled stretch, with its number.
    all_at_once : callable
        Makes the arrays of all samples, for whoever asks for them.
    """

    trains: tuple[tuple[int, Train], ...]
    all_at_once: Callable[[], Samples]

    @cached_property
    def whole(self) -> Samples:
        """All samples as arrays.

        Raises
        ------
        Problem
            Where they do not fit into memory.
        """
        return self.all_at_once()

    @property
    def arrival(self) -> np.ndarray:
        """As those of :class:`Samples`, like the others that follow."""
        return self.whole.arrival

    @property
    def taken(self) -> np.ndarray:
        return self.whole.taken

    @property
    def number(self) -> np.ndarray:
        return self.whole.number

    @property
    def stretch(self) -> np.ndarray:
        return self.whole.stretch

    @property
    def used(self) -> np.ndarray:
        return self.whole.used

    @property
    def identity(self) -> Hashable:
        return self.trains

    @cached_property
    def size(self) -> int:
        return sum(train.size for _, train in self.trains)

    @property
    def late(self) -> bool:
        return False

    def before(self, t: float) -> int:
        return sum(train.before(t) for _, train in self.trains)

    def part(self, first: int, stop: int, every: int = 1) -> Samples:
        times, numbers, stretches, passed = [], [], [], 0
        for i, train in self.trains:
            behind = max(first - passed, 0)
            begin = behind + (-(passed + behind - first)) % every
            k = np.arange(begin, max(min(stop - passed, train.size), begin), every)
            passed += train.size
            if k.size or len(self.trains) == 1:
                times.append(train.at(k))
                numbers.append(k)
                stretches.append(np.full(k.size, i))
        none = np.zeros(0, dtype=np.int64)
        arrival = times[0] if len(times) == 1 else np.concatenate([np.zeros(0), *times])
        number, stretch = (one[0] if len(one) == 1 else np.concatenate([none, *one]) for one in (numbers, stretches))
        return Samples(arrival, arrival, number, stretch, np.ones(arrival.size, dtype=bool))

    def first_used(self, t: float) -> float:
        found = [float(train.at(np.array([train.before(t)]))[0]) for _, train in self.trains if train.at_end >= t]
        return min(found, default=np.inf)


AnySamples = Samples | RegularSamples
