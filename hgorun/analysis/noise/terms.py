"""The noise of one output in one stretch of time, as theory sees it: sinusoids, random draws, the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.config.models import ExpressionNoise, Sinusoids
from hgorun.measurement.availability import Stretch
from hgorun.measurement.noise import RandomNoise


@dataclass(frozen=True)
class Wave:
    """The imaginary part of ``phasor`` exp(j omega t): a sinusoid with its phase."""

    phasor: complex
    omega: float


@dataclass(frozen=True)
class Draws:
    """Independent draws, one a sample, or one every ``hold``; ``hold`` infinite: one for ever, a constant."""

    mean: float
    variance: float
    hold: float | None


@dataclass(frozen=True)
class NoiseTerms:
    """What v(t) is the sum of.

    Attributes
    ----------
    waves : tuple of Wave
        None of frequency 0.
    draws : tuple of Draws
    other : bool
        Whether there are terms of another kind: expressions.
    """

    waves: tuple[Wave, ...]
    draws: tuple[Draws, ...]
    other: bool

    @classmethod
    def of(cls, stretch: Stretch, random: RandomNoise) -> NoiseTerms:
        """Of one output's noise in one stretch."""
        terms = [term for item in stretch.noise if isinstance(item, Sinusoids) for term in item.terms]
        waves = [Wave(term.amplitude * np.exp(1j * term.phase), term.omega) for term in terms]
        constant = sum(wave.phasor.imag for wave in waves if wave.omega == 0)
        draws = [Draws(*moments) for moments in random.moments()]
        if constant:
            draws.append(Draws(constant, 0.0, np.inf))
        other = any(isinstance(item, ExpressionNoise) for item in stretch.noise)
        return cls(tuple(wave for wave in waves if wave.omega != 0), tuple(draws), other)

    @property
    def silent(self) -> bool:
        return not (self.waves or self.draws or self.other)

    @property
    def mean(self) -> float:
        """The constant part."""
        return sum(d.mean for d in self.draws)


def grouped(waves: Sequence[Wave]) -> list[Wave]:
    """Waves of different positive frequencies: those of one frequency are one wave."""
    return _merged([w if w.omega > 0 else Wave(-w.phasor.conjugate(), -w.omega) for w in waves])


def aliased(waves: Sequence[Wave], period: float, start: float) -> list[Wave]:
    """The sequences v_k = v(start + k period), as waves in k: frequencies in [0, pi], all different.

    Im(a exp(j W k)) is Im(-conj(a) exp(j (2 pi - W) k)). At 0 and pi nothing is left of a but its imaginary
    part.
    """
    found = []
    for wave in waves:
        phasor, angle = wave.phasor * np.exp(1j * wave.omega * start), wave.omega * period % (2 * np.pi)
        if angle > np.pi:
            phasor, angle = -phasor.conjugate(), 2 * np.pi - angle
        found.append(Wave(phasor, angle))
    return _merged(found)


def _merged(waves: Sequence[Wave]) -> list[Wave]:
    found: list[Wave] = []
    for wave in sorted(waves, key=lambda w: w.omega):
        if found and wave.omega - found[-1].omega <= 1e-9 * max(wave.omega, 1e-3):
            found[-1] = Wave(found[-1].phasor + wave.phasor, found[-1].omega)
        else:
            found.append(wave)
    return found
