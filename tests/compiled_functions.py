"""The engine's elementary functions, compiled to be called on arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache

import numpy as np
import numpy.typing as npt

from hgorun.native import functions
from hgorun.native.compiler import NativeModule
from hgorun.native.ir import Function

Array = npt.NDArray[np.float64]
NAMES = (*functions.INLINE, *functions.UNARY, *functions.BINARY)


def module(names: Sequence[str], lanes: int) -> str:
    """IR with ``apply_<name>(x, y, z, count)`` for each function: z = f(x) or f(x, y) on ``count`` groups of lanes."""
    declarations: set[str] = set()
    bodies = []
    for name in names:
        f = Function(f"apply_{name}", "ptr %x, ptr %y, ptr %z, i64 %count", lanes, declarations)
        with f.count(0, "%count") as group:
            first = f.scalar("mul", group, str(lanes))
            arguments = [f.load(f.at(array, first), f.real) for array in ("%x", "%y")]
            arguments = arguments if name in functions.BINARY else arguments[:1]
            f.store(functions.call(name, f, *arguments), f.at("%z", first), f.real)
        f.do("ret void")
        bodies.append(f.text(linkage=""))
    return "\n".join([*sorted(declarations), *bodies])


class Compiled:
    """All the functions on W lanes, for the processor that ``HGORUN_CPU`` names."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        self.native = NativeModule(module(NAMES, lanes), tuple(f"apply_{name}" for name in NAMES))

    def __call__(self, name: str, *arguments: npt.ArrayLike) -> Array:
        """The function of one or two arrays."""
        x, y = (np.atleast_1d(np.asarray(a, dtype=np.float64)) for a in (arguments[0], arguments[-1]))
        count = -(-x.size // self.lanes)
        padded = np.ones((3, count * self.lanes))
        padded[0, : x.size], padded[1, : y.size] = x, y
        call = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3, ctypes.c_int64)
        call(self.native.address[f"apply_{name}"])(*(row.ctypes.data for row in padded), count)
        result: Array = padded[2, : x.size]
        return result


@cache
def compiled(lanes: int) -> Compiled:
    """The functions for this processor."""
    return Compiled(lanes)


def bits(values: Array) -> npt.NDArray[np.int64]:
    """What is compared bit for bit: NaN is one value."""
    return np.where(np.isnan(values), np.nan, values).view(np.int64)
