"""The noise of an output: its functions of time, and what is drawn before the run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from functools import cached_property

import numpy as np

from hgorun.errors import PluginError, Problem
from hgorun.measurement.availability import Stretch
from hgorun.measurement.chance import Chance, OfSeed, streams
from hgorun.measurement.sizes import DRAW_BYTES, EVENT_BYTES, SAMPLE_BYTES
from hgorun.noise.base import Noise, RandomNoise, TimeFunction
from hgorun.pieces import distinct


def absolute(items: tuple[Noise, ...], mean_square: float) -> tuple[Noise, ...]:
    """Items of noise with their sizes as numbers, whether or not they were given relative to the output's."""
    return tuple(i.absolute(mean_square) if isinstance(i, RandomNoise) else i for i in items)


def is_relative(stretch: Stretch) -> bool:
    """Whether the size of its noise depends on the mean square of the noise-free output."""
    return any(isinstance(item, RandomNoise) and item.relative() for item in stretch.noise)


def deviations(resolved: Sequence[Sequence[Stretch]], outputs: Sequence[str]) -> dict[str, float]:
    """Standard deviation of each output's noise at the start of the run, where it is known and not zero."""
    found = {}
    for name, stretches in zip(outputs, resolved, strict=True):
        first = stretches[0]
        if first.multiplicative or is_relative(first):
            continue
        spectra = [item.spectrum() for item in first.noise]
        power = sum(
            sum(abs(wave.phasor) ** 2 / 2 for wave in s.waves) + sum(draws.variance for draws in s.draws)
            for s in spectra
            if s is not None
        )
        if power > 0:
            found[name] = float(np.sqrt(power))
    return found


