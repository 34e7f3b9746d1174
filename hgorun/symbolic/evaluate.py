"""Numbers of CasADi functions: the one way from arrays to arrays.

CasADi takes and gives matrices of its own, which become arrays through Python lists; that takes ten times as
long as the evaluation itself. Here a function reads NumPy's memory and writes into it.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from hgorun.config.expressions import parse

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
    results = [np.zeros((points, function.nnz_out(i))) for i in range(function.n_out())]
    if points:
        mapped = function.map(points) if points > 1 else function
        buffer, call = mapped.buffer()
        spread = [a if a.ndim == 2 or points == 1 else np.tile(a.ravel(), (points, 1)) for a in arrays]
        for i, array in enumerate(spread):
            if array.size != points * function.nnz_in(i):
                raise ValueError(f"argument {i} of {function}: {array.shape} does not fit")
            buffer.set_arg(i, memoryview(array))
        for i, array in enumerate(results):
            buffer.set_res(i, memoryview(array))
        call()
    return [_shaped(function.sparsity_out(i), array) for i, array in enumerate(results)]


def at(function: ca.Function, *arguments: ArrayLike) -> list[Floats]:
    """The outputs at one point: shapes (rows,), or (rows, columns)."""
    return [value[0] for value in evaluate(function, *map(np.ravel, arguments))]


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


def _shaped(sparsity: ca.Sparsity, values: Floats) -> Floats:
    """Full matrices from CasADi's nonzeros, which lie column after column."""
    rows, columns = sparsity.shape
    if not sparsity.is_dense():
        full = np.zeros((len(values), columns * rows))
        full[:, np.array(sparsity.get_col()) * rows + np.array(sparsity.row())] = values
        values = full
    if columns == 1:
        return values
    return np.ascontiguousarray(values.reshape(len(values), columns, rows).swapaxes(1, 2))
