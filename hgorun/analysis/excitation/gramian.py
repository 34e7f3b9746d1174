"""The observability Gramian that the excitation conditions of the time-varying observers bound from below.

With Phi the transition matrix of xi' = F(t) xi, Delta = diag(I, I/theta, ..., I/theta^(q-1)) by blocks,

    theta Delta^-1 integral_(t - T*/theta)^t Phi(s, t)^T C^T C Phi(s, t) ds Delta^-1 >= delta* I

is Robles Magdaleno 2023, (3.86), and (2.43) with rho_0/alpha(theta) for delta*. Delta F Delta^-1 = theta F and
C Delta = C make it, in the time sigma = theta (t - s) and free of theta,

    W(t) = integral_0^T* Psi^T C^T C Psi d sigma,    Psi' = -F(t - sigma/theta) Psi,    Psi(0) = I
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_PER_UNIT = 24  # steps of sigma in one unit, even for Simpson's rule
_ROUNDING = 1e-15  # relative size of an eigenvalue that is zero


@dataclass(frozen=True)
class Links:
    """F(t), block superdiagonal, on a grid of times, and the rows that are measured.

    Attributes
    ----------
    times : ndarray, shape (M,)
    F : ndarray, shape (M, n, n)
        Nilpotent.
    C : ndarray, shape (q, n)
    links : ndarray of bool, shape (n, n)
        Where the model has a link, be it zero at all these times.
    """

    times: np.ndarray
    F: np.ndarray
    C: np.ndarray
    links: np.ndarray

    @property
    def n(self) -> int:
        """Number of states."""
        return int(self.F.shape[1])

    def behind_integrators(self, r: int) -> Links:
        """[[A_r, B_r C], [0, F]] and (C_r, 0), for one output, (3.97)."""
        if r == 0:
            return self
        F = np.zeros((len(self.F), r + self.n, r + self.n))
        F[:, :r, :r] = np.eye(r, k=1)
        F[:, r - 1, r:] = self.C[0]
        links = np.any(F != 0, axis=0)
        links[r:, r:] = self.links
        F[:, r:, r:] = self.F
        return Links(self.times, F, np.eye(r + self.n)[:1], links)

    def unbroken(self) -> Links:
        """The system whose links are all 1."""
        return Links(self.times[:1], self.links.astype(float)[None], self.C, self.links)


def gramians(links: Links, at: np.ndarray, theta: float, horizons: np.ndarray) -> np.ndarray:
    """W(t) for several horizons T*.

    Parameters
    ----------
    at : ndarray, shape (M,)
    horizons : ndarray, shape (J,)
        Increasing, multiples of 1/12.

    Returns
    -------
    ndarray, shape (J, M, n, n)
    """
    h = 1.0 / _PER_UNIT
    found, last = [], 0
    Psi = np.broadcast_to(np.eye(links.n), (at.size, links.n, links.n))
    W = np.zeros_like(Psi)
    row = links.C @ Psi
    density = row.swapaxes(1, 2) @ row
    for horizon in horizons:
        steps = round(horizon / h)
        for j in range(last, steps, 2):
            # Simpson's rule over two steps of the exponential at their middles
            three = [density]
            for i in (j, j + 1):
                Psi = _step(_at(links, at - (i + 0.5) * h / theta), h) @ Psi
                row = links.C @ Psi
                three.append(row.swapaxes(1, 2) @ row)
            W = W + h / 3 * (three[0] + 4 * three[1] + three[2])
            density = three[2]
        last = steps
        found.append(W)
    return np.array(found)


def seen(W: np.ndarray) -> np.ndarray:
    """How well each state is seen whatever the others are: min v^T W v over v_i = 1, which is 1/(W^-1)_ii.

    Parameters
    ----------
    W : ndarray, shape (M, n, n)

    Returns
    -------
    ndarray, shape (M, n)
    """
    values, vectors = np.linalg.eigh(W)
    largest = np.maximum(values[:, -1:], 1e-300)
    inverse = np.einsum("mik,mk->mi", vectors**2, 1 / np.maximum(values, _ROUNDING * largest))
    return np.asarray(1 / inverse)


def _at(links: Links, times: np.ndarray) -> np.ndarray:
    """F at other times, linearly between the points of the grid."""
    if links.times.size == 1:
        return np.asarray(links.F)
    F = np.zeros((times.size, links.n, links.n))
    for i, j in np.argwhere(np.any(links.F != 0, axis=0)):
        F[:, i, j] = np.interp(times, links.times, links.F[:, i, j])
    return F


def _step(F: np.ndarray, h: float) -> np.ndarray:
    """exp(-h F): a polynomial, F being nilpotent."""
    value = np.eye(F.shape[1]) - h / F.shape[1] * F
    for k in range(F.shape[1] - 1, 0, -1):
        value = np.eye(F.shape[1]) - h / k * F @ value
    return np.asarray(value)
