"""Numbers of CasADi functions: the one way from arrays to arrays.

CasADi takes and gives matrices of its own, which become arrays through Python lists; that takes ten times as
long as the evaluation itself. Here a function reads NumPy's memory and writes into it. At many points NumPy itself
carries out what it computes alike, ten times as fast.

CasADi's sin, exp and the like are those of the C library, whose last bits depend on the processor. A function that
calls one of them is carried out here, with the engine's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from threading import Lock

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from hgorun.config.expressions import parse
from hgorun.memo import Memo, same
from hgorun.symbolic.interpreter import Step, arithmetic, carry_out, interpreted

Floats = NDArray[np.float64]


def evaluate(function: ca.Function, *arguments: ArrayLike) -> list[Floats]:
    """Evaluate a function once, or at many points.

    Parameters
    ----------
    function : casadi.Function
    *arguments : array_like
        One for each input. A matrix, shape (N, size), has one row a point; what has fewer dimensions is the same
        at all points.

    Returns
    -------
    list of ndarray
        One for each output: shape (N, rows), or (N, rows, columns) where it has several columns. N is 1 where
        no argument is a matrix.
    """
    arrays = [np.ascontiguousarray(argument, dtype=float) for argument in arguments]
    points = next((len(a) for a in arrays if a.ndim == 2), 1)
    buffer, ports = _BUFFERS.get(same(function), lambda: (_Buffer(function), _Ports.of(function)))
    for i, (array, size) in enumerate(zip(arrays, ports.taken, strict=True)):
        if array.size != size * (points if array.ndim == 2 else 1):
            raise ValueError(f"argument {i} of {function}: {array.shape} does not fit")
    results = [np.zeros((points, matrix.nonzeros)) for matrix in ports.given]
    steps = _INTERPRETED.get(same(function), lambda: interpreted(function))
    if steps:
        carry_out(steps, arrays, results)
    elif points == 1:
        buffer.call(arrays, results)
    elif points >= _MANY and (steps := _EXACT.get(same(function), lambda: arithmetic(function))):
        carry_out(steps, arrays, results)
    else:
        _in_pieces(function, arrays, results, points)
    return [matrix.full(array) for matrix, array in zip(ports.given, results, strict=True)]


@dataclass(frozen=True, eq=False, repr=False)
class _Matrix:
    """The shape of an output, and the places of its nonzeros, column after column; None where it is dense."""

    rows: int
    columns: int
    nonzeros: int
    places: np.ndarray | None

    @classmethod
    def of(cls, sparsity: ca.Sparsity) -> _Matrix:
        rows, columns = sparsity.shape
        places = np.array(sparsity.get_col(), dtype=int) * rows + np.array(sparsity.row(), dtype=int)
        return cls(rows, columns, sparsity.nnz(), None if sparsity.is_dense() else places)

    def full(self, values: Floats) -> Floats:
        """Full matrices from CasADi's nonzeros."""
        if self.places is not None:
            full = np.zeros((len(values), self.columns * self.rows))
            full[:, self.places] = values
            values = full
        if self.columns == 1:
            return values
        return np.ascontiguousarray(values.reshape(len(values), self.columns, self.rows).swapaxes(1, 2))


@dataclass(frozen=True, eq=False, repr=False)
class _Ports:
    """What a function takes and gives, asked for once: each question to CasADi takes a microsecond."""

    taken: tuple[int, ...]
    given: tuple[_Matrix, ...]

    @classmethod
    def of(cls, function: ca.Function) -> _Ports:
        taken = tuple(function.nnz_in(i) for i in range(function.n_in()))
        return cls(taken, tuple(_Matrix.of(function.sparsity_out(i)) for i in range(function.n_out())))


# points that are evaluated in one call, which CasADi takes microseconds to prepare: all of a few, or of many so many
_FEW, _PIECE = 16, 128
_MANY = 512  # from so many on, an operation of NumPy on all of them takes less than as many turns of CasADi's loop
_INTERPRETED: Memo[list[Step]] = Memo(256)
_EXACT: Memo[list[Step]] = Memo(256)


