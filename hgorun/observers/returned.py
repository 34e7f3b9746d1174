"""What the methods of an observer return, held to what is right: a sentence says what was found."""

from __future__ import annotations

import casadi as ca
import numpy as np

MATRIX = 2  # dimensions at most


class Misfit(ValueError):
    """A value that does not fit; the message goes on where a sentence has named it."""


def fitting(value: object, shape: tuple[int, int]) -> ca.SX:
    """An expression of a shape.

    Raises
    ------
    Misfit
    """
    try:
        found = ca.SX(value)
    except (NotImplementedError, TypeError):  # as CasADi says that it is none
        raise Misfit(_kind(value)) from None
    if found.shape != shape:
        raise Misfit(f"has the shape {found.shape}")
    return found


def _kind(value: object) -> str:
    if isinstance(value, (list, tuple)):
        return f"is a {type(value).__name__}: casadi.vertcat makes a column of its entries"
    if isinstance(value, ca.MX):
        return "is an MX: expressions are SX"
    return f"is {'None' if value is None else f'a {type(value).__name__}'}: expressions are SX of casadi"


def numbers(value: object, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """Numbers of a shape, or of any with two dimensions at most.

    Raises
    ------
    Misfit
    """
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        raise Misfit(f"holds {'text' if array.dtype.kind in 'US' else array.dtype.name}, expected numbers")
    if shape is not None and array.shape != shape:
        raise Misfit(f"has the shape {array.shape}, expected {shape}")
    if array.ndim > MATRIX:
        raise Misfit(f"has the shape {array.shape}, expected a number, a vector or a matrix")
    return array.astype(float)
