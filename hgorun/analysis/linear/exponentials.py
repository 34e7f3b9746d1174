"""What exponentials make of linear systems: transition matrices, and ordered products of many of them."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.linear.error_system import ErrorSystem
from hgorun.simulation.error_dynamics.monodromy import exponentials

_FINE = 0.5  # of 1/rate: the longest step of a transition matrix
_MAX_STEPS = 8_000


def transitions(system: ErrorSystem, starts: np.ndarray, length: float) -> np.ndarray:
    """Transition matrices of (xi, e) from each start over a length, shape (len(starts), N + q, N + q).

    Magnus' fourth-order method between output points: exact where the system does not change.
    """
    G = system.G
    if system.constant:
        from scipy.linalg import expm

        return np.broadcast_to(expm(G[0] * length), (starts.size, *G.shape[1:]))
    step = _FINE / system.fastest
    steps = int(np.clip(np.ceil(length / step), 1, max(_MAX_STEPS // starts.size, 1)))
    h = length / steps
    at = starts[:, None] + h * np.arange(steps)
    root = np.sqrt(3) / 6
    G_1, G_2 = (interpolated(system.times, G, system.within((at + h * (0.5 + c * root)).ravel())) for c in (-1, 1))
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


def _tree(factors: np.ndarray) -> np.ndarray:
    """Products along the second axis, later factors to the left."""
    while factors.shape[1] > 1:
        odd = factors[:, -1:] if factors.shape[1] % 2 else factors[:, :0]
        pairs = factors[:, 1::2] @ factors[:, : factors.shape[1] - odd.shape[1] : 2]
        factors = np.concatenate([pairs, odd], axis=1)
    return np.asarray(factors[:, 0])


def ordered_product(factors: np.ndarray) -> tuple[np.ndarray, float]:
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
