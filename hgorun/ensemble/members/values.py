"""The values of an axis: computed where they are needed, since there may be many.

No value depends on how many others are asked for, and none on a C library: the bits are the same on every machine.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hgorun.config.sweeps import AnyAxis, LinearAxis, ListAxis, LogAxis, NormalAxis, SeedAxis, UniformAxis
from hgorun.config.types import SEEDS
from hgorun.ensemble.members.quantile import normal_quantile
from hgorun.errors import Problem
from hgorun.measurement.chance import generator
from hgorun.native.elementary import apply
from hgorun.noise.normal import standard_normal

Floats: TypeAlias = NDArray[np.float64]
Places: TypeAlias = NDArray[np.int64]
Column: TypeAlias = NDArray[Any]

_CHUNK = 1024  # draws that are made together


class Values(ABC):
    """The values of one axis.

    Attributes
    ----------
    size : int
        How many there are.
    """

    size: int

    @abstractmethod
    def at(self, places: Places) -> Column:
        """The values at some places, counted from 0; shape as that of the places."""

    @abstractmethod
    def spread(self, u: Floats, places: Places) -> Column:
        """The values that belong to numbers between 0 and 1, ends excluded, as evenly spread as those are.

        Parameters
        ----------
        u : ndarray
        places : ndarray
            Numbers of the members, for what cannot be spread.
        """


@dataclass(frozen=True)
class Listed(Values):
    """Values one by one."""

    values: Column

    @property
    def size(self) -> int:  # type: ignore[override]  # read-only
        return int(self.values.size)

    def at(self, places: Places) -> Column:
        return self.values[places]

    def spread(self, u: Floats, places: Places) -> Column:
        return self.values[(u * self.size).astype(np.int64)]


@dataclass(frozen=True)
class _Range(Values):
    """From first to last, in steps that a kind of its own makes equal."""

    first: float
    last: float
    size: int

    def at(self, places: Places) -> Column:
        return self._between(places / max(self.size - 1, 1))

    def spread(self, u: Floats, places: Places) -> Column:
        return self._between(u)

    @abstractmethod
    def _between(self, t: Floats) -> Floats:
        """From first, at 0, to last, at 1."""


class Linear(_Range):
    """From first to last in equal steps."""

    def _between(self, t: Floats) -> Floats:
        return np.where(t == 1, self.last, self.first + (self.last - self.first) * t)


class Logarithmic(_Range):
    """From first to last in equal ratios."""

    def _between(self, t: Floats) -> Floats:
        return np.where(t == 1, self.last, self.first * apply("pow", np.full_like(t, self.last / self.first), t))


@dataclass(frozen=True)
class Drawn(Values):
    """Random draws, seeded by the base's seed and the axis.

    Attributes
    ----------
    a, b : float
        Low and high end, or mean and standard deviation.
    normal : bool
        Which of the two.
    """

    a: float
    b: float
    normal: bool
    size: int
    seed: int
    path: str

    def at(self, places: Places) -> Column:
        chunks, which = np.unique(places // _CHUNK, return_inverse=True)
        draws = np.stack([_draws(self.normal, self.seed, self.path, int(k)) for k in chunks])
        return self._scaled(draws[which.reshape(places.shape), places % _CHUNK])

    def spread(self, u: Floats, places: Places) -> Column:
        return self._scaled(normal_quantile(u) if self.normal else u)

    def _scaled(self, draws: Floats) -> Floats:
        return self.a + (self.b if self.normal else self.b - self.a) * draws


@lru_cache(maxsize=64)
def _draws(normal: bool, seed: int, path: str, chunk: int) -> Floats:
    random = generator(seed, "axis", path, chunk)
    return standard_normal(random, _CHUNK) if normal else random.random(_CHUNK)


@dataclass(frozen=True)
class Seeds(Values):
    """The seed of the base, and those that follow."""

    first: int
    size: int

    def at(self, places: Places) -> Column:
        return self.first + places

    def spread(self, u: Floats, places: Places) -> Column:
        return self.first + places


def values_of(axis: AnyAxis, path: str, seed: int) -> Values:
    """The values of an axis of a sweep file.

    Parameters
    ----------
    axis : block of the file
    path : str
        What it varies.
    seed : int
        That of the base.
    """
    match axis:
        case ListAxis(values=values):
            return Listed(_column(values))
        case LinearAxis(linear=(first, last, size)):
            return Linear(first, last, size)
        case LogAxis(log=(first, last, size)):
            return Logarithmic(first, last, size)
        case UniformAxis(uniform=(low, high), draws=size):
            return Drawn(low, high, False, size, seed, path)
        case NormalAxis(normal=(mean, deviation), draws=size):
            return Drawn(mean, deviation, True, size, seed, path)
        case SeedAxis(count=size):
            return Seeds(seed, size)


def _column(values: tuple[Any, ...]) -> Column:
    """Whole numbers, numbers, or objects where one of them is neither."""
    kinds = {type(value) for value in values}
    if kinds == {int} and all(-(2**63) <= value < 2**63 for value in values):
        return np.array(values, dtype=np.int64)
    if kinds <= {int, float}:
        return np.array(values, dtype=float)
    column = np.empty(len(values), dtype=object)
    column[:] = values
    return column


def check_seeds(path: str, seeds: Seeds) -> None:
    """Refuse what counts something else, and seeds that are no seeds any more."""
    if path != "seed":
        raise Problem(("axes", path), "count makes seeds, and belongs to the axis seed")
    if seeds.first + seeds.size > SEEDS:
        what = f"{seeds.size} seeds from {seeds.first} on end above the largest seed, {SEEDS - 1}"
        raise Problem(("axes", path, "count"), what)
