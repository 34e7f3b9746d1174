"""Gaussian noise."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, model_validator

from hgorun.config.types import NonNegative, Number
from hgorun.native.elementary import apply
from hgorun.noise.base import DrawnInParts, Draws, Spectrum, noise
from hgorun.noise.normal import standard_normal
from hgorun.noise.streams import Stream, Streams


@noise("gaussian")
class GaussianNoise(DrawnInParts):
    """Gaussian noise of standard deviation ``std``, or of a signal-to-noise ratio: a draw a sample, or one every hold.

    The ratio is 10 log10(mean of the noise-free output squared over the run / std^2) dB.
    """

    scaled_by: ClassVar[str | None] = "std"

    std: NonNegative | None = Field(default=None, description="standard deviation")
    snr_db: Annotated[Number, Field(ge=-1000, le=1000)] | None = Field(
        default=None,
        description="variance = mean of the noise-free output squared over the run / 10^(snr_db/10)",
    )

    @model_validator(mode="after")
    def _one(self) -> GaussianNoise:
        if (self.std is None) == (self.snr_db is None):
            raise ValueError("give either std or snr_db")
        return self

    def relative(self) -> bool:
        return self.snr_db is not None

    def absolute(self, mean_square: float) -> GaussianNoise:
        if self.snr_db is None:
            return self
        std = float(np.sqrt(mean_square / apply("pow", 10.0, self.snr_db / 10)))
        return self.model_copy(update={"std": std, "snr_db": None})

    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        return standard_normal(random, count) * self._deviation

    def draw_many(self, streams: Streams, count: int) -> np.ndarray:
        return streams.normal(count) * self._deviation

    def draw_next(self, stream: Stream, count: int) -> np.ndarray:
        return stream.normal(count) * self._deviation

    def spectrum(self) -> Spectrum:
        return Spectrum(draws=(Draws(0.0, self._deviation**2, self.hold),))

    @property
    def _deviation(self) -> float:
        """std, which a relative size has to become first; see :meth:`absolute`."""
        assert self.std is not None
        return self.std
