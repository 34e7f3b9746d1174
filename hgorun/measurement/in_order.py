"""Noise that is asked for in the order of time: its draws are made as they are needed, and not kept."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from inspect import unwrap

import numpy as np

from hgorun.measurement.chance import streams
from hgorun.measurement.noise import StretchNoise
from hgorun.measurement.trains import Train
from hgorun.noise.base import DrawnInParts, RandomNoise
from hgorun.noise.streams import Stream
from hgorun.pieces import distinct

_PART = 1 << 15  # draws that are made at once


class NoiseInOrder(StretchNoise):
    """The noise of a stretch at times and numbers that do not descend, call after call; else as its base.

    Parameters
    ----------
    noise : StretchNoise
        Of a single run, and :func:`drawn_in_parts`.
    """

    def __init__(self, noise: StretchNoise) -> None:
        self.__dict__.update(noise.__dict__)
        self.__dict__.pop("_held", None)
        self._draws: dict[int, _Draws] = {}

    @cached_property
    def changes(self) -> list[Train]:
        """When each of the held parts changes, for an output that is continuous in the stretch."""
        trains = []
        for hold in self.holds:
            first, stop = self._needed(hold)
            trains.append(Train(self.start, hold, stop - first, -np.inf, np.inf, number=first))
        return trains

    def changes_between(self, start: float, end: float) -> np.ndarray:
        """When a held part changes, from a time on and before another one."""
        parts = [train.at(np.arange(train.before(start), train.before(end))) for train in self.changes]
        return parts[0] if len(parts) == 1 else distinct(np.concatenate([np.zeros(0), *parts]))

    def held(self, times: np.ndarray) -> np.ndarray:
        total = np.zeros(times.size)
        for j, item in enumerate(self.random):
            if item.hold is not None:
                first, stop = self._needed(item.hold)
                total += self._numbered(j, np.clip(self._index(times, item.hold), first, stop - 1))
        return total

    def _numbered(self, j: int, numbers: np.ndarray) -> np.ndarray:
        if j not in self._draws:
            self._draws[j] = _Draws(self._next(j))
        return self._draws[j].at(numbers)

    def _next(self, j: int) -> Callable[[int], np.ndarray]:
        item, stream = self.random[j], Stream(streams(self._seeds, "noise", self._channel, j))
        assert isinstance(item, DrawnInParts)
        return lambda count: self._drawn(item, item.draw_next(stream, count), (count,))


class _Draws:
    """The draws of an item, of which only the last are kept."""

    def __init__(self, following: Callable[[int], np.ndarray]) -> None:
        self._following, self._first, self._kept = following, 0, np.zeros(0)

    def at(self, numbers: np.ndarray) -> np.ndarray:
        """Some draws by their numbers, which ascend, and are not smaller than those of the last call."""
        found, done = np.empty(numbers.size), 0
        while done < numbers.size:
            own = numbers[done : done + _PART]
            own = own[: np.searchsorted(own, own[0] + _PART)]
            self._keep(int(own[0]), int(own[-1]) + 1)
            found[done : done + own.size] = self._kept[own - self._first]
            done += own.size
        return found

    def _keep(self, first: int, stop: int) -> None:
        """Have those from a number on that are before another one."""
        while self._first + self._kept.size < stop:
            if first >= self._first + self._kept.size:
                self._first, self._kept = self._first + self._kept.size, self._following(_PART)
            else:
                kept = self._kept[first - self._first :]
                self._first, self._kept = first, np.concatenate([kept, self._following(_PART)])


def drawn_in_parts(items: tuple[object, ...]) -> bool:
    """Whether all that is random in some noise can be drawn one part after the other."""
    return all(isinstance(item, DrawnInParts) and _its_own(item) for item in items if isinstance(item, RandomNoise))


def _its_own(item: DrawnInParts) -> bool:
    """Whether one class says what is drawn at once and part by part: one that is derived may have changed either."""
    at_once, in_parts = unwrap(type(item).draw), unwrap(type(item).draw_next)  # classes from outside have guards
    of = [str(one.__qualname__).rpartition(".")[0] for one in (at_once, in_parts)]
    return of[0] == of[1]
