"""The extended Kalman filter of a pendulum with friction, a' = b, b' = -sin(a) - 0.1 b, y = a, written out naively.

Its states are the estimate and P in the order a, b, P_aa, P_ab, P_bb; Q has 0.1 for b, and R is 0.01.
"""

from __future__ import annotations

import numpy as np


def flow(z: np.ndarray) -> np.ndarray:
    """Estimate and P of the filter between samples."""
    a, b, p, q, r = z
    c = np.cos(a)
    return np.array([b, -np.sin(a) - 0.1 * b, 2 * q, r - c * p - 0.1 * q, 2 * (-c * q - 0.1 * r) + 0.1])


def flown(z: np.ndarray, span: float, step: float) -> np.ndarray:
    """RK4, in steps of about ``step``."""
    steps = max(round(span / step), 1)
    h = span / steps
    for _ in range(steps):
        k1 = flow(z)
        k2 = flow(z + h / 2 * k1)
        k3 = flow(z + h / 2 * k2)
        z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + flow(z + h * k3))
    return z


def corrected(z: np.ndarray, y: float) -> np.ndarray:
    """By a sample."""
    a, b, p, q, r = z
    k, m = p / (p + 0.01), q / (p + 0.01)
    return np.array([a + k * (y - a), b + m * (y - a), p - k * p, q - k * q, r - m * q])
