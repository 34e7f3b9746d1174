"""Ranks and conditions that do not depend on units: rows and columns may come in any, from 1e-12 to 1e12."""

from __future__ import annotations

from hashlib import sha256

import numpy as np

SINGULAR = 1e-10  # smallest over largest singular value below which a matrix counts as singular
_ROUNDS = 30
_POINTS = 8
# of a state that is zero at the start, where nothing says which size is typical
_SIZES = (0.1, 1.0, 1e-3, 30.0, 1e-6, 1e3, 1e-9, 1e6)


def equilibrated(matrix: np.ndarray) -> np.ndarray:
    """The matrix with rows and columns in units of their own, so that all have about the norm one (Sinkhorn).

    Rows and columns of zeros are left out. The limit is the same in whatever units the matrix was given.
    """
    scaled = np.abs(matrix)
    rows, columns = np.any(scaled > 0, axis=1), np.any(scaled > 0, axis=0)
    scaled = np.asarray(matrix[np.ix_(rows, columns)], dtype=float)
    for _ in range(_ROUNDS if scaled.size else 0):
        scaled = scaled / np.max(np.abs(scaled), axis=1, keepdims=True)
        scaled = scaled / np.linalg.norm(scaled, axis=1, keepdims=True)
        scaled = scaled / np.max(np.abs(scaled), axis=0, keepdims=True)
        scaled = scaled / np.linalg.norm(scaled, axis=0, keepdims=True)
    return np.asarray(scaled)


def singular_value_ratio(matrix: np.ndarray) -> float:
    """Smallest over largest singular value of the :func:`equilibrated` matrix; 0 when it has not rank n.

    Parameters
    ----------
    matrix : ndarray, shape (m, n), m >= n
    """
    if not np.all(np.isfinite(matrix)):
        return float("nan")
    scaled = equilibrated(matrix)
    if scaled.shape[1] < matrix.shape[1] or scaled.shape[0] < matrix.shape[1]:
        return 0.0
    values = np.linalg.svd(scaled, compute_uv=False)
    return float(values[-1] / values[0])


def rank(matrix: np.ndarray) -> int:
    """Rank of the :func:`equilibrated` matrix; 0 where it is not finite."""
    if not np.all(np.isfinite(matrix)):
        return 0
    scaled = equilibrated(matrix)
    if not scaled.size:
        return 0
    values = np.linalg.svd(scaled, compute_uv=False)
    return int(np.count_nonzero(values > SINGULAR * values[0]))


def null_direction(matrix: np.ndarray) -> np.ndarray:
    """The direction in which a singular matrix sees least, columns in units of their own, shape (n,)."""
    sizes = np.max(np.abs(matrix), axis=0)
    sizes[sizes == 0] = 1.0
    scaled = matrix / sizes
    heights = np.max(np.abs(scaled), axis=1, keepdims=True)
    direction: np.ndarray = np.linalg.svd(scaled / np.where(heights > 0, heights, 1.0))[2][-1]
    return direction


def points_around(at: np.ndarray, names: tuple[str, ...]) -> list[np.ndarray]:
    """A typical state, and others near it, at which ranks are decided.

    The draws of a state follow from its name, so that they do not depend on the order of the states; their
    size follows from its value. Where that is zero, sizes of many orders are tried.

    Parameters
    ----------
    at : ndarray, shape (n,)
    names : tuple of str
        Of the states.
    """
    points = np.tile(at, (_POINTS, 1))
    for i, name in enumerate(names):
        seed = int.from_bytes(sha256(name.encode()).digest()[:8], "little")
        draws = np.random.default_rng(seed).uniform(-1, 1, _POINTS)
        points[:, i] += draws * (0.3 * np.abs(at[i]) if at[i] != 0 else np.array(_SIZES))
    return [at, *points]
