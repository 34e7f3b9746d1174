"""The built-in metrics of a long run in machine code, made while its rows pass.

The operations are those of :mod:`hgorun.result.evaluation.passes` in the same order, so the bits are those of metrics
that are made of all rows at once. What has to be known before is found in a first round: the peak, which the settling
time is a part of, and the mean of what is rough. The second round is for what follows from these.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from contextlib import AbstractContextManager
from functools import cache

import numpy as np

from hgorun.native.compiler import NativeModule, address_of
from hgorun.native.ir import Function
from hgorun.result.evaluation.columns import LANES, Windows, places_of, rows_of_doubles
from hgorun.result.evaluation.passes import FOUND
from hgorun.result.metrics.base import Metric

# What the code takes: addresses and numbers.
_ARRAYS = ("xhat", "truth", "places", "found", "kept", "sums", "errors")
_NUMBERS = ("rows", "width", "step", "true_step", "row", "first", "stop", "early", "late", "points", "ring")
_KEPT = ("xhat", "x", "sum", "rough", "centre", "limit")  # beside what is found, one number a column
LONGEST_MEAN = 1 << 20  # rows of a moving mean, which all have to be kept


class RunningMetrics:
    """Metrics of estimates whose rows come one after the other, twice.

    Parameters
    ----------
    places : sequence of sequence of int
        Of every observer the columns of its estimates of the n states; n is at least 2.
    windows : Windows
        With a moving mean of at most ``LONGEST_MEAN`` rows.
    """

    def __init__(self, places: Sequence[Sequence[int]], windows: Windows) -> None:
        self._m, self._n, self._windows = len(places), len(places[0]), windows
        count = self._m * self._n
        lanes = next((lanes for lanes in LANES if lanes >= count), LANES[-1])
        self._width = -(-count // lanes) * lanes
        self._code = _code(lanes)
        points = windows.numbers[-1]
        ring = 1 << points.bit_length()
        columns = tuple(map(tuple, places))
        self._places = places_of(columns, tuple(tuple(range(len(own))) for own in columns), self._width)
        self._found = np.zeros((len(FOUND), self._width))
        self._kept = np.zeros((len(_KEPT), self._width))
        self._sums, self._errors = np.zeros((2, self._width // lanes, ring, lanes))
        self._ring, self._row = ring, 0
        self._of(_KEPT, self._kept)["limit"][:] = np.inf

    def take(self, xhat: np.ndarray, x: np.ndarray) -> None:
        """The next rows.

        Parameters
        ----------
        xhat : ndarray, shape (N, any)
            With the estimates in their columns.
        x : ndarray, shape (N, n)
        """
        values, truth = rows_of_doubles(xhat), rows_of_doubles(x)
        arrays = (values, truth, self._places, self._found, self._kept, self._sums, self._errors)
        numbers = [len(x), self._width, values.strides[0] // 8, truth.strides[0] // 8, self._row]
        numbers += [*self._windows.numbers, self._ring]
        taken = (ctypes.c_int64 * (len(_ARRAYS) + len(_NUMBERS)))(*map(address_of, arrays), *numbers)
        self._code.run(ctypes.addressof(taken))
        self._row += len(x)

    def again(self) -> None:
        """The first round is over."""
        found, kept = self._of(FOUND, self._found), self._of(_KEPT, self._kept)
        averaged = max(self._windows.length - self._windows.numbers[-1] + 1, 1)
        with np.errstate(invalid="ignore"):
            centre, limit = kept["rough"] / averaged, self._windows.settling * found["peak"]
        self._found[:], self._kept[:] = 0.0, 0.0
        kept["centre"][:], kept["limit"][:] = centre, limit
        found["last"][:] = -1.0
        self._row = 0

    @property
    def finite(self) -> bool:
        """Whether all errors so far have been."""
        return not self._of(FOUND, self._found)["nothing"].any()

    def metrics(self, time: np.ndarray) -> dict[Metric, np.ndarray]:
        """The metrics after the second round, shape (m, n) each.

        Parameters
        ----------
        time : ndarray, shape (Nt,)
            Of all rows.
        """
        shape = self._m, self._n
        found = {name: row[: self._m * self._n].reshape(shape) for name, row in self._of(FOUND, self._found).items()}
        return self._windows.metrics(time, found)

    @staticmethod
    def _of(names: Sequence[str], table: np.ndarray) -> dict[str, np.ndarray]:
        """The rows of a table: views."""
        return dict(zip(names, table, strict=True))


class _Code:
    """The compiled function."""

    def __init__(self, lanes: int) -> None:
        native = NativeModule(_ir(lanes), ("running",))
        self.run = native.function("running", None, ctypes.c_void_p)


_code = cache(_Code)


def _ir(lanes: int) -> str:
    """``running(taken)``: some more rows, for one vector of columns after the other."""
    declarations: set[str] = set()
    f = Function("running", "ptr %taken", lanes, declarations)
    arrays = {name: f.word("%taken", i, "ptr") for i, name in enumerate(_ARRAYS)}
    numbers = {name: f.word("%taken", i) for i, name in enumerate(_NUMBERS, start=len(_ARRAYS))}
    with f.count(0, f.scalar("sdiv", numbers["width"], str(lanes))) as block:
        _Columns(f, arrays, numbers, block).rows()
    f.do("ret void")
    return "\n".join([*sorted(declarations), f.text("dso_local")])


class _Columns:
    """The code for the columns of one vector: what is found of them so far is in registers meanwhile."""

    def __init__(self, f: Function, arrays: dict[str, str], numbers: dict[str, str], block: str) -> None:
        self.f, self.arrays, self.numbers = f, arrays, numbers
        self.place = f.scalar("mul", block, str(f.lanes))
        both = arrays["places"], f.at(arrays["places"], numbers["width"])
        self.columns = [[f.word(f.at(of, self.place), lane) for lane in range(f.lanes)] for of in both]
        ring = f.scalar("mul", f.scalar("mul", block, numbers["ring"]), str(f.lanes))
        self.sums, self.errors = (f.at(arrays[name], ring) for name in ("sums", "errors"))
        self.mask = f.scalar("sub", numbers["ring"], "1")
        self.slots = {name: f.slot(f.real) for name in self._stored()}

    def _stored(self) -> dict[str, str]:
        """Where everything is kept between two calls."""
        f, found = self.f, {}
        for array, names in (("found", FOUND), ("kept", _KEPT)):
            for i, name in enumerate(names):
                # "rough" is found in the second round, and in the first one the sum that its mean is made of
                key = f"{array} {name}"
                row = f.scalar("mul", self.numbers["width"], str(i))
                found[key] = f.at(f.at(self.arrays[array], row), self.place)
        return found

    def rows(self) -> None:
        f, n, stored = self.f, self.numbers, self._stored()
        for name, pointer in stored.items():
            f.store(f.load(pointer, f.real), self.slots[name], f.real)
        after = f.scalar("add", n["first"], "1")
        with f.count(0, n["rows"]) as i:
            row = f.scalar("add", n["row"], i)
            xhat, x = self.gathered("xhat", "step", i, 0), self.gathered("truth", "true_step", i, 1)
            e = f.sub(xhat, x)
            size = f.intrinsic("fabs", e)
            self.add("found nothing", f.mul(e, f.constant(0.0)))
            with self.between(row, after, n["stop"]):
                self.add("found way", f.intrinsic("fabs", f.sub(xhat, self.now("kept xhat"))))
                self.add("found true_way", f.intrinsic("fabs", f.sub(x, self.now("kept x"))))
            self.keep("kept xhat", xhat)
            self.keep("kept x", x)
            with self.between(row, n["early"], n["late"]):
                self.grow("found peak", size)
            above = f.compare("ogt", size, self.now("kept limit"))
            number = f.splat(f.let(f"sitofp i64 {row} to double"))
            self.keep("found last", f.select(above, number, self.now("found last")))
            with self.between(row, n["first"], n["stop"]):
                self.steady(f.scalar("sub", row, n["first"]), e, size)
        for name, pointer in stored.items():
            f.store(self.now(name), pointer, f.real)

    def steady(self, k: str, e: str, size: str) -> None:
        """Row k of the steady window: squares, maxima; and e minus its moving mean, half a mean ago."""
        f, points = self.f, self.numbers["points"]
        self.add("found squares", f.mul(e, e))
        self.grow("found largest", size)
        f.store(e, self.ring(self.errors, k), f.real)
        f.store(self.now("kept sum"), self.ring(self.sums, k), f.real)
        self.add("kept sum", e)
        start = f.scalar("sub", f.scalar("add", k, "1"), points)
        with f.when(f.test("sge", start, "0")):
            before = f.load(self.ring(self.sums, start), f.real)
            mean = f.div(f.sub(self.now("kept sum"), before), f.splat(f.let(f"sitofp i64 {points} to double")))
            middle = f.scalar("add", start, f.scalar("sdiv", points, "2"))
            rough = f.sub(f.load(self.ring(self.errors, middle), f.real), mean)
            self.add("kept rough", rough)
            aside = f.sub(rough, self.now("kept centre"))
            self.add("found rough", f.mul(aside, aside))

    def gathered(self, name: str, step: str, row: str, which: int) -> str:
        """As many columns of a row as there are lanes."""
        f = self.f
        base = f.at(self.arrays[name], f.scalar("mul", row, self.numbers[step]))
        return f.gather([f.word(base, column, "double") for column in self.columns[which]])

    def ring(self, base: str, row: str) -> str:
        """Where a row of the last ones is."""
        f = self.f
        return f.at(base, f.scalar("mul", f.scalar("and", row, self.mask), str(f.lanes)))

    def between(self, row: str, start: str, stop: str) -> AbstractContextManager[None]:
        """What follows is done in these rows."""
        f = self.f
        return f.when(f.let(f"and i1 {f.test('sge', row, start)}, {f.test('slt', row, stop)}"))

    def keep(self, name: str, value: str) -> None:
        self.f.store(value, self.slots[name], self.f.real)

    def now(self, name: str) -> str:
        return self.f.load(self.slots[name], self.f.real)

    def add(self, name: str, value: str) -> None:
        self.keep(name, self.f.add(self.now(name), value))

    def grow(self, name: str, value: str) -> None:
        """Keep the larger of what is kept and a value."""
        f, old = self.f, self.now(name)
        self.keep(name, f.select(f.compare("ogt", value, old), value, old))
