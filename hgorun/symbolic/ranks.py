"""Ranks and conditions that do not depend on units: rows and columns may come in any, from 1e-12 to 1e12."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

SINGULAR = 1e-10  # smallest over largest singular value below which a matrix counts as singular
_SURELY = 1e-3  # smallest over largest singular value above which nothing is near singular
_SMALL = 3  # rows of a matrix whose determinant is quickly written down
_ROUNDS, _ALIKE = 30, 1e-3  # at most so many rounds, until all norms are as close to one


def equilibrated(matrix: np.ndarray) -> np.ndarray:
    """The matrix with rows and columns in units of their own, so that all have about the norm one (Sinkhorn).

    Rows and columns of zeros are left out. The limit is the same in whatever units the matrix was given.
    """
    scaled = np.abs(matrix)
    rows, columns = np.any(scaled > 0, axis=1), np.any(scaled > 0, axis=0)
    scaled = np.asarray(matrix[np.ix_(rows, columns)], dtype=float)
    if not scaled.size:
        return scaled
    scaled = _largest_one(scaled)  # squares of what is left do not overflow
    for _ in range(_ROUNDS):
        heights = np.linalg.norm(scaled, axis=1, keepdims=True)
        scaled = scaled / heights
        scaled = scaled / np.linalg.norm(scaled, axis=0, keepdims=True)
        if np.max(np.abs(heights - 1)) < _ALIKE:
            break
    return np.asarray(scaled)


def _largest_one(matrix: np.ndarray) -> np.ndarray:
    """A matrix without rows and columns of zeros, in units in which the largest entry of each is about one."""
    for axis in (1, 0):
        matrix = matrix / np.max(np.abs(matrix), axis=axis, keepdims=True)
    return matrix


def is_regular(matrix: np.ndarray, least: float = SINGULAR) -> bool:
    """Whether :func:`singular_value_ratio` is larger than a small number.

    Further rounds of scaling bring the singular values together rather than apart, so where they are close
    after the first, nothing more has to be asked.
    """
    rows, columns = matrix.shape
    if rows == columns <= _SMALL and _surely_regular(matrix.tolist()):
        return True
    heights = np.abs(matrix).max(axis=1, keepdims=True)
    if heights.min() > 0 and heights.max() < np.inf:  # nor is one of them no number
        scaled = matrix / heights
        widths = np.abs(scaled).max(axis=0)
        values = np.linalg.svd(scaled / widths, compute_uv=False) if widths.min() > 0 else np.zeros(0)
        if values.size == matrix.shape[1] and values[-1] > _SURELY * values[0]:
            return True
    return singular_value_ratio(matrix) > least


def _surely_regular(rows: list[list[float]]) -> bool:
    """Whether its determinant alone says that a small matrix is regular, entries being at most one in size.

    The smallest singular value is at least ``|det|`` over the others, and none is larger than n. For a run that asks
    nothing else of a library of linear algebra, to call that would take several times as long.
    """
    heights = [max(map(abs, row)) for row in rows]
    if not all(0 < height < np.inf for height in heights):
        return False
    scaled = [[value / height for value in row] for row, height in zip(rows, heights, strict=True)]
    widths = [max(map(abs, column)) for column in zip(*scaled, strict=True)]
    size: float = math.prod(widths)
    return size > 0 and abs(_determinant(scaled)) > _SURELY * size * float(len(rows)) ** len(rows)


def _determinant(rows: list[list[float]]) -> float:
    """By its first row."""
    first, *others = rows
    if not others:
        return first[0]
    minors = (_determinant([row[:j] + row[j + 1 :] for row in others]) for j in range(len(first)))
    signed = (-value if j % 2 else value for j, value in enumerate(first))
    return sum(value * minor for value, minor in zip(signed, minors, strict=True))


def singular_value_ratio(matrix: np.ndarray) -> float:
    """Smallest over largest singular value of the :func:`equilibrated` matrix; 0 when it has not rank n.

    Parameters
    ----------
    matrix : ndarray, shape (m, n), m >= n
    """
    return _ratio(np.ascontiguousarray(matrix, dtype=float).tobytes(), *matrix.shape)


@lru_cache(maxsize=4096)  # the members of an ensemble start at one place
def _ratio(values: bytes, rows: int, columns: int) -> float:
    matrix = np.frombuffer(values).reshape(rows, columns)
    if not np.all(np.isfinite(matrix)):
        return float("nan")
    scaled = equilibrated(matrix)
    if scaled.shape[1] < columns or scaled.shape[0] < columns:
        return 0.0
    singular = np.linalg.svd(scaled, compute_uv=False)
    return float(singular[-1] / singular[0])


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
