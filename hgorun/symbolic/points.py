"""Random points, at which is decided what the symbols of an expression may hide: a rank, a slope, a dependence.

The draws are the same at every call, so that a plant is always judged alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from itertools import islice, repeat

import numpy as np

_COUNT = 8
_KEPT = 16  # inputs and times that are drawn once
# of a state that is zero at the start, where nothing says which size is typical
_SIZES = (0.1, 1.0, 1e-3, 30.0, 1e-6, 1e3, 1e-9, 1e6)


@dataclass(frozen=True, eq=False, repr=False)
class Instant:
    """A time, a state, shape (n,), and inputs, shape (m,)."""

    t: float
    x: np.ndarray
    u: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class Instants:
    """Several of them: times, shape (N,), states, shape (N, n), and inputs, shape (N, m)."""

    t: np.ndarray
    x: np.ndarray
    u: np.ndarray

    @classmethod
    def of(cls, states: Sequence[np.ndarray], inputs: int, sizes: tuple[float, ...]) -> Instants:
        """As :func:`instants` gives them one by one; as many states as sizes, or fewer."""
        t, u = _sized_moments(inputs, sizes)
        return cls(t[: len(states)], np.array(states), u[: len(states)])

    def one(self, k: int) -> Instants:
        """One of them."""
        return Instants(self.t[k : k + 1], self.x[k : k + 1], self.u[k : k + 1])


def generator() -> np.random.Generator:
    """Random numbers, the same ones at every call."""
    return np.random.default_rng(0)


def around(at: np.ndarray, names: tuple[str, ...]) -> list[np.ndarray]:
    """A typical state, and others near it.

    The draws of a state follow from its name, so that they do not depend on the order of the states; their
    size follows from its value. Where that is zero, sizes of many orders are tried.

    Parameters
    ----------
    at : ndarray, shape (n,)
    names : tuple of str
        Of the states.
    """
    sizes = np.where(at != 0, 0.3 * np.abs(at), np.array(_SIZES)[:, None])
    return [at, *(at + _draws(names) * sizes)]


@lru_cache(maxsize=256)
def _draws(names: tuple[str, ...]) -> np.ndarray:
    """Numbers in [-1, 1) that follow from each of the names, shape (points, names)."""
    seeds = [int.from_bytes(sha256(name.encode()).digest()[:8], "little") for name in names]
    return np.array([np.random.default_rng(seed).uniform(-1, 1, _COUNT) for seed in seeds]).reshape(-1, _COUNT).T


def near(at: np.ndarray) -> list[np.ndarray]:
    """A typical state, and others so near that states that are zero there stay small."""
    random = generator()
    return [at] + [at + 0.3 * np.abs(at) * random.uniform(-1, 1, at.size) + 0.01 * (at == 0) for _ in range(_COUNT)]


def instants(
    states: Iterable[np.ndarray], inputs: int, *, low: float = -1.0, sizes: Iterable[float] = repeat(1.0)
) -> Iterator[Instant]:
    """Each of the states with a time in [0, 1) and inputs in [low, 1).

    Parameters
    ----------
    inputs : int
        How many there are.
    sizes : iterable of float
        By which the inputs are multiplied, one for each state.
    """
    for x, size, (u, t) in zip(states, sizes, _moments(inputs, low), strict=False):
        yield Instant(t, x, size * u)


def _moments(inputs: int, low: float) -> Iterator[tuple[np.ndarray, float]]:
    """Random inputs in [low, 1) and times in [0, 1); the first are kept, since most plants are judged at few points."""
    yield from _first_moments(inputs, low)
    yield from islice(_drawn_moments(inputs, low), _KEPT, None)


def _drawn_moments(inputs: int, low: float) -> Iterator[tuple[np.ndarray, float]]:
    random = generator()
    while True:
        yield random.uniform(low, 1, inputs), random.uniform()


@lru_cache(maxsize=64)
def _sized_moments(inputs: int, sizes: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Times, and inputs of the given sizes: one of each for every size."""
    moments = list(islice(_moments(inputs, -1.0), len(sizes)))
    u = [size * u for size, (u, _) in zip(sizes, moments, strict=True)]
    return np.array([t for _, t in moments]), np.array(u).reshape(len(sizes), inputs)


@lru_cache(maxsize=64)
def _first_moments(inputs: int, low: float) -> list[tuple[np.ndarray, float]]:
    return list(islice(_drawn_moments(inputs, low), _KEPT))