class StretchNoise:
    """The noise of one output in one stretch.

    Parameters
    ----------
    stretch : Stretch
    items : tuple of Noise
        Its noise, of :func:`absolute` size.
    seed : int
    channel : str
        Name of the output and phase.
    start, end : float
        Of the run: held noise changes at start + m hold.
    chance : Chance, optional
        The random numbers of the seed, where they are made together with those of others.
    room : float
        Bytes that all held draws at once may take.

    Attributes
    ----------
    functions : tuple of TimeFunction
    random : tuple of RandomNoise
    many : tuple of int
        The leading axes of what is drawn: none for a single run.
    """

    many: tuple[int, ...]

    def __init__(
        self,
        stretch: Stretch,
        items: tuple[Noise, ...],
        seed: int,
        channel: str,
        start: float,
        end: float,
        room: float = np.inf,
        chance: Chance | None = None,
    ) -> None:
        self._chance = chance or OfSeed(seed)
        self.start, self.end, self._stretch, self._room = start, end, stretch, room
        self.functions = tuple(item for item in items if isinstance(item, TimeFunction))
        self.random = tuple(item for item in items if isinstance(item, RandomNoise))
        self.items = items
        self._span, self._origin = (stretch.start, stretch.end), stretch.origin
        self._channel = channel
        self._seeds = np.array([seed])
        self.many = ()
        self._deviations: Mapping[int, np.ndarray] = {}

    def of_many(self, count: int, seeds: np.ndarray, deviations: Mapping[int, np.ndarray]) -> StretchNoise:
        """The noise of several runs at once, along the first axis of all that is drawn.

        Parameters
        ----------
        count : int
            How many runs.
        seeds : ndarray of int64, shape (count,) or (1,)
        deviations : mapping of int to ndarray, shape (count,)
            By the place among the items: the standard deviation of gaussian noise in each run.
        """
        new = copy(self)
        new.__dict__.pop("_held", None)
        random = [i for i, item in enumerate(self.items) if isinstance(item, RandomNoise)]
        new._seeds, new.many = seeds, (count,)
        new._deviations = {random.index(i): values for i, values in deviations.items()}
        return new

    def memory(self, left: float) -> float:
        """Bytes that its held draws take at once: those from the start of the run, and its changes as events.

        Raises
        ------
        Problem
            Where they are more than are ``left``.
        """
        stretch, total = self._stretch, 0.0
        for j, item in enumerate(self.items):
            if isinstance(item, RandomNoise) and item.hold is not None:
                draws = (stretch.end - self.start) / item.hold
                events = (stretch.end - stretch.start) / item.hold if stretch.continuous else 0.0
                total += draws * DRAW_BYTES + events * (SAMPLE_BYTES if stretch.undelayed else EVENT_BYTES)
                if total > left:
                    raise Problem(
                        (*stretch.paths["noise"], j, "hold"),
                        f"{draws:.3g} draws take about {total / 2**30:.3g} GiB; "
                        f"time.max_memory leaves {left / 2**30:.3g} GiB for them",
                    )
        return total

    @property
    def holds(self) -> tuple[float, ...]:
        """How long each of the held parts is held."""
        return tuple(item.hold for item in self.random if item.hold is not None)

    def change_times(self) -> np.ndarray:
        """When a held part changes."""
        times = [self.start + np.arange(first, first + draws.shape[-1]) * hold for hold, first, draws in self._held]
        return distinct(np.concatenate(times)) if times else np.zeros(0)

    def held(self, times: np.ndarray) -> np.ndarray:
        """The sum of the held parts at several times, shape (..., len(times))."""
        total = np.zeros((*self.many, times.size))
        for hold, first, draws in self._held:
            index = self._index(times, hold) - first
            total += _taken(draws, np.clip(index, 0, draws.shape[-1] - 1))
        return total

    def sampled(self, times: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """The noise of samples at times t_k, numbered k: held parts at t_k, one draw a sample of the others.

        Shape (..., len(times)).
        """
        drawn = self.held(times)
        for j, item in enumerate(self.random):
            if item.hold is None:
                drawn += self._numbered(j, numbers)
        total = np.zeros(times.size)
        for function in self.functions if times.size else ():
            total += function.at(self._origin + times, numbers)
        return np.asarray(total + drawn)

    def sampled_each(self, times: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """As :meth:`sampled`, where samples come at other times in each of many runs and no draw is held.

        Parameters
        ----------
        times : ndarray, shape (runs, Nk)
        numbers : ndarray of int, shape (Nk,)
        """
        drawn, total = np.zeros(times.shape), np.zeros(times.shape)
        for j in range(len(self.random)):
            drawn += self._numbered(j, numbers)
        for function in self.functions:
            every = np.broadcast_to(numbers, times.shape).ravel()
            total += function.at(self._origin + times.ravel(), every).reshape(times.shape)
        return np.asarray(total + drawn)

    def _numbered(self, j: int, numbers: np.ndarray) -> np.ndarray:
        """Draws of an item, by their numbers."""
        return _taken(self._draw(j, int(numbers.max()) + 1 if numbers.size else 0), numbers)

    @cached_property
    def _held(self) -> list[tuple[float, int, np.ndarray]]:
        """Of every held part the hold, the number of the first draw that the stretch needs, and its draws."""
        found = []
        self.memory(self._room)
        for j, item in enumerate(self.random):
            if item.hold is not None:
                first, stop = self._needed(item.hold)
                draws = self._draw(j, stop)
                found.append((item.hold, first, draws[..., first:].copy() if first else draws))
        return found

    def _needed(self, hold: float) -> tuple[int, int]:
        """First and last + 1 of the run's draws that the stretch may need."""
        first, last = (self._index(np.array(t), hold) for t in self._span)
        rounding = 2 * np.spacing(max(abs(self.start), abs(self.end))) / hold
        whole = int(np.floor((self.end - self.start) / hold * (1 + 1e-12) + rounding)) + 1
        stop = min(int(last) + 2, whole)
        return min(max(int(first) - 1, 0), stop - 1), stop

    def _index(self, times: np.ndarray, hold: float) -> np.ndarray:
        """Which draw holds at each time."""
        rounding = 1e-9 + 2 * np.spacing(np.abs(times)) / hold  # a clock that began long ago has few digits left
        return np.asarray(np.floor((times - self.start) / hold * (1 + 1e-12) + rounding).astype(np.int64))

    def _draw(self, j: int, count: int) -> np.ndarray:
        """The first draws of an item: the same ones at every call."""
        item = self.random[j]
        if not self.many:
            return self._drawn(item, self._chance.draws(item, count, "noise", self._channel, j), (count,))
        of = streams(self._seeds, "noise", self._channel, j)
        shape = len(of), count
        if j in self._deviations:
            unit = item.model_copy(update={str(item.scaled_by): 1.0})
            drawn = self._drawn(item, unit.draw_many(of, count), shape)
            return np.asarray(drawn * self._deviations[j][:, None])
        return self._drawn(item, item.draw_many(of, count), shape)

    def _drawn(self, item: RandomNoise, values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        drawn = np.asarray(values, dtype=float)
        if drawn.shape != shape:
            raise PluginError(f"noise {item.type!r}: draw returned an array of shape {drawn.shape}, expected {shape}")
        return drawn


def _taken(draws: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Some of the draws, along the last axis: a view where they follow each other."""
    first, count = (int(index[0]), index.size) if index.size else (0, 0)
    if np.array_equal(index, np.arange(first, first + count)):
        return np.asarray(draws[..., first : first + count])
    return np.asarray(draws[..., index])
