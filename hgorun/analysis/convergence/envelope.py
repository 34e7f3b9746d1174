"""Exponential envelopes of the scaled error, as the proofs of convergence give them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.analysis.convergence.bounds import Halanay
from hgorun.analysis.convergence.gains import ErrorDynamics
from hgorun.analysis.convergence.signals import Amplitudes


@dataclass(frozen=True)
class Envelope:
    """|zbar(t)| <= gain (exp(-rate (t - t_0)) start + drive/rate)."""

    gain: float
    rate: float
    start: float
    drive: float

    def at(self, since: np.ndarray) -> np.ndarray:
        """The bound so long after the start."""
        if not self.rate > 0:
            return np.full(since.shape, np.inf)
        return np.asarray(self.gain * (np.exp(-self.rate * since) * self.start + self.drive / self.rate))


def printed(dynamics: ErrorDynamics, delay: Halanay, start: np.ndarray, theta: float, a: Amplitudes) -> Envelope:
    """(3.22), (3.34), with late outputs (3.69), of Robles Magdaleno 2023.

        |e_i| <= chi theta^(i-1) (exp(-rate (t - t_0)) |e(t_0)| + (theta |B~| delta_v + theta^(1-n) delta_eps)/rate)

    rate = beta theta, or eta_theta(d_M); |B~| is |G_n| for the standard observer (3.22) and 1 behind a filter
    (3.34). (3.69) prints another beta before eta_theta, which contains it: without a delay it has to be (3.34).
    A disturbance of the i-th equation has theta^(1-i) for theta^(1-n).

    Parameters
    ----------
    start : ndarray, shape (N,)
        z(t_0), the estimate's error first.
    """
    scale = dynamics.scale(theta)
    first = max(float(np.linalg.norm(start)), float(np.linalg.norm(scale * start)))
    drive = theta * dynamics.push * a.noise + _pushed(dynamics, theta, a)
    return Envelope(dynamics.lyapunov.chi, delay.rate(a.delay), first, drive)


def of_energy(dynamics: ErrorDynamics, delay: Halanay, start: np.ndarray, theta: float, a: Amplitudes) -> Envelope:
    """sqrt V of the same proof; |zbar_i| <= sqrt((P^-1)_ii) sqrt V. ``gain`` is left 1 for that."""
    P = dynamics.lyapunov.P
    first = float(np.sqrt(max(_form(P, dynamics.scale(theta) * start), 0.0)))
    noise = theta * float(np.sqrt(dynamics.energy)) * a.noise
    pushed = np.sqrt(dynamics.lyapunov.eigenvalues[1]) * _pushed(dynamics, theta, a)
    return Envelope(1.0, delay.rate(a.delay), first, noise + float(pushed))


def _form(P: np.ndarray, z: np.ndarray) -> float:
    return float(z @ P @ z)


def _pushed(dynamics: ErrorDynamics, theta: float, a: Amplitudes) -> float:
    """|D~ eps|: disturbance and rounding, in zbar."""
    return float(np.linalg.norm(dynamics.scale(theta)[: dynamics.n] * (a.disturbance + a.rounding)))
