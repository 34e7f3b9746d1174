"""Outliers: now and then a measurement is far off."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from hgorun.config.types import NonNegative, Number
from hgorun.noise.base import Draws, RandomNoise, Spectrum, noise
from hgorun.noise.streams import Streams


@noise("outliers")
class Outliers(RandomNoise):
    """With a probability plus or minus ``size``, both equally likely, else nothing: a draw a sample, or one every hold.

    Together with Gaussian noise it is what robust estimation calls contaminated noise. Linear theory knows its
    variance, probability size^2, and not that a single outlier is large.
    """

    bounded: ClassVar[bool] = True
    scaled_by: ClassVar[str | None] = "size"

    size: NonNegative = Field(description="of an outlier, in the unit of the output")
    probability: Annotated[Number, Field(ge=0, le=1)] = Field(description="of an outlier, for each draw")

    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        return self._among(random.random(count))

    def draw_many(self, streams: Streams, count: int) -> np.ndarray:
        return self._among(streams.uniform(count))

    def _among(self, parts: np.ndarray) -> np.ndarray:
        """The lowest ``probability`` of the draws from [0, 1), in two halves."""
        return np.where(parts < self.probability, np.where(parts < 0.5 * self.probability, -self.size, self.size), 0.0)

    def spectrum(self) -> Spectrum:
        return Spectrum(draws=(Draws(0.0, self.probability * self.size**2, self.hold),))
