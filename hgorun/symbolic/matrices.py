"""The matrices of the high-gain literature, and the gains that place poles.

Sizes are always explicit: ``A(k)`` is the k x k anti-shift matrix, ``B(k)`` and ``C(k)`` its
input column and output row, ``inv_Delta(theta, k)`` the inverse of
diag(1, 1/theta, ..., 1/theta^(k-1)) (Robles Magdaleno 2023, (3.1)-(3.4)).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import casadi as ca
import numpy as np


def A(k: int) -> ca.DM:
    """Anti-shift matrix: ones on the first superdiagonal."""
    return ca.DM(np.eye(k, k=1))


def B(k: int) -> ca.DM:
    """(0, ..., 0, 1)^T."""
    return ca.DM(np.eye(k)[:, -1:])


def C(k: int) -> ca.DM:
    """(1, 0, ..., 0)."""
    return ca.DM(np.eye(k)[:1, :])


def inv_Delta(theta: ca.SX, k: int) -> ca.SX:
    """diag(1, theta, ..., theta^(k-1))."""
    powers = [ca.SX(1)]
    for _ in range(k - 1):
        powers.append(powers[-1] * theta)
    return ca.diag(ca.vertcat(*powers))


def hurwitz_gain(k: int, poles: complex | Sequence[complex]) -> np.ndarray:
    """The gain K for which A(k) - K C(k) has the given eigenvalues.

    Parameters
    ----------
    k : int
        Order of the chain.
    poles : number or sequence of k numbers
        One number stands for k equal poles: all at -1 gives the binomial coefficients.

    Returns
    -------
    ndarray, shape (k,)
    """
    roots = np.full(k, poles) if np.ndim(poles) == 0 else np.asarray(poles)
    return _characteristic(roots.tobytes(), roots.dtype.str)[1:].copy() if k else np.zeros(0)


@lru_cache(maxsize=256)
def _characteristic(roots: bytes, kind: str) -> np.ndarray:
    """The polynomial with these roots; runs of a family have the same ones again and again."""
    return np.asarray(np.real(np.poly(np.frombuffer(roots, kind))))
