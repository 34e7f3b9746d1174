"""The engine's segments between many events in machine code: one pass, where numpy takes some thirty.

The formulas are those of :func:`~hgorun.simulation.timeline.steps.steps_needed` and
:func:`~hgorun.simulation.timeline.tabulated.rows_in_last_steps`, operation by operation, so the bits are numpy's.
"""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np

from hgorun.native.compiler import NativeModule, address_of
from hgorun.native.ir import Function
from hgorun.native.passes import Passes

# What the code takes: addresses, numbers, and in the last word a double.
_ARRAYS = ("events", "inward", "variant", "places", "grid", "spans", "counts")
_NUMBERS = ("count", "points", "slope", "place")
_SPAN, _COUNT = 4, 7  # words of a row


def segment_rows(
    events: np.ndarray,
    inward: np.ndarray,
    variant: np.ndarray,
    places: np.ndarray,
    grid: np.ndarray,
    longest: float,
    *,
    always_slope: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Spans and counts of a plan, see :class:`~hgorun.engine.plan.Plan`, in which no segment is cut.

    Parameters
    ----------
    events, inward : ndarray, shape (N + 1,)
        As those of a schedule, in order.
    variant : ndarray of int64, shape (N,)
    places : ndarray of int64, shape (N + 1,)
        Where the actions of each event begin.
    grid : ndarray
        Output points, ascending.
    longest : float
        Of the steps; as long as are needed must be possible.
    always_slope : bool
        Whether the slope at the end of every segment is needed, and not only of those with output points in their
        last step.

    Returns
    -------
    spans : ndarray, shape (N, 4)
    counts : ndarray of int64, shape (N, 7)
    """
    count = events.size - 1
    spans, counts = np.empty((count, _SPAN)), np.empty((count, _COUNT), dtype=np.int64)
    place = int(np.searchsorted(grid, events[0]))
    arrays = [np.ascontiguousarray(array) for array in (events, inward, variant, places, grid)]
    addresses = map(address_of, (*arrays, spans, counts))
    numbers = (count, grid.size, int(always_slope), place)
    taken = (ctypes.c_int64 * (len(_ARRAYS) + len(_NUMBERS)))(*addresses, *numbers)
    _code().run(ctypes.addressof(taken), longest)
    return spans, counts


def cut_rows(
    spans: np.ndarray, counts: np.ndarray, before: np.ndarray, after: np.ndarray, part: float
) -> tuple[np.ndarray, np.ndarray]:
    """Every segment of a plan as two, see :func:`~hgorun.simulation.timeline.steps.unevenly`.

    Parameters
    ----------
    spans : ndarray, shape (N, 4)
    counts : ndarray of int64, shape (N, 7)
    before, after : ndarray of int64, shape (N,)
        Steps of the two.
    part : float
        Of each segment, before its cut.
    """
    rows = len(spans)
    found = np.empty((2 * rows, _SPAN)), np.empty((2 * rows, _COUNT), dtype=np.int64)
    _cutting("cut", [*map(np.ascontiguousarray, (spans, counts, before, after)), *found], (rows,), part)
    return found


class _Code:
    """The compiled function."""

    def __init__(self) -> None:
        native = NativeModule(_ir(), ("segments",))
        self.run = native.function("segments", None, ctypes.c_void_p, ctypes.c_double)


_code = cache(_Code)


def _ir() -> str:
    declarations: set[str] = set()
    f = Function("segments", "ptr %taken, double %longest", 1, declarations)
    array = {name: f.word("%taken", i, "ptr") for i, name in enumerate(_ARRAYS)}
    number = {name: f.word("%taken", i) for i, name in enumerate(_NUMBERS, start=len(_ARRAYS))}
    place = f.slot("i64")  # in the grid
    f.store(number["place"], place, "i64")
    with f.count(0, number["count"]) as k:
        following = f.scalar("add", k, "1")
        left, right = (f.word(array["events"], at, "double") for at in (k, following))
        # steps = max(ceil((right - left) / longest (1 - 1e-9)), 1)
        gap = f.sub(right, left)
        needed = f.intrinsic("ceil", f.mul(f.div(gap, "%longest"), f.constant(1 - 1e-9)))
        steps = f.select(f.compare("ogt", needed, f.constant(1.0)), needed, f.constant(1.0))
        # h = (right - left) / steps, snap = 1e-9 h + 1e-15 max(|left|, |right|)
        h = f.div(gap, steps)
        sizes = [f.intrinsic("fabs", time) for time in (left, right)]
        larger = f.select(f.compare("ogt", *sizes), *sizes)
        snap = f.add(f.mul(f.constant(1e-9), h), f.mul(f.constant(1e-15), larger))
        _move(f, place, array["grid"], number["points"], f.sub(right, snap))
        slope = f.let(f"or i64 {number['slope']}, {_behind(f, place, array['grid'], f.add(f.sub(right, h), snap))}")
        inside = [f.word(array["inward"], at, "double") for at in (k, following)]
        row = f.at(array["spans"], f.scalar("mul", k, str(_SPAN)))
        for i, time in enumerate((left, right, f.add(left, inside[0]), f.sub(right, inside[1]))):
            f.store(time, f.at(row, i))
        whole = f.let(f"fptosi double {steps} to i64")
        actions = [f.word(array["places"], at) for at in (k, following)]
        row = f.at(array["counts"], f.scalar("mul", k, str(_COUNT)))
        for i, count in enumerate((whole, "0", whole, f.word(array["variant"], k), *actions, slope)):
            f.store(count, f.at(row, i), "i64")
    f.do("ret void")
    return "\n".join([*sorted(declarations), f.text("dso_local")])


def _move(f: Function, place: str, grid: str, points: str, end: str) -> None:
    """Move a place in the grid to the first point that is not before an end."""
    with f.loop() as after:
        here = f.load(place, "i64")
        f.leave_if(f.test("eq", here, "0"), after)
        before = f.scalar("sub", here, "1")
        f.leave_if(f.test("olt", f.word(grid, before, "double"), end), after)
        f.store(before, place, "i64")
    with f.loop() as after:
        here = f.load(place, "i64")
        f.leave_if(f.test("sge", here, points), after)
        f.leave_if(f.test("oge", f.word(grid, here, "double"), end), after)
        f.store(f.scalar("add", here, "1"), place, "i64")


def _behind(f: Function, place: str, grid: str, start: str) -> str:
    """Whether the last point before a place lies behind a start: 1 or 0."""
    found = f.slot("i64")
    f.store("0", found, "i64")
    here = f.load(place, "i64")
    with f.when(f.test("sgt", here, "0")):
        point = f.word(grid, f.scalar("sub", here, "1"), "double")
        f.store(f.let(f"zext i1 {f.test('ogt', point, start)} to i64"), found, "i64")
    return f.load(found, "i64")


def _cut(f: Function) -> None:
    spans, counts, before, after, cut_spans, cut_counts = (f.word("%taken", i, "ptr") for i in range(6))
    with f.count(0, f.word("%taken", 6)) as k:
        row = f.at(spans, f.scalar("mul", k, str(_SPAN)))
        start, end, inside, until = (f.word(row, i, "double") for i in range(_SPAN))
        cut = f.add(start, f.mul("%real", f.sub(end, start)))
        cut = f.select(f.compare("olt", cut, inside), inside, cut)  # not outside of where functions are evaluated
        cut = f.select(f.compare("ogt", cut, until), until, cut)
        row = f.at(cut_spans, f.scalar("mul", k, str(2 * _SPAN)))
        for i, time in enumerate((start, cut, inside, cut, cut, end, cut, until)):
            f.store(time, f.at(row, i))
        row = f.at(counts, f.scalar("mul", k, str(_COUNT)))
        regime, first, last = (f.word(row, i) for i in (3, 4, 5))
        row = f.at(cut_counts, f.scalar("mul", k, str(2 * _COUNT)))
        steps = [f.word(of, k) for of in (before, after)]
        own = [(steps[0], "0", steps[0], regime, first, last, "1"), (steps[1], "0", steps[1], regime, last, last, "1")]
        for i, count in enumerate([*own[0], *own[1]]):  # nothing happens at the cut
            f.store(count, f.at(row, i), "i64")
    f.do("ret i64 0")


_cutting = Passes({"cut": _cut})
