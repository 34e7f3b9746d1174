"""A sum of sinusoids."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Annotated

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Block, NonEmpty, Number
from hgorun.native.elementary import apply
from hgorun.noise.base import Spectrum, TimeFunction, Wave, noise


class Term(Block):
    """One sinusoid: amplitude * sin(omega t + phase)."""

    amplitude: Number = Field(description="in the unit of the output; relative with multiplicative noise")
    omega: Number = Field(description="angular frequency, rad per time unit")
    phase: Number = Field(default=0.0, description="rad")


@noise("sinusoids")
class Sinusoids(TimeFunction):
    """A sum of sinusoids, amplitude sin(omega t + phase) each."""

    terms: Annotated[tuple[Term, ...], NonEmpty] = Field(
        description="sinusoids: amplitude, omega (rad per time unit) and phase each"
    )

    def numbers(self) -> Mapping[str, Sequence[float]]:
        return {key: [getattr(term, key) for term in self.terms] for key in ("amplitude", "omega", "phase")}

    def structure(self) -> Hashable:
        return len(self.terms)

    def symbol(self, t: ca.SX, numbers: Mapping[str, ca.SX]) -> ca.SX:
        a, omega, phase = numbers["amplitude"], numbers["omega"], numbers["phase"]
        return sum((a[i] * ca.sin(omega[i] * t + phase[i]) for i in range(len(self.terms))), ca.SX(0))

    def at(self, times: np.ndarray, k: np.ndarray) -> np.ndarray:
        zero = np.zeros(times.size)
        return sum((term.amplitude * apply("sin", term.omega * times + term.phase) for term in self.terms), zero)

    def fastest(self, start: float, end: float) -> float:
        return max(abs(term.omega) for term in self.terms)

    def bound(self, start: float, end: float) -> float:
        """All of them at their largest together."""
        return sum(abs(term.amplitude) for term in self.terms)

    def silent(self) -> dict[str, object]:
        """The same frequencies, so that the same code serves."""
        return {"type": self.type, "terms": [{**term.model_dump(), "amplitude": 0} for term in self.terms]}

    def spectrum(self) -> Spectrum:
        return Spectrum(waves=tuple(Wave(t.amplitude * np.exp(1j * t.phase), t.omega) for t in self.terms))
