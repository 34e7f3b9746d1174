"""The noise in the estimates in the steady state of a linearisation that does not change: sampled outputs."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hgorun.analysis.linear.linear import Linear
from hgorun.analysis.linear.transfer import discrete_covariance, relevant
from hgorun.analysis.noise.continuous import mean_squares
from hgorun.analysis.noise.terms import NoiseTerms, aliased, require_spectra
from hgorun.analysis.reasons import NoValue

_SHORT = 1e-9  # of a period
_MOST_ON_THE_WAY = 200  # samples at a time


class SampledLoop:
    """An observer and its samples as one linear difference equation from each arrival to the next one.

    All outputs are sampled every ``period`` and arrive ``delay`` later. With s = H xi - alpha and, between
    arrivals, e = h + alpha, where h = s(t_k - d) - v_k is held,

        xi' = A0 xi + E (alpha + h),    alpha' = -K0 xi - K (alpha + h),    h' = 0

    When a sample is taken, s is remembered until it arrives, and alpha is counted from zero again: only its
    differences matter. psi = (xi, alpha, h, s on their way).

    Parameters
    ----------
    linear : Linear
        At one point.
    period, delay : float
        Constant; the delay may be longer than the period.

    Raises
    ------
    NoValue
        When the difference equation is not stable.
    """

    def __init__(self, linear: Linear, period: float, delay: float = 0.0) -> None:
        from scipy.linalg import expm

        self.linear, self.period = relevant(linear), period
        (N, q), linear = self.linear.E.shape, self.linear
        if delay > _MOST_ON_THE_WAY * period:
            raise NoValue(f"more than {_MOST_ON_THE_WAY} samples are on their way at a time: {delay / period:.3g}")
        late = int(np.floor(delay / period + _SHORT))  # periods that a sample needs beside the rest
        rest = max(delay - late * period, 0.0)
        on_the_way = late + 1
        size = N + 2 * q + on_the_way * q
        xi, alpha, held = slice(0, N), slice(N, N + q), slice(N + q, N + 2 * q)
        waiting = [slice(N + (2 + j) * q, N + (3 + j) * q) for j in range(on_the_way)]
        M = np.zeros((size, size))
        M[xi, xi], M[alpha, xi] = linear.A0, -linear.K0
        for part in (alpha, held):
            M[xi, part], M[alpha, part] = linear.E, -linear.K
        take, arrive = np.eye(size), np.eye(size)
        for part in (held, *waiting):
            take[part, alpha] = np.eye(q)
        take[alpha] = take[waiting[-1]] = 0.0
        take[waiting[-1], xi] = linear.H
        for j, part in enumerate((held, *waiting[:-1])):
            arrive[part] = 0.0
            arrive[part, waiting[j]] = np.eye(q)
        arrive[waiting[-1]] = 0.0
        self.M = M
        self.L = np.zeros((linear.L.shape[0], size))
        self.L[:, xi] = linear.L
        self.step = arrive @ expm(M * rest) @ take @ expm(M * (period - rest))
        self.noise = np.zeros((size, q))
        self.noise[held] = -np.eye(q)
        self.radius = float(np.max(np.abs(np.linalg.eigvals(self.step)), initial=0.0))
        if not self.radius < 1 - 1e-9:
            raise NoValue(f"with this sampling the linearisation is not stable: spectral radius {self.radius:.4g}")

    def power_of(self, covariance: np.ndarray) -> np.ndarray:
        """Mean squares of the estimate over a period that starts with this covariance (or psi psi^*) after arrival."""
        return mean_squares(self.M, self.L, self.period, covariance)

    def psi(self, angle: float) -> np.ndarray:
        """psi after arrival, over v_k = exp(j angle k) on each output, shape (size, q)."""
        z = np.exp(1j * angle)
        return np.asarray(np.linalg.solve(z * np.eye(self.step.shape[0]) - self.step, z * self.noise))

    @cached_property
    def covariance(self) -> list[np.ndarray]:
        """Of psi after arrival, under independent samples of unit variance on each output."""
        return [discrete_covariance(self.step, np.outer(column, column)) for column in self.noise.T]

    def gain(self, omega: np.ndarray, output: int = 0) -> np.ndarray:
        """Root mean square of the estimate over that of the samples sin(omega t_k), shape (W, n).

        At multiples of the sampling frequency samples are constant, at odd multiples of half of it they alternate.
        """
        found = []
        for angle in np.asarray(omega) * self.period:
            psi = self.psi(angle)[:, output]
            found.append(np.sqrt(self.power_of(np.outer(psi, psi.conj()))))
        return np.array(found)

    def power(self, terms: list[NoiseTerms], start: float) -> np.ndarray:
        """Mean square of the noise in each state of the estimate, averaged over the period, shape (n,).

        Parameters
        ----------
        terms : list of NoiseTerms
            Of every output.
        start : float
            The time of sample 0.

        Raises
        ------
        NoValue
            For draws held longer than a period, and noise whose spectrum is not known.
        """
        require_spectra(terms)
        outputs = [i for i, t in enumerate(terms) for _ in aliased(t.waves, self.period, start)]
        waves = [w for t in terms for w in aliased(t.waves, self.period, start)]
        power = np.zeros(self.L.shape[0])
        means = np.array([t.mean for t in terms])
        for angle in {w.omega for w in waves} | ({0.0} if means.any() else set()):
            phasor = np.zeros(len(terms), dtype=complex)
            for wave, i in zip(waves, outputs, strict=True):
                if wave.omega == angle:
                    phasor[i] += wave.phasor
            if min(angle, np.pi - angle) < 1e-9:  # v_k = (-1)^k or 1 times the imaginary part
                value = phasor.imag + (means if angle < 1e-9 else 0)
                psi = self.psi(angle).real @ value
                power += self.power_of(np.outer(psi, psi))
            else:
                psi = self.psi(angle) @ phasor
                power += self.power_of(np.outer(psi, psi.conj())) / 2
        for i, t in enumerate(terms):
            for d in t.draws:
                if d.variance > 0:
                    if d.hold is not None and d.hold > self.period * (1 + _SHORT):
                        raise NoValue("draws held longer than a sampling period are not independent")
                    power += self.power_of(self.covariance[i] * d.variance)
        return power
