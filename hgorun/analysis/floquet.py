"""How much an error grows over a period of sampling: monodromy matrices, and their products along a trajectory."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.error_system import ErrorSystem

_TERMS = 9  # of the exponential's series, after scaling to a norm of 1/2: 3e-10
_FINE = 0.5  # of 1/rate: the longest step of a transition matrix
_MOST_STEPS = 8_000
MOST_PERIODS = 20_000  # that a growth rate is taken over, the first ones of a trajectory


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
        count = int(np.clip(whole, 1, MOST_PERIODS))
        starts = system.times[0] + period * np.arange(count)
    before = transitions(system, starts, period - rest)
    after = transitions(system, starts + period - rest, rest) if rest > 0 else None
    H = interpolated(system.times, system.H, starts + period - rest)
    M = _monodromy(before, after, H, waiting)
    product, logarithm = _ordered_product(M)
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


def transitions(system: ErrorSystem, starts: np.ndarray, length: float) -> np.ndarray:
    """Transition matrices of (xi, e) from each start over a length, shape (len(starts), N + q, N + q).

    Magnus' fourth-order method between output points: exact where the system does not change.
    """
    G = system.G
    if system.constant:
        from scipy.linalg import expm

        return np.broadcast_to(expm(G[0] * length), (starts.size, *G.shape[1:]))
    step = _FINE / system.fastest
    steps = int(np.clip(np.ceil(length / step), 1, max(_MOST_STEPS // starts.size, 1)))
    h = length / steps
    at = starts[:, None] + h * np.arange(steps)
    root = np.sqrt(3) / 6
    G_1, G_2 = (interpolated(system.times, G, (at + h * (0.5 + c * root)).ravel()) for c in (-1, 1))
    Omega = h / 2 * (G_1 + G_2) + np.sqrt(3) / 12 * h**2 * (G_2 @ G_1 - G_1 @ G_2)
    return _tree(exponentials(Omega).reshape(starts.size, steps, *G.shape[1:]))


def interpolated(times: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Matrices on an even grid of times, at other times."""
    if times.size == 1:
        return np.broadcast_to(values[0], (at.size, *values.shape[1:]))
    place = np.clip((at - times[0]) / (times[1] - times[0]), 0, times.size - 1)
    left = np.minimum(place.astype(int), times.size - 2)
    weight = (place - left)[:, None, None]
    return np.asarray(values[left] * (1 - weight) + values[left + 1] * weight)


def exponentials(Omega: np.ndarray) -> np.ndarray:
    """Of many matrices at once."""
    norm = float(np.max(np.abs(Omega).sum(axis=2)))
    halvings = max(int(np.ceil(np.log2(max(norm, 1e-300) / 0.5))), 0)
    X = Omega / 2**halvings
    eye = np.eye(X.shape[1])
    value = eye + X / _TERMS
    for k in range(_TERMS - 1, 0, -1):
        value = eye + X @ value / k
    for _ in range(halvings):
        value = value @ value
    return np.asarray(value)


def _tree(factors: np.ndarray) -> np.ndarray:
    """Products along the second axis, later factors to the left."""
    while factors.shape[1] > 1:
        odd = factors[:, -1:] if factors.shape[1] % 2 else factors[:, :0]
        pairs = factors[:, 1::2] @ factors[:, : factors.shape[1] - odd.shape[1] : 2]
        factors = np.concatenate([pairs, odd], axis=1)
    return np.asarray(factors[:, 0])


def _ordered_product(factors: np.ndarray) -> tuple[np.ndarray, float]:
    """(P, s) with the product of all factors, later ones to the left, equal to e^s P."""
    logarithm = 0.0
    while True:
        norms = np.linalg.norm(factors, axis=(1, 2))
        norms = np.where(norms > 0, norms, 1.0)
        factors = factors / norms[:, None, None]
        logarithm += float(np.sum(np.log(norms)))
        if len(factors) == 1:
            return factors[0], logarithm
        odd = factors[-1:] if len(factors) % 2 else factors[:0]
        pairs = factors[1::2] @ factors[: len(factors) - len(odd) : 2]
        factors = np.concatenate([pairs, odd])
