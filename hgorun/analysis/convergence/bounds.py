"""Sufficient bounds on theta, on the delay and on the sampling period, as the proofs give them.

They are far from tight, by factors of 1e2 to 1e6, since each step of a proof gives something away: beside
them stand the exact limits of the linear error, and what a simulation shows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hgorun.analysis.convergence.gains import ErrorDynamics
from hgorun.analysis.convergence.lipschitz import Lipschitz

_FAR = 1e15  # no theta beyond this is looked for
_NEAR = 2e-12  # of a root, relatively: much more than rounding
_TURNS = 30


@dataclass(frozen=True)
class Halanay:
    """v'(t) <= -a v(t) + b (integral of v over the last d) + p, Lemma 3.4.1 of Robles Magdaleno 2023.

    For b d < a and v <= v_0 before t_0,

        v(t) <= exp(-eta (t - t_0)) v_0 + p/eta,    eta = (a - b d) exp(-a d)                          (3.62)

    The lemma has 1 + d (a - eta) in front, which (3.69) leaves out, and may: exp(-eta t) v_0 + p/(a - b d) is
    an upper solution, for eta + b (exp(eta d) - 1)/eta <= a and a - b d >= eta.
    """

    a: float
    b: float

    @property
    def longest(self) -> float:
        """d has to be less than this."""
        if not self.a > 0:
            return 0.0
        return self.a / self.b if self.b > 0 else np.inf

    def rate(self, d: float) -> float:
        """eta; minus infinity where d is too long, or there is no decay without delay."""
        if not self.a > 0 or not self.b * d < self.a:
            return -np.inf
        return float((self.a - self.b * d) * np.exp(-self.a * d))


def smallest_theta(beta: float, constant: Callable[[float], float]) -> float:
    """The smallest theta >= 1 with beta theta >= c_1(theta), below (3.42): c_1 does not rise with theta.

    The proof asks for theta >= 2 c_1 lambda_max(P)/mu with a c_1 that does not depend on theta, as c_1(1) does.
    (2.16) of the thesis has c_1 = sqrt(n) L_phi: right with Lipschitz constants in the Euclidean norm; with those
    of (3.8) it can be too small (n = 2, phi = L (x_1, x_1 + x_2): 1.618 L), and n L_phi of (3.17) is right.
    """
    first = constant(1.0)
    if first <= beta:
        return 1.0
    low, high = 1.0, min(first / beta, _FAR)
    last = constant(high)
    if not last <= beta * high * (1 + 1e-12):
        return np.inf
    small, large = _about(beta, constant, (low, first), (high, last))
    while low < (middle := 0.5 * (low + high)) < high and high - low > 1e-12 * high:
        enough = middle >= large or (middle > small and constant(middle) <= beta * middle)
        low, high = (low, middle) if enough else (middle, high)
    return high


def _about(
    beta: float, constant: Callable[[float], float], low: tuple[float, float], high: tuple[float, float]
) -> tuple[float, float]:
    """A theta that is too small and one that is not, from two that are given with their c_1: none beyond is tried.

    The root of log c_1(theta) = log(beta theta), which is nearly straight in log theta, by false position of whose
    ends none stays for long (Illinois). What is left about it is much wider than rounding reaches.
    """
    small, large = low[0], high[0]
    if not min(low[1], high[1]) > 0:
        return small, large
    (left, above), (right, below) = ((np.log(theta), np.log(c / (beta * theta))) for theta, c in (low, high))
    root, moved, kept = left, np.inf, 0
    for _ in range(_TURNS):
        if not above > 0 > below or moved < _NEAR / 10:
            break
        before, root = root, left + (right - left) * above / (above - below)
        now, moved = np.log(constant(float(np.exp(root))) / beta) - root, abs(root - before)
        if now > 0:
            left, above, below, kept = root, now, below / 2 if kept == 1 else below, 1
        else:
            right, below, above, kept = root, now, above / 2 if kept == -1 else above, -1
    near = float(np.exp(root)) * (1 - _NEAR), float(np.exp(root)) * (1 + _NEAR)
    if small < near[0] and constant(near[0]) > beta * near[0]:
        small = near[0]
    if near[1] < large and constant(near[1]) <= beta * near[1]:
        large = near[1]
    return small, large


def printed_theta(beta: float, lipschitz: Lipschitz) -> float:
    """max(1, n L_phi/beta): the same with c_1 = n L_phi of (3.17)."""
    return max(1.0, len(lipschitz.positions) * lipschitz.value / beta)


def delayed(dynamics: ErrorDynamics, lipschitz: Lipschitz, theta: float) -> Halanay:
    """Theorem 3.4.1: d_M < beta/(chi (L_phi + theta)) (3.68), with the decay eta_theta(d_M) (3.70).

    V = zbar^T P zbar has (sqrt V)' <= -beta theta sqrt V + |P^(1/2) B~| theta |xi|, where xi, what the output did since
    it was measured, is at most (theta + L_phi) times the integral of |zbar| (3.77), |zbar| <= sqrt(V/lambda_min). For a
    filter of order r >= 1, |B~| = 1, so that sqrt(chi) would do where (3.81) has chi. The standard observer, r = 0, has
    |B~| = |G|, and needs sqrt(chi) |G|: chi is enough where |G|^2 <= chi, else that is taken. An observer whose
    output moves with more than the second state (low_power) has |flux| theta for theta.
    """
    chi, push = dynamics.lyapunov.chi, dynamics.push
    motion = theta * max(1.0, dynamics.motion) + lipschitz.of_outputs
    return Halanay(dynamics.lyapunov.beta * theta, float(max(chi, np.sqrt(chi) * push)) * theta * motion)


def delayed_sharply(dynamics: ErrorDynamics, lipschitz: Lipschitz, theta: float) -> Halanay:
    """The same proof with nothing given away for a shorter formula: a = 2 beta theta - c_1, |P^(1/2) B~| as it is."""
    push = float(np.sqrt(dynamics.energy / dynamics.lyapunov.eigenvalues[0]))
    motion = theta * dynamics.motion + lipschitz.of_outputs
    return Halanay(2 * dynamics.lyapunov.beta * theta - lipschitz.constant(theta), push * theta * motion)