class _Buffer:
    """What a function reads its arguments from and writes its results to: made once, used by one thread at a time."""

    def __init__(self, function: ca.Function) -> None:
        self._buffer, self._run = function.buffer()
        self._lock = Lock()

    def call(self, arrays: Sequence[Floats], results: Sequence[Floats]) -> None:
        buffer = self._buffer
        with self._lock:
            for i, array in enumerate(arrays):
                buffer.set_arg(i, array.data)
            for i, array in enumerate(results):
                buffer.set_res(i, array.data)
            self._run()


_MAPPED: Memo[_Buffer] = Memo(64)
_BUFFERS: Memo[tuple[_Buffer, _Ports]] = Memo(256)


def _in_pieces(function: ca.Function, arrays: Sequence[Floats], results: Sequence[Floats], points: int) -> None:
    """Few points at once, or many, a fixed number at a time; the last piece is filled up with zeros."""
    length = max(points, 1) if points <= _FEW else _PIECE
    mapped = _MAPPED.get((same(function), length), lambda: _Buffer(function.map(length)))
    inside = [a if a.ndim == 2 else np.full((length, a.size), a.ravel()) for a in arrays]
    whole = points - points % length
    for start in range(0, points, length):
        rest = start == whole
        given = [_piece(a, start, length) if old.ndim == 2 else a for a, old in zip(inside, arrays, strict=True)]
        found = [np.zeros((length, r.shape[1])) if rest else r[start : start + length] for r in results]
        mapped.call(given, found)
        if rest:
            for result, array in zip(results, found, strict=True):
                result[start:] = array[: points - start]


def _piece(array: Floats, start: int, length: int) -> Floats:
    """So many points from one on, filled up with zeros."""
    part = array[start : start + length]
    missing = length - len(part)
    return np.concatenate([part, np.zeros((missing, part.shape[1]))]) if missing else part


def at(function: ca.Function, *arguments: ArrayLike) -> list[Floats]:
    """The outputs at one point: shapes (rows,), or (rows, columns)."""
    if _INTERPRETED.get(same(function), lambda: interpreted(function)):
        return [value[0] for value in evaluate(function, *map(np.ravel, arguments))]
    return roughly_at(function, *arguments)


def roughly_at(function: ca.Function, *arguments: ArrayLike) -> list[Floats]:
    """What :func:`at` gives but for last bits, which depend on the machine: for questions such as what is finite."""
    arrays = [np.ascontiguousarray(argument, dtype=float) for argument in arguments]
    buffer, ports = _BUFFERS.get(same(function), lambda: (_Buffer(function), _Ports.of(function)))
    for i, (array, size) in enumerate(zip(arrays, ports.taken, strict=True)):
        if array.size != size:
            raise ValueError(f"argument {i} of {function}: {array.shape} does not fit")
    results = [np.zeros((1, matrix.nonzeros)) for matrix in ports.given]
    buffer.call(arrays, results)
    return [matrix.full(array)[0] for matrix, array in zip(ports.given, results, strict=True)]


def along(function: ca.Function, times: ArrayLike, *constants: ArrayLike) -> Floats:
    """A scalar function of time, or of another running number, at all times: shape (N,).

    Parameters
    ----------
    function : casadi.Function
    times : array_like, shape (N,)
    *constants : array_like
        The other arguments, the same at all times.
    """
    (values,) = evaluate(function, np.asarray(times, dtype=float).reshape(-1, 1), *map(np.ravel, constants))
    return values.ravel()


@lru_cache(maxsize=256)
def compiled(text: str, *names: str) -> ca.Function:
    """An expression of some names as a function of them.

    Raises
    ------
    ExpressionError
    """
    symbols = [ca.SX.sym(name) for name in names]
    value = parse(text, names=names).symbol(dict(zip(names, symbols, strict=True)))
    return ca.Function("value", symbols, [value])
