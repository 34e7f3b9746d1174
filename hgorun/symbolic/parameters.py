"""The run-time numbers of the compiled code."""

from __future__ import annotations

import re

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

_NOT_A_WORD = re.compile(r"\W", re.ASCII)


def flat(values: ArrayLike) -> np.ndarray:
    """An array as it lies among the parameters: column after column."""
    array = np.asarray(values, dtype=float)
    return array.ravel(order="F")


class Parameters:
    """The vector p: named groups of numbers, each with a symbol."""

    def __init__(self) -> None:
        self._symbols: list[ca.SX] = []
        self._values: list[np.ndarray] = []

    def add(self, name: str, values: ArrayLike) -> ca.SX:
        """Append an array; returns its symbol, of the same shape (at most two dimensions)."""
        array = np.asarray(values, dtype=float)
        rows, columns = (*array.shape, 1, 1)[:2]
        # CasADi reads brackets in a symbol's name as part of an expression, and names can be anybody's labels
        symbol = ca.SX.sym(_NOT_A_WORD.sub("_", name), rows, columns)
        self._symbols.append(ca.vec(symbol))
        self._values.append(flat(array))
        return symbol

    @property
    def symbol(self) -> ca.SX:
        return ca.vertcat(*self._symbols) if self._symbols else ca.SX(0, 1)

    @property
    def values(self) -> np.ndarray:
        return np.concatenate(self._values) if self._values else np.zeros(0)
