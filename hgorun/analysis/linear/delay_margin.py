"""The exact delay margin of an observer with a continuous, late output."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.reasons import NoValue

_POINTS = 4_000
_RANGE = 1e-4, 1e4  # of the fastest rate: frequencies looked at


def delay_margin(A0: np.ndarray, E: np.ndarray, H: np.ndarray, K0: np.ndarray, K: np.ndarray) -> float:
    """The smallest constant delay d at which xi' = A0 xi + E e is no longer stable, where

        e = H xi(t - d) + alpha(t) - alpha(t - d),    alpha' = -(K0 xi + K e)

    With X = (s I - A0)^-1 E, g = H X and k = K0 X + K the characteristic equation is, after multiplication by s,

        det(e^(s d) (s I + k) - (s g + k)) = 0

    At s = j omega every eigenvalue mu of the pencil (j omega g + k, j omega I + k) with modulus 1 is a crossing,
    at d = arg(mu)/omega. What the multiplication has added at s = 0 is left out; a real root that passes
    through 0 is looked for in the equations at rest, where alpha(t) - alpha(t - d) = -d c.

    Raises
    ------
    NoValue
        Where it is unstable without delay, or stable whatever the delay.
    """
    from scipy.optimize import brentq

    A = A0 + E @ H
    poles = np.linalg.eigvals(A)
    if np.max(poles.real) >= 0:
        raise NoValue("unstable even without delay")
    N, q = E.shape
    eye = np.eye(N)

    def moduli(omega: float) -> np.ndarray:
        return np.sort(np.abs(_factors(omega)))

    def _factors(omega: float) -> np.ndarray:
        X = np.linalg.solve(1j * omega * eye - A0, E.astype(complex))
        k = K0 @ X + K
        return np.asarray(np.linalg.eigvals(np.linalg.solve(1j * omega * np.eye(q) + k, 1j * omega * (H @ X) + k)))

    fastest = float(np.max(np.abs(np.concatenate([poles, np.linalg.eigvals(A0)]))))
    grid = np.geomspace(_RANGE[0] * fastest, _RANGE[1] * fastest, _POINTS)
    X = np.linalg.solve(1j * grid[:, None, None] * eye - A0, np.broadcast_to(E.astype(complex), (grid.size, N, q)))
    k = K0 @ X + K
    s = 1j * grid[:, None, None]
    curves = np.sort(np.abs(np.linalg.eigvals(np.linalg.solve(s * np.eye(q) + k, s * (H @ X) + k))), axis=1)
    candidates = _constant_solutions(A0, E, H, K0, K)
    for j in range(q):
        above = curves[:, j] > 1
        for i in np.flatnonzero(above[1:] != above[:-1]):
            omega = float(brentq(lambda w, j=j: float(moduli(w)[j]) - 1, grid[i], grid[i + 1], xtol=1e-14 * grid[i]))
            mu = _factors(omega)
            angle = float(np.angle(mu[np.argsort(np.abs(mu))[j]])) % (2 * np.pi)
            candidates.append(angle / omega)
    if not candidates:
        raise NoValue("stable at every delay")
    return min(candidates)


def _constant_solutions(A0: np.ndarray, E: np.ndarray, H: np.ndarray, K0: np.ndarray, K: np.ndarray) -> list[float]:
    """Delays at which the equations have a constant solution other than zero."""
    from scipy.linalg import eigvals

    q = E.shape[1]
    still = np.block([[A0, E], [H, -np.eye(q)]])
    late = np.block([[np.zeros_like(A0), np.zeros_like(E)], [K0, K]])
    # det(still - d late) = 0; 1/d are the eigenvalues of still^-1 late, and det(still) = +-det(A0 + E H) is not zero
    inverse = eigvals(np.linalg.solve(still, late))
    size = max(float(np.max(np.abs(inverse))), 1e-300)
    real = inverse[(np.abs(inverse.imag) < 1e-9 * size) & (inverse.real > 1e-9 * size)].real
    return [float(1 / value) for value in real]
