"""Passes over arrays in machine code: functions that are given one table of words."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from hgorun.native.compiler import NativeModule, address_of
from hgorun.native.ir import Function


class Passes:
    """Functions of one module, compiled when one of them is first called.

    Parameters
    ----------
    functions : mapping of str to callable
        What writes the body of each. Its words are at ``%taken``: addresses of arrays, then whole numbers; ``%real``
        is a double. It returns an i64.
    """

    def __init__(self, functions: Mapping[str, Callable[[Function], None]]) -> None:
        self._functions = functions

    def __call__(self, name: str, arrays: Sequence[np.ndarray], numbers: Sequence[int], real: float = 0.0) -> int:
        """What a function returns; arrays are in one piece."""
        taken = (ctypes.c_int64 * (len(arrays) + len(numbers)))(*map(address_of, arrays), *numbers)
        return int(self._compiled[name](ctypes.addressof(taken), real))

    @cached_property
    def _compiled(self) -> dict[str, Callable[[int, float], int]]:
        declarations: set[str] = set()
        texts = []
        for name, write in self._functions.items():
            f = Function(name, "ptr %taken, double %real", 1, declarations, returns="i64")
            write(f)
            texts.append(f.text("dso_local"))
        native = NativeModule("\n".join([*sorted(declarations), *texts]), tuple(self._functions))
        return {
            name: native.function(name, ctypes.c_int64, ctypes.c_void_p, ctypes.c_double) for name in self._functions
        }
