"""Random points, at which is decided what the symbols of an expression may hide: a rank, a slope, a dependence.

The draws are the same at every call, so that a plant is always judged alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from hashlib import sha256
from itertools import repeat

import numpy as np

_COUNT = 8
# of a state that is zero at the start, where nothing says which size is typical
_SIZES = (0.1, 1.0, 1e-3, 30.0, 1e-6, 1e3, 1e-9, 1e6)


@dataclass(frozen=True, eq=False, repr=False)
class Instant:
    """A time, a state, shape (n,), and inputs, shape (m,)."""

    t: float
    x: np.ndarray
    u: np.ndarray


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
    points = np.tile(at, (_COUNT, 1))
    for i, name in enumerate(names):
        seed = int.from_bytes(sha256(name.encode()).digest()[:8], "little")
        draws = np.random.default_rng(seed).uniform(-1, 1, _COUNT)
        points[:, i] += draws * (0.3 * np.abs(at[i]) if at[i] != 0 else np.array(_SIZES))
    return [at, *points]


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
    random = generator()
    for x, size in zip(states, sizes, strict=False):
        u = size * random.uniform(low, 1, inputs)
        yield Instant(random.uniform(), x, u)
