"""The noise of one output in one stretch of time, as theory sees it: sinusoids, random draws, the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.analysis.reasons import NoValue, no_spectrum
from hgorun.measurement.noise import StretchNoise
from hgorun.noise.base import Draws, Wave


@dataclass(frozen=True)
class NoiseTerms:
    """What v(t) is the sum of.

    Attributes
    ----------
    waves : tuple of Wave
        None of frequency 0.
    draws : tuple of Draws
    other : tuple of str
        Types of noise whose spectrum is not known.
    """

    waves: tuple[Wave, ...] = ()
    draws: tuple[Draws, ...] = ()
    other: tuple[str, ...] = ()

    @classmethod
    def of(cls, noise: StretchNoise) -> NoiseTerms:
        """Of one output's noise in one stretch."""
        found = [(item.type, item.spectrum()) for item in noise.items]
        spectra = [spectrum for _, spectrum in found if spectrum is not None]
        waves = [wave for spectrum in spectra for wave in spectrum.waves]
        draws = [draws for spectrum in spectra for draws in spectrum.draws]
        constant = sum(wave.phasor.imag for wave in waves if wave.omega == 0)
        if constant:
            draws.append(Draws(constant, 0.0, np.inf))
        other = tuple(dict.fromkeys(kind for kind, spectrum in found if spectrum is None))
        return cls(tuple(wave for wave in waves if wave.omega != 0), tuple(draws), other)

    @property
    def mean(self) -> float:
        """The constant part."""
        return sum(d.mean for d in self.draws)


def require_spectra(terms: Sequence[NoiseTerms]) -> None:
    """Refuse noise whose spectrum is not known.

    Raises
    ------
    NoValue
    """
    unknown = dict.fromkeys(kind for t in terms for kind in t.other)
    if unknown:
        raise NoValue(no_spectrum(*unknown))


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
        if found and wave.omega - found[-1].omega <= 1e-9 * wave.omega:
            found[-1] = Wave(found[-1].phasor + wave.phasor, found[-1].omega)
        else:
            found.append(wave)
    return found
