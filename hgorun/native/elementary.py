"""Elementary functions of arrays, with the bits of the compiled equations.

A C library's sin, and NumPy's, give other last bits on another processor or with another version. What decides a
number of a result, the equations, noise, delays and the times of events, is therefore computed by functions of our
own wherever it is computed: these, and those of :mod:`hgorun.native.functions` inside the equations, are the same.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hgorun.native import functions
from hgorun.native.compiler import NativeModule, address_of
from hgorun.native.ir import Function

Floats = NDArray[np.float64]
NAMES = (*functions.INLINE, *functions.UNARY, *functions.BINARY)
_LANES = 4


def apply(name: str, *arguments: ArrayLike) -> Floats:
    """A function of one or two arrays, which are broadcast.

    Parameters
    ----------
    name : str
        One of :data:`NAMES`.
    """
    arrays = [np.asarray(a, dtype=np.float64) for a in arguments]
    if len(arrays) > 1:
        arrays = list(np.broadcast_arrays(*arrays))
    shape, size = arrays[0].shape, arrays[0].size
    padded = np.ones((len(arrays) + 1, -(-size // _LANES) * _LANES))
    for row, array in zip(padded, arrays, strict=False):
        row[:size] = array.ravel()
    _compiled(name)(padded)
    return padded[-1, :size].reshape(shape)


@cache
def _compiled(name: str) -> Callable[[Floats], None]:
    """From a function's arguments, a row each, the values in the last row."""
    count = 2 if name in functions.BINARY else 1
    native = NativeModule(_module(name, count), ("apply",))
    call = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * (count + 1), ctypes.c_int64)(native.address["apply"])

    def run(rows: Floats, native: NativeModule = native) -> None:  # the code lives as long as the module
        first, apart = address_of(rows), rows.strides[0]
        call(*(first + i * apart for i in range(count + 1)), rows.shape[1] // _LANES)

    return run


def _module(name: str, count: int) -> str:
    """IR with ``apply(x, ..., z, n)``: z = f(x, ...) on n groups of lanes."""
    declarations: set[str] = set()
    names = [f"%x{i}" for i in range(count)]
    f = Function("apply", ", ".join(f"ptr {x}" for x in [*names, "%z"]) + ", i64 %n", _LANES, declarations)
    with f.count(0, "%n") as group:
        first = f.scalar("mul", group, str(_LANES))
        arguments = [f.load(f.at(x, first), f.real) for x in names]
        f.store(functions.call(name, f, *arguments), f.at("%z", first), f.real)
    f.do("ret void")
    return "\n".join([*sorted(declarations), f.text(linkage="")])
