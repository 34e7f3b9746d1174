"""What becomes of small errors from one sample to the next: exponentials of matrices, and monodromy matrices."""

from __future__ import annotations

import numpy as np

_TERMS = 9  # of the exponential's series, after scaling to a norm of 1/2: 3e-10


def on_their_way(period: float, delay: float) -> tuple[int, float]:
    """How many samples are on their way at a time, and how long before an arrival the next one is taken."""
    waiting = int(np.floor(delay / period * (1 + 1e-12) + 1e-12))
    rest = max(delay - waiting * period, 0.0)
    return waiting, 0.0 if rest < 1e-12 * period else rest


def monodromy(before: np.ndarray, after: np.ndarray | None, H: np.ndarray, waiting: int) -> np.ndarray:
    """From each arrival to the next, of (xi, e, samples on their way), shape (P, N + (waiting + 1) q,) squared.

    Parameters
    ----------
    before, after : ndarray, shape (P, N + q, N + q)
        Transitions of (xi, e) until the next sample is taken, and from then until one arrives; None: at once.
    H : ndarray, shape (P, q, N)
        C xhat = H xi, when it is taken.
    waiting : int
        Samples on their way, as :func:`on_their_way`.
    """
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
