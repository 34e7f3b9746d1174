"""The built-in metrics of a run in machine code: a few passes over its rows, up to eight columns at once.

The formulas are those of :mod:`hgorun.result.metrics`, operation by operation in the same order, so the bits are
numpy's. What takes numpy some forty passes over arrays larger than its caches takes a tenth of the time here; that
decides what a run costs beside its integration.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import ClassVar

import numpy as np

from hgorun.native.compiler import NativeModule, address_of
from hgorun.native.ir import Function
from hgorun.result.evaluation.estimated import Estimated
from hgorun.result.evaluation.passes import FOUND, Passes
from hgorun.result.metrics.base import Metric
from hgorun.result.metrics.settling import SETTLING
from hgorun.result.metrics.sizes import PEAK, RMSE, SUP
from hgorun.result.metrics.smoothness import HF, TV, odd_points
from hgorun.result.windows import MetricSettings, points_in

LANES = (2, 4, 8)  # columns at once: the fewest that do, since there may be many rows
# What the code takes: addresses, numbers, and in the last word a double.
_ARRAYS = ("xhat", "truth", "places", "work", "error", "found")
_NUMBERS = ("rows", "width", "step", "true_step", "first", "stop", "early", "late", "points")


@dataclass(frozen=True)
class Windows:
    """Where the passes look, in rows.

    Attributes
    ----------
    steady, transient : slice
    average : int
        Points of the moving mean, an odd number that may be larger than the steady window.
    settling : float
    """

    steady: slice
    transient: slice
    average: int
    settling: float

    @classmethod
    def of(cls, time: np.ndarray, settings: MetricSettings) -> Windows | None:
        """On a grid of times; None where a window has no points."""
        steady, transient = points_in(time, settings.steady), points_in(time, settings.transient)
        if steady.stop <= steady.start or transient.stop <= transient.start:
            return None
        points = odd_points(settings.average, float(time[1] - time[0]) if time.size > 1 else np.nan)
        return cls(steady, transient, points, settings.settling)

    known: ClassVar[frozenset[Metric]] = frozenset({RMSE, SUP, PEAK, SETTLING, HF, TV})

    @property
    def length(self) -> int:
        """Rows of the steady window."""
        return int(self.steady.stop - self.steady.start)

    @property
    def numbers(self) -> list[int]:
        """As the code takes them."""
        steady, transient = self.steady, self.transient
        return [steady.start, steady.stop, transient.start, transient.stop, min(self.average, self.length)]

    def metrics(self, time: np.ndarray, found: Mapping[str, np.ndarray]) -> dict[Metric, np.ndarray]:
        """The metrics from what the passes have found, arrays of one shape."""
        points = self.average
        averaged = max(self.length - points + 1, 0)  # rows of which the moving mean has all points
        with np.errstate(divide="ignore", invalid="ignore"):
            rough = np.sqrt(found["rough"] / averaged) if averaged else np.full(found["rough"].shape, np.nan)
            way = found["way"] / found["true_way"]
        return {
            RMSE: np.sqrt(found["squares"] / self.length),
            SUP: found["largest"],
            PEAK: found["peak"],
            SETTLING: time[np.maximum(found["last"], 0).astype(int)],
            HF: rough if points > 1 else np.zeros_like(rough),  # the mean of a point is the point itself
            TV: way,
        }


def measured(
    time: np.ndarray, truths: Estimated, estimated: Estimated, settings: MetricSettings
) -> dict[Metric, np.ndarray] | None:
    """The built-in metrics, shape (m, n) each; None where they have to be left to numpy.

    That is where an error is not finite, where a window has no points, and for plants of one state, whose single
    column numpy adds in another order.

    Parameters
    ----------
    time : ndarray, shape (Nt,)
    truths, estimated : Estimated
        Of m observers what they estimate, and their estimates.
    settings : MetricSettings
    """
    windows = Windows.of(time, settings)
    if not len(estimated.places) or len(estimated.places[0]) < 2 or windows is None:
        return None
    found = _passes(truths, estimated, windows)
    return None if found["nothing"].any() else windows.metrics(time, found)


def _passes(truths: Estimated, estimated: Estimated, windows: Windows) -> dict[str, np.ndarray]:
    """What the code finds, arrays of shape (m, n) by name."""
    truth, values = rows_of_doubles(truths.values), rows_of_doubles(estimated.values)
    count, n, m = len(truth), len(estimated.places[0]), len(estimated.places)
    lanes = next((lanes for lanes in LANES if lanes >= m * n), LANES[-1])
    width = -(-m * n // lanes) * lanes
    places = places_of(tuple(map(tuple, estimated.places)), tuple(map(tuple, truths.places)), width)
    work, error = np.empty((2, count + 1, lanes))
    found = np.empty((len(FOUND), width))
    addresses = [address_of(array) for array in (values, truth, places, work, error, found)]
    numbers = [count, width, values.strides[0] // 8, truth.strides[0] // 8, *windows.numbers]
    taken = (ctypes.c_int64 * (len(_ARRAYS) + len(_NUMBERS)))(*addresses, *numbers)
    _code(lanes).run(ctypes.addressof(taken), windows.settling)
    return dict(zip(FOUND, found[:, : m * n].reshape(len(FOUND), m, n), strict=True))


@lru_cache(maxsize=64)
def places_of(xhat: tuple[tuple[int, ...], ...], x: tuple[tuple[int, ...], ...], width: int) -> np.ndarray:
    """For every column those of xhat and of x; what is left over of the last vector repeats the first ones."""
    places = np.zeros((2, width), dtype=np.int64)
    for row, columns in zip(places, (xhat, x), strict=True):
        row[: len(columns) * len(columns[0])] = np.ravel(columns)
    return places


def rows_of_doubles(values: np.ndarray) -> np.ndarray:
    """An array whose rows lie anywhere, each of them in one piece."""
    fits = values.dtype == float and values.strides[1] == 8 and values.strides[0] % 8 == 0
    return values if fits else np.ascontiguousarray(values, dtype=float)


class _Code:
    """The compiled function."""

    def __init__(self, lanes: int) -> None:
        native = NativeModule(_ir(lanes), ("columns",))
        self.run = native.function("columns", None, ctypes.c_void_p, ctypes.c_double)


_code = cache(_Code)


def _ir(lanes: int) -> str:
    declarations: set[str] = set()
    f = Function("columns", "ptr %taken, double %settled", lanes, declarations)
    arrays = {name: f.word("%taken", i, "ptr") for i, name in enumerate(_ARRAYS)}
    numbers = {name: f.word("%taken", i) for i, name in enumerate(_NUMBERS, start=len(_ARRAYS))}
    with f.count(0, f.scalar("sdiv", numbers["width"], str(lanes))) as block:
        place = f.scalar("mul", block, str(lanes))
        both = arrays["places"], f.at(arrays["places"], numbers["width"])
        columns = [[f.word(f.at(of, place), lane) for lane in range(lanes)] for of in both]

        def gathered(name: str, step: str, of: Sequence[str]) -> Callable[[str], str]:
            """As many columns of a row as there are lanes."""

            def read(row: str) -> str:
                base = f.at(arrays[name], f.scalar("mul", row, numbers[step]))
                return f.gather([f.word(base, column, "double") for column in of])

            return read

        xhat, x = gathered("xhat", "step", columns[0]), gathered("truth", "true_step", columns[1])
        Passes(f, arrays, numbers | {"settled": "%settled"}, place, xhat, x).passes()
    f.do("ret void")
    return "\n".join([*sorted(declarations), f.text("dso_local")])
