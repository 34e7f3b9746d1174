"""The largest norm and the outermost eigenvalues of many small matrices: decomposed are few of them."""

from __future__ import annotations

import numpy as np

_ROUNDING = 1e-9  # of norms, relatively: what is that near is decomposed, too
_EPS = 16 * np.finfo(float).eps  # of eigenvalues, in parts of the largest: what they are known to
_EVERY = 64  # of so many matrices one is decomposed at first
_AT_ONCE = 2048  # matrices whose entries the processor keeps near
_FEW = 512  # all are, of no more


def largest_norm(stack: np.ndarray) -> float:
    """The largest spectral norm of many matrices, shape (N, k, n).

    A norm is no less than any column's, and no more than sqrt(|A|_1 |A|_inf): what lies below the largest column is
    not looked at.
    """
    entries = np.ascontiguousarray(np.moveaxis(np.abs(stack), 0, -1))
    most = np.sqrt(np.max(np.sum(entries, axis=0), axis=0) * np.max(np.sum(entries, axis=1), axis=0))
    least = np.sqrt(np.max(np.sum(entries**2, axis=0)))
    return float(np.max(np.linalg.norm(stack[most >= least * (1 - _ROUNDING)], 2, axis=(1, 2))))


def outermost(stack: np.ndarray) -> tuple[float, float]:
    """The smallest and the largest eigenvalue of many symmetric matrices, shape (N, n, n).

    Some of them give values that others may surpass, by more than rounding: where A - low I or high I - A has a pivot
    that is not positive. Pivots are found for all matrices at once.
    """
    values = np.linalg.eigvalsh(stack[:: _EVERY if len(stack) > _FEW else 1])
    low, high = float(np.min(values)), float(np.max(values))
    if len(stack) > _FEW:
        slack = _EPS * max(abs(low), abs(high))
        entries = np.moveaxis(stack, 0, -1)
        values = np.linalg.eigvalsh(stack[~(_positive(entries, slack - low) & _positive(-entries, slack + high))])
        low, high = float(np.min(values, initial=low)), float(np.max(values, initial=high))
    return low, high


def _positive(entries: np.ndarray, shift: float) -> np.ndarray:
    """Which of the matrices A + shift I, entries (n, n, N), are positive definite: by Gaussian elimination."""
    count = entries.shape[-1]
    if count > _AT_ONCE:
        parts = [_positive(entries[..., k : k + _AT_ONCE], shift) for k in range(0, count, _AT_ONCE)]
        return np.concatenate(parts)
    rest = np.array(entries)  # contiguous: each entry of all matrices is one row
    n = len(rest)
    rest[range(n), range(n)] += shift
    positive = np.ones(rest.shape[-1], dtype=bool)
    with np.errstate(all="ignore"):
        for k in range(n):
            positive &= rest[k, k] > 0  # where a pivot is not, what follows is not read
            for i in range(k + 1, n):
                factor = rest[i, k] / rest[k, k]
                for j in range(i, n):
                    rest[j, i] -= factor * rest[j, k]
    return positive
