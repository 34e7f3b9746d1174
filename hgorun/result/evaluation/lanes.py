"""The built-in metrics of runs side by side in vector registers, from rows that are still in the cache.

The passes are those of :mod:`hgorun.result.evaluation.passes`; a vector holds one column of all lanes.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from hgorun.native.compiler import NativeModule, address_of
from hgorun.native.ir import Function
from hgorun.result.evaluation.columns import Windows
from hgorun.result.evaluation.passes import FOUND, Passes
from hgorun.result.metrics.base import Metric

_ARRAYS = ("places", "work", "error")
_NUMBERS = ("rows", "width", "step", "first", "stop", "early", "late", "points", "settled")


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneMetrics:
    """Metrics of the lanes of a block, see :class:`hgorun.engine.ensemble.Compiled`.

    Attributes
    ----------
    time : ndarray, shape (Nt,)
        The metrics' grid.
    every : int
        Every so many rows are points of that grid.
    width : int
        Values of a row.
    xhat, x : sequence of int
        For each column, an observer's estimate of a state, its place and that of the truth in a row.
    windows : Windows
    lanes : int
    """

    time: np.ndarray
    every: int
    width: int
    xhat: Sequence[int]
    x: Sequence[int]
    windows: Windows
    lanes: int

    @property
    def size(self) -> int:
        """Numbers of a member that the code finds."""
        return len(FOUND) * len(self.xhat)

    @property
    def address(self) -> int:
        """Of the function."""
        return _code(self.lanes).address

    def workspace(self) -> list[np.ndarray]:
        """What the code needs beside the rows: the first array is its argument, which points to the others."""
        places = np.array([*self.xhat, *self.x], dtype=np.int64) * self.lanes
        work, error = np.empty((2, self.time.size + 1, self.lanes))
        numbers = [self.time.size, len(self.xhat) * self.lanes, self.every * self.width * self.lanes]
        settled = ctypes.c_int64.from_buffer(ctypes.c_double(self.windows.settling)).value
        addresses = [address_of(array) for array in (places, work, error)]
        taken = np.array([*addresses, *numbers, *self.windows.numbers, settled], dtype=np.int64)
        return [taken, places, work, error]

    def metrics(self, found: np.ndarray) -> tuple[dict[Metric, np.ndarray], np.ndarray]:
        """The metrics, and where errors are not finite; arrays of shape (columns, members).

        Parameters
        ----------
        found : ndarray, shape (size, members)
        """
        parts = dict(zip(FOUND, found.reshape(len(FOUND), len(self.xhat), -1), strict=True))
        lost = parts["nothing"] != 0
        parts["last"] = np.where(lost, 0, parts["last"])
        return self.windows.metrics(self.time, parts), lost


class _Code:
    """The compiled function for a number of lanes; alive as long as this is."""

    def __init__(self, lanes: int) -> None:
        self._native = NativeModule(_ir(lanes), ("metrics",))
        self.address = self._native.address["metrics"]


_code = cache(_Code)


def _ir(lanes: int) -> str:
    """``metrics(taken, rows, found)``."""
    declarations: set[str] = set()
    f = Function("metrics", "ptr %taken, ptr %rows, ptr %found", lanes, declarations)
    arrays = {name: f.word("%taken", i, "ptr") for i, name in enumerate(_ARRAYS)} | {"found": "%found"}
    kinds = {"settled": "double"}
    numbers = {name: f.word("%taken", i, kinds.get(name, "i64")) for i, name in enumerate(_NUMBERS, start=len(_ARRAYS))}
    columns = f.scalar("sdiv", numbers["width"], str(lanes))
    with f.count(0, columns) as column:
        places = f.at(arrays["places"], column), f.at(f.at(arrays["places"], columns), column)
        xhat, x = (_reader(f, f.at("%rows", f.load(place, "i64")), numbers["step"]) for place in places)
        Passes(f, arrays, numbers, f.scalar("mul", column, str(lanes)), xhat, x).passes()
    f.do("ret void")
    return "\n".join([*sorted(declarations), f.text("dso_local")])


def _reader(f: Function, base: str, step: str) -> Callable[[str], str]:
    """One column in all lanes, from its place in the first row."""
    return lambda row: f.load(f.at(base, f.scalar("mul", row, step)), f.real)
