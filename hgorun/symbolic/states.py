"""How an observer's internal states lie in the state vector."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod

import casadi as ca
import numpy as np

_SHOWN = 6  # numbers of a diagonal in a message


@dataclass(frozen=True, eq=False, repr=False)
class Symmetric:
    """A symmetric matrix as an observer's state: its upper triangle is integrated, so it stays symmetric.

    Rounding would otherwise let the antisymmetric part of a Riccati solution grow like exp(theta t).
    """

    values: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class StateBlock:
    """One internal state: where it starts in z, its shape, and whether only its upper triangle is kept."""

    start: int
    shape: tuple[int, ...]
    symmetric: bool = False

    @classmethod
    def of(cls, start: int, value: np.ndarray | Symmetric) -> StateBlock:
        if isinstance(value, Symmetric):
            return cls(start, value.values.shape, symmetric=True)
        return cls(start, value.shape)

    @cached_property
    def size(self) -> int:
        """How many numbers are integrated."""
        n = self.shape[0] if self.shape else 1
        return n * (n + 1) // 2 if self.symmetric else prod(self.shape)

    @property
    def matrix(self) -> tuple[int, int]:
        """The shape of its symbol, which is a matrix: a vector is a column."""
        rows, columns = (*self.shape, 1, 1)[:2]
        return rows, columns

    def symbol(self, z: ca.SX) -> ca.SX:
        """The state as a column or matrix, from the state vector."""
        flat = z[self.start : self.start + self.size]
        if self.symmetric:
            n = self.shape[0]
            place = {(int(i), int(j)): k for k, (i, j) in enumerate(zip(*np.triu_indices(n), strict=True))}
            rows = [[flat[place[min(i, j), max(i, j)]] for j in range(n)] for i in range(n)]
            return ca.vertcat(*[ca.horzcat(*row) for row in rows])
        rows_, columns = self.matrix
        return flat if columns == 1 else ca.reshape(flat, columns, rows_).T

    def entries(self, name: str) -> dict[str, tuple[int, int]]:
        """Names of its entries, with row and column of each: ``name`` itself of a number, else name_2 or name_1_2."""
        rows, columns = self.matrix
        places = [(i, j) for i in range(rows) for j in range(columns)]
        if len(places) == 1:
            return {name: places[0]}
        if 1 in (rows, columns):
            return {f"{name}_{i + j + 1}": (i, j) for i, j in places}
        return {f"{name}_{i + 1}_{j + 1}": (i, j) for i, j in places}

    def flat(self, value: ca.SX) -> ca.SX:
        """What is integrated, from a derivative in the state's shape."""
        if self.symmetric:
            return ca.vertcat(*[value[int(i), int(j)] for i, j in zip(*np.triu_indices(self.shape[0]), strict=True)])
        return value if self.matrix[1] == 1 else ca.vec(value.T)

    def numbers(self, values: np.ndarray) -> np.ndarray:
        """What is integrated, from numbers in the state's shape."""
        return values[np.triu_indices(self.shape[0])] if self.symmetric else values.ravel()

    def shaped(self, rows: np.ndarray) -> np.ndarray:
        """(Nt, *shape) from all rows of the state vector, where they are if possible; a last axis of one is dropped."""
        part = rows[:, self.start : self.start + self.size]
        if self.symmetric:
            full = np.empty((len(part), *self.shape))
            i, j = np.triu_indices(self.shape[0])
            full[:, i, j] = full[:, j, i] = part
            return full
        shape = self.shape[:-1] if len(self.shape) > 1 and self.shape[-1] == 1 else self.shape
        return part.reshape(len(part), *shape)

    def flattened(self, values: np.ndarray) -> np.ndarray:
        """What is integrated, shape (Nt, size), from what :meth:`shaped` gave."""
        if self.symmetric:
            i, j = np.triu_indices(self.shape[0])
            return np.asarray(values[:, i, j])
        return values.reshape(len(values), self.size)

    def _others(self, count: int) -> str:
        """In words, what a configuration may give beside one number."""
        if not self.symmetric or count == 1:
            return f"{count} numbers"
        n = self.shape[0]
        shown = f" such as [{', '.join(['0.1'] * n)}]" if n <= _SHOWN else ""
        return f"{n} numbers for the diagonal{shown} or {n} rows of {n}, in the order of the states"

    def initial(self, given: object, default: np.ndarray) -> np.ndarray:
        """Numbers in the state's shape from what a configuration gives.

        A number stands for that multiple of ones, for a symmetric matrix of the identity; of one as many as it has rows
        are its diagonal.

        Raises
        ------
        ValueError
            When it does not fit.
        """
        try:
            array = np.asarray(given, dtype=float)
        except (TypeError, ValueError):
            array = np.array(np.nan)
        count = prod(self.shape)
        if self.symmetric and array.shape == self.shape[:1] and count > 1:
            array = np.diag(array)
        if not np.all(np.isfinite(array)) or (array.ndim > 0 and array.size != count):
            raise ValueError(f"expected a number or {self._others(count)}, found {given!r}")
        if array.ndim > 0:
            matrix = array.reshape(self.shape)
            if self.symmetric and not np.array_equal(matrix, matrix.T):
                raise ValueError("expected a symmetric matrix")
            return matrix
        return np.asarray(array * (np.eye(self.shape[0]) if self.symmetric else np.ones_like(default)))
