"""Uniform noise."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field, model_validator

from hgorun.config.types import Number
from hgorun.noise.base import DrawnInParts, Draws, Spectrum, noise
from hgorun.noise.streams import Stream, Streams


@noise("uniform")
class UniformNoise(DrawnInParts):
    """Uniform noise between low and high: a draw a sample, or one every ``hold``."""

    bounded: ClassVar[bool] = True

    low: Number = Field(description="least value")
    high: Number = Field(description="largest value, above low")

    @model_validator(mode="after")
    def _order(self) -> UniformNoise:
        if not self.low < self.high:
            raise ValueError(f"low must be below high, found low {self.low:g}, high {self.high:g}")
        if not np.isfinite(self.high - self.low):
            raise ValueError(f"high - low is not finite, found low {self.low:g}, high {self.high:g}")
        return self

    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        return self._between(random.random(count))  # NumPy's own formula may be fused elsewhere

    def draw_many(self, streams: Streams, count: int) -> np.ndarray:
        return self._between(streams.uniform(count))

    def _between(self, parts: np.ndarray) -> np.ndarray:
        return self.low + (self.high - self.low) * parts

    def draw_next(self, stream: Stream, count: int) -> np.ndarray:
        return self._between(stream.uniform(count))

    def largest(self) -> float:
        return max(abs(self.low), abs(self.high))

    def spectrum(self) -> Spectrum:
        mean, variance = 0.5 * (self.low + self.high), (self.high - self.low) ** 2 / 12
        return Spectrum(draws=(Draws(mean, variance, self.hold),))
