"""The random numbers of many runs: a generator each, a child of its seed, all named alike.

The generators are NumPy's: PCG64, started by what SeedSequence makes of the seed and of the child's name. For many
seeds at once both are carried out here, with arrays and in machine code, to the same bits.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import count as numbers
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hgorun.noise.normal import TAIL, beyond, normal_and_used, standard_normal

if TYPE_CHECKING:
    from hgorun.noise.compiled import Tails  # with machine code, which is made only where it pays

_FEW, _MANY = 4, 100_000  # generators, and draws of fewer, for which loading machine code does not pay
_POOL = 4  # words of 32 bits
_WORD = 0xFFFFFFFF
_SHIFT = np.uint32(16)


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
        if self._few(count):
            return np.array([standard_normal(self.generator(i), count) for i in range(len(self))]).reshape(-1, count)
        from hgorun.noise.compiled import normal

        draws, tails, _ = normal(self.states, count)
        _finish(draws, tails)
        for i in {place // count for place in tails.place[tails.argument == 0].tolist()}:
            draws[i] = standard_normal(self.generator(i), count)
        return draws

    def uniform(self, count: int) -> NDArray[np.float64]:
        """The first draws from [0, 1) of every generator, shape (N, count)."""
        if self._few(count):
            return np.array([self.generator(i).random(count) for i in range(len(self))]).reshape(-1, count)
        from hgorun.noise.compiled import uniform

        return uniform(self.states, count)[0]

    def _few(self, count: int) -> bool:
        """Whether draws are made one generator after the other."""
        return len(self) < _FEW and len(self) * count < _MANY

    @cached_property
    def states(self) -> NDArray[np.uint64]:
        """State and increment of every generator, shape (N, 4), the low words first."""
        words = list(_generated(_mixed(self.seeds.astype(np.uint64), self.key), 8))
        high, low, first, second = (words[i].astype(np.uint64) | words[i + 1].astype(np.uint64) << np.uint64(32)
                                    for i in range(0, 8, 2))  # fmt: skip
        one, top = np.uint64(1), np.uint64(63)
        c = (second << one | one), (first << one | second >> top)
        state = _sum(c, (low, high))  # from zero it takes a step, the seed is added, and it takes another step
        state = _sum(_product(state), c)
        return np.ascontiguousarray(np.stack([*state, *c], axis=1))


class Stream:
    """One generator whose draws are made one part after the other, to the bits of all of them at once.

    Parameters
    ----------
    streams : Streams
        Of one seed.
    """

    def __init__(self, streams: Streams) -> None:
        self._states = streams.states

    def normal(self, count: int) -> NDArray[np.float64]:
        """The next normal draws, shape (count,)."""
        from hgorun.noise.compiled import normal

        draws, tails, after = normal(self._states, count)
        _finish(draws, tails)
        if not np.all(tails.argument):  # something was too close to be decided there
            random = self._generator()
            draws[0], used = normal_and_used(random, count)
            after = self._advanced(used)
        self._states = after
        return np.asarray(draws[0])

    def uniform(self, count: int) -> NDArray[np.float64]:
        """The next draws from [0, 1), shape (count,)."""
        from hgorun.noise.compiled import uniform

        draws, self._states = uniform(self._states, count)
        return np.asarray(draws[0])

    def _generator(self) -> np.random.Generator:
        """NumPy's, where this one is."""
        low, high, c_low, c_high = self._states[0].tolist()
        bits = np.random.PCG64()
        known = bits.state
        known["state"]["state"], known["state"]["inc"] = low | high << 64, c_low | c_high << 64
        bits.state = known
        return np.random.Generator(bits)

    def _advanced(self, words: int) -> NDArray[np.uint64]:
        """The state behind so many words."""
        bits = self._generator().bit_generator
        assert isinstance(bits, np.random.PCG64)
        number, mask = bits.advance(words).state["state"]["state"], (1 << 64) - 1
        states = self._states.copy()
        states[0, :2] = number & mask, number >> 64
        return states


def _finish(draws: NDArray[np.float64], tails: Tails) -> None:
    """Draws from the tail, from the arguments of their logarithms."""
    flat = draws.reshape(-1)
    for place, argument in zip(tails.place.tolist(), tails.argument.tolist(), strict=True):
        if argument:
            flat[place] = np.copysign(TAIL + beyond(argument), flat[place])


Pair = tuple[NDArray[np.uint64], NDArray[np.uint64]]  # of 128 bits, the low words first
Words = NDArray[np.uint32]


def _sum(a: Pair, b: Pair) -> Pair:
    low = a[0] + b[0]
    return low, a[1] + b[1] + (low < a[0])


def _product(a: Pair) -> Pair:
    """Times the multiplier of PCG64, modulo 2^128."""
    m_low, m_high = np.uint64(0x4385DF649FCCF645), np.uint64(0x2360ED051FC65DA4)
    half, mask = np.uint64(32), np.uint64(_WORD)
    a0, a1, b0, b1 = a[0] & mask, a[0] >> half, m_low & mask, m_low >> half
    middle = a1 * b0 + (a0 * b0 >> half)
    other = a0 * b1 + (middle & mask)
    carried = a1 * b1 + (middle >> half) + (other >> half)
    return a[0] * m_low, carried + a[1] * m_low + a[0] * m_high


def _constants(first: int, factor: int) -> Iterator[tuple[np.uint32, np.uint32]]:
    """The numbers of SeedSequence's hash: a word is combined with one of them, and multiplied by the next."""
    value = first
    for _ in numbers():
        after = value * factor & _WORD
        yield np.uint32(value), np.uint32(after)
        value = after


def _mixed(seeds: NDArray[np.uint64], key: tuple[int, ...]) -> list[Words]:
    """SeedSequence's pool of every seed: its two words, zeros, and the name of the child."""
    zero = np.zeros(seeds.shape, dtype=np.uint32)
    entropy = [(seeds & np.uint64(_WORD)).astype(np.uint32), (seeds >> np.uint64(32)).astype(np.uint32), zero, zero]
    constants = _constants(0x43B0D7E5, 0x931E8875)

    def hashed(word: Words) -> Words:
        before, after = next(constants)
        word = (word ^ before) * after
        return np.asarray(word ^ word >> _SHIFT)

    pool = [hashed(word) for word in entropy]
    for source in range(_POOL):
        for place in range(_POOL):
            if source != place:
                pool[place] = _joined(pool[place], hashed(pool[source]))
    for word in key:
        for place in range(_POOL):
            pool[place] = _joined(pool[place], hashed(zero + np.uint32(word)))
    return pool


def _joined(a: Words, b: Words) -> Words:
    word = a * np.uint32(0xCA01F9DD) - b * np.uint32(0x4973F715)
    return np.asarray(word ^ word >> _SHIFT)


def _generated(pool: list[Words], count: int) -> Iterator[Words]:
    """The words that SeedSequence generates from its pool."""
    constants = _constants(0x8B51F9DD, 0x58F38DED)
    for i in range(count):
        before, after = next(constants)
        word = (pool[i % _POOL] ^ before) * after
        yield word ^ word >> _SHIFT
