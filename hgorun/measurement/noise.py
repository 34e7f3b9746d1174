"""Measurement noise: deterministic parts as expressions, random parts drawn before the run.

Each random channel has its own generator, a child of the seed named by the channel, so a draw depends on
the seed and on the channel and on nothing else.
"""

from __future__ import annotations

import hashlib
from collections.abc import Hashable, Mapping

import casadi as ca
import numpy as np

from hgorun.config.expressions import parse
from hgorun.config.models import ExpressionNoise, GaussianNoise, Sinusoids, UniformNoise
from hgorun.measurement.availability import Stretch
from hgorun.config.literals import template
from hgorun.symbolic.evaluate import compiled, evaluate


def generator(seed: int, *channel: object) -> np.random.Generator:
    """The random numbers of a channel."""
    digest = hashlib.sha256("/".join(map(str, channel)).encode()).digest()
    key = tuple(int(word) for word in np.frombuffer(digest[:16], dtype="<u4"))
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key)))


def continuous_numbers(stretch: Stretch) -> dict[str, np.ndarray]:
    """The run-time numbers of a continuous output: of its noise without the random parts, and of its delay."""
    found = {"delay": np.array(template(parse(stretch.delay, names=("t",)))[1])}
    for i, item in enumerate(stretch.noise):
        if isinstance(item, Sinusoids):
            for key in ("amplitude", "omega", "phase"):
                found[f"{i}.{key}"] = np.array([getattr(term, key) for term in item.terms])
        elif isinstance(item, ExpressionNoise):
            found[f"{i}.value"] = np.array(template(parse(item.value, names=("t",)))[1])
    return found


def continuous_structure(stretch: Stretch) -> Hashable:
    """What is compiled of a continuous output: equal for outputs that differ in their numbers only."""
    items: list[Hashable] = []
    for item in stretch.noise:
        if isinstance(item, Sinusoids):
            items.append(len(item.terms))
        elif isinstance(item, ExpressionNoise):
            items.append(template(parse(item.value, names=("t",)))[0])
        else:
            items.append(None)
    return stretch.multiplicative, template(parse(stretch.delay, names=("t",)))[0], tuple(items)


def continuous_noise(stretch: Stretch, t: ca.SX, numbers: Mapping[str, ca.SX]) -> ca.SX:
    """v(t) of a continuous output without its random parts, with symbols for its numbers."""
    total = ca.SX(0)
    for i, item in enumerate(stretch.noise):
        if isinstance(item, Sinusoids):
            a, omega, phase = (numbers[f"{i}.{key}"] for key in ("amplitude", "omega", "phase"))
            for k in range(len(item.terms)):
                total += a[k] * ca.sin(omega[k] * t + phase[k])
        elif isinstance(item, ExpressionNoise):
            total += template(parse(item.value, names=("t",)))[0].symbol({"t": t}, numbers[f"{i}.value"])
    return total


def continuous_delay(stretch: Stretch, t: ca.SX, numbers: Mapping[str, ca.SX]) -> ca.SX:
    """d(t) of a continuous output, with symbols for its numbers."""
    return template(parse(stretch.delay, names=("t",)))[0].symbol({"t": t}, numbers["delay"])


class RandomNoise:
    """The random parts of one output's noise in one stretch.

    Parameters
    ----------
    stretch : Stretch
    seed : int
    channel : str
        Name of the output and phase.
    start, end : float
        Of the run: held noise changes at start + m hold.
    mean_square : float
        The mean of the noise-free output squared; used where a signal-to-noise ratio is given.
    """

    def __init__(
        self,
        stretch: Stretch,
        seed: int,
        channel: str,
        start: float,
        end: float,
        mean_square: float,
    ) -> None:
        self.start, self.end = start, end
        self._span = stretch.start, stretch.end
        self.items: list[UniformNoise | GaussianNoise] = [
            item for item in stretch.noise if isinstance(item, (UniformNoise, GaussianNoise))
        ]
        self._seed, self._channel = seed, channel
        self._std = [self._standard_deviation(item, mean_square) for item in self.items]
        # of the run's draws those that the stretch needs: the first one's number, and they
        self._first: list[int] = []
        self._draws: list[np.ndarray] = []
        for j, item in enumerate(self.items):
            first, stop = self.needed(item.hold) if item.hold is not None else (0, 0)
            self._first.append(first)
            self._draws.append(self._draw(j, stop)[first:].copy())

    @staticmethod
    def _standard_deviation(item: UniformNoise | GaussianNoise, mean_square: float) -> float:
        if isinstance(item, UniformNoise):
            return 0.0
        if item.std is not None:
            return item.std
        assert item.snr_db is not None
        return float(np.sqrt(mean_square / 10 ** (item.snr_db / 10)))

    def moments(self) -> list[tuple[float, float, float | None]]:
        """Mean, variance and hold of every random part."""
        return [
            (0.5 * (item.low + item.high), (item.high - item.low) ** 2 / 12, item.hold)
            if isinstance(item, UniformNoise)
            else (0.0, std**2, item.hold)
            for item, std in zip(self.items, self._std, strict=True)
        ]

    def needed(self, hold: float) -> tuple[int, int]:
        """First and last + 1 of the run's draws that the stretch may need."""
        first, last = (self._index(np.array(t), hold) for t in self._span)
        whole = int(np.floor((self.end - self.start) / hold * (1 + 1e-12))) + 1
        stop = min(int(last) + 2, whole)
        return min(max(int(first) - 1, 0), stop - 1), stop

    def _index(self, times: np.ndarray, hold: float) -> np.ndarray:
        """Which draw holds at each time."""
        return np.asarray(np.floor((times - self.start) / hold * (1 + 1e-12) + 1e-9).astype(np.int64))

    def _draw(self, j: int, count: int) -> np.ndarray:
        """The first draws of an item: the same ones at every call."""
        item, random = self.items[j], generator(self._seed, "noise", self._channel, j)
        if isinstance(item, UniformNoise):
            return random.uniform(item.low, item.high, count)
        return random.normal(0.0, 1.0, count) * self._std[j]

    def change_times(self) -> np.ndarray:
        """When a held part changes."""
        times = [
            self.start + np.arange(first, first + draws.size) * item.hold
            for item, first, draws in zip(self.items, self._first, self._draws, strict=True)
            if item.hold is not None
        ]
        return np.unique(np.concatenate(times)) if times else np.zeros(0)

    def held(self, times: np.ndarray) -> np.ndarray:
        """The sum of the held parts at several times."""
        total = np.zeros(times.size)
        for item, first, draws in zip(self.items, self._first, self._draws, strict=True):
            if item.hold is not None:
                index = self._index(times, item.hold) - first
                total += draws[np.clip(index, 0, draws.size - 1)]
        return total

    def sampled(self, times: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """The random noise of samples: held parts at t_k, one draw a sample of the others."""
        total = self.held(times)
        count = int(numbers.max()) + 1 if numbers.size else 0
        for j, item in enumerate(self.items):
            if item.hold is None:
                total += self._draw(j, count)[numbers]
        return total


def sampled_noise(stretch: Stretch, times: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """The deterministic noise of samples at times t_k, numbered k."""
    total = np.zeros(times.size)
    for item in stretch.noise:
        if isinstance(item, Sinusoids):
            for term in item.terms:
                total += term.amplitude * np.sin(term.omega * times + term.phase)
        elif isinstance(item, ExpressionNoise) and times.size:
            total += evaluate(compiled(item.value, "t", "k"), times[:, None], numbers[:, None])[0].ravel()
    return total
