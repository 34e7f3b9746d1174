"""How much an error grows over a period of sampling: monodromy matrices, and their products along a trajectory."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.linear.error_system import ErrorSystem
from hgorun.analysis.linear.exponentials import interpolated, ordered_product, transitions

MAX_PERIODS = 20_000  # that a growth rate is taken over, the first ones of a trajectory


def growth(system: ErrorSystem, period: float, delay: float = 0.0) -> float:
    """Mean exponential rate of the error with a sample each period, ``delay`` old when it arrives (1/time).

    The sample of time t_k - d arrives at t_k. From then on the innovation is e(t) = H xi(t_k - d) minus what
    the observer has corrected since; the samples that are on their way, m = floor(d / period) of them, are
    carried along in the same way, each as what the innovation would be now. With delta = d - m period the
    next one is taken at t_(k+1) - delta. The rate is log rho / time, rho the spectral radius of the product of
    the monodromy matrices over all whole periods of the trajectory, or of the one that they all are.
    """
    waiting = int(np.floor(delay / period * (1 + 1e-12) + 1e-12))
    rest = max(delay - waiting * period, 0.0)
    rest = 0.0 if rest < 1e-12 * period else rest
    if system.constant:
        starts, count = np.zeros(1), 1
    else:
        whole = (system.times[-1] - system.times[0]) / period * (1 + 1e-12)
        count = int(np.clip(whole, 1, MAX_PERIODS))
        starts = system.times[0] + period * np.arange(count)
    before = transitions(system, starts, period - rest)
    after = transitions(system, starts + period - rest, rest) if rest > 0 else None
    H = interpolated(system.times, system.H, starts + period - rest)
    M = _monodromy(before, after, H, waiting)
    product, logarithm = ordered_product(M)
    radius = float(np.max(np.abs(np.linalg.eigvals(product))))
    with np.errstate(divide="ignore"):
        return float((np.log(radius) + logarithm) / (count * period))


def _monodromy(before: np.ndarray, after: np.ndarray | None, H: np.ndarray, waiting: int) -> np.ndarray:
    """From each arrival to the next, of (xi, e, samples on their way), shape (P, N + (waiting + 1) q,) squared."""
    q, N = H.shape[1:]
    size = N + (waiting + 1) * q

    def flow(now: np.ndarray, transition: np.ndarray, carried: int) -> np.ndarray:
        """e and all that is on its way change by the same amount."""
        moved = transition @ now[:, : N + q]
        change = np.tile(moved[:, N:] - now[:, N : N + q], (1, carried - 1, 1))
        return np.concatenate([moved, now[:, N + q :] + change], axis=1)

    state = flow(np.broadcast_to(np.eye(size), (len(before), size, size)), before, waiting + 1)
    state = np.concatenate([state, H @ state[:, :N]], axis=1)  # the sample that is taken
    if after is not None:
        state = flow(state, after, waiting + 2)
    return np.concatenate([state[:, :N], state[:, N + q :]], axis=1)
