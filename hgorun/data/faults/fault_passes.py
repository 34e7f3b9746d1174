"""Passes over millions of samples that look for what is rare, in machine code: only where it is found is kept.

The formulas are those of :mod:`hgorun.data.faults.faults` and :mod:`hgorun.data.faults.filled`, operation by operation.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hgorun.native.compiler import vector_doubles
from hgorun.native.ir import Function
from hgorun.native.passes import Passes

EXACT = 1e-12
"""Of the size of values: what rounding may leave of a line in doubles."""
EVEN = 0.005
"""Of the time between two samples: so far the one between them may be off the middle."""
_CLIMBS = 1000.0, 5.0  # times what rounding leaves, and times a step of the digits: less is level
_FACTOR = 45.0  # between neighbours of which one may be in another unit: the smallest is 60
KELVIN, NEAR = 273.15, 5.0
"""By which a scale of temperatures is off the other, and what is about that."""


def straight_runs(taken: np.ndarray, values: np.ndarray, quantum: float, least: int) -> np.ndarray:
    """Where neighbours lie on a line that is not level, see :func:`hgorun.data.faults.filled.filled`.

    Parameters
    ----------
    taken, values : ndarray, shape (N,)
    quantum : float
        The step of the digits.
    least : int
        So many threes in a row are a run.

    Returns
    -------
    ndarray of int64, shape (runs, 2)
        The first three of each, and the one behind its last.
    """
    room = np.empty((taken.size // (least + 1) + 1, 2), dtype=np.int64)  # of which hardly anything is touched
    count = _run("straight", (taken, values), (room,), (max(taken.size - 2, 0), least), quantum)
    return room[:count].copy()


def large_steps(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Samples that differ from the one before by a large factor, and those by about the zero of another scale."""
    factors, shifts = (np.empty(max(values.size, 1), dtype=np.int64) for _ in range(2))
    ends = np.zeros(1, dtype=np.int64)
    count = _run("steps", (values,), (factors, shifts, ends), (max(values.size - 1, 0),), 0.0)
    return factors[:count].copy(), shifts[: int(ends[0])].copy()


def gaps_above(taken: np.ndarray, limit: float) -> np.ndarray:
    """Samples whose time is more than a limit behind the one before."""
    found = np.empty(max(taken.size, 1), dtype=np.int64)
    count = _run("gaps", (taken,), (found,), (max(taken.size - 1, 0),), limit)
    return found[:count].copy()


def equal_runs(values: np.ndarray) -> np.ndarray:
    """Where neighbours are equal.

    Returns
    -------
    ndarray of int64, shape (runs, 2)
        The first sample of each run of two or more, and the one behind its last.
    """
    room = np.empty((values.size // 2 + 1, 2), dtype=np.int64)  # of which hardly anything is touched
    count = _run("equal", (values,), (room,), (max(values.size - 1, 0),), 0.0)
    return room[:count].copy()


def _run(
    name: str, given: tuple[np.ndarray, ...], found: tuple[np.ndarray, ...], numbers: tuple[int, ...], real: float
) -> int:
    """What a function returns of given arrays of doubles, and of those that it writes to."""
    arrays = [*(np.ascontiguousarray(array, dtype=float) for array in given), *found]
    return _passes(name, arrays, numbers, real)


def _straight(f: Function) -> None:
    taken, values, room = (f.word("%taken", i, "ptr") for i in range(3))
    threes, least = f.word("%taken", 3), f.word("%taken", 4)

    def on_line(k: str) -> str:
        return _on_line(f, *([f.word(f.at(array, k), i, f.real) for i in range(3)] for array in (taken, values)))

    _runs(f, threes, on_line, room, least=least)


def _on_line(f: Function, times: list[str], levels: list[str]) -> str:
    """Whether three neighbours lie on a line that is not level: it climbs by more than its digits and its rounding."""
    before, middle, after = times
    low, here, high = levels
    quantum = f.splat("%real")
    share = f.div(f.sub(middle, before), f.sub(after, before))
    rise = f.sub(high, here)
    by_time = _size(f, f.sub(f.add(low, f.mul(share, f.sub(high, low))), here))
    by_place = _size(f, f.sub(f.mul(f.constant(0.5), f.add(low, high)), here))
    even = f.compare("olt", _size(f, f.sub(share, f.constant(0.5))), f.constant(EVEN))
    nearer = _both(f, even, f.compare("olt", by_place, by_time))
    bend = f.select(nearer, by_place, by_time)
    climbs, level = _size(f, rise), _size(f, here)
    exact = f.mul(f.constant(EXACT), f.select(f.compare("ogt", level, climbs), level, climbs))
    allowed = f.select(f.compare("ogt", exact, quantum), exact, quantum)
    rounding, digits = (f.mul(f.constant(times), of) for times, of in zip(_CLIMBS, (exact, quantum), strict=True))
    above = _both(f, f.compare("ogt", climbs, rounding), f.compare("ogt", climbs, digits))
    return _both(f, above, f.compare("ole", bend, allowed))


def _large_steps(f: Function) -> None:
    values, factors, shifts, ends = (f.word("%taken", i, "ptr") for i in range(4))
    counts = f.slot("i64"), f.slot("i64")
    for count in counts:
        f.store("0", count, "i64")

    def large(k: str) -> tuple[str, str]:
        """Whether the next one is larger or smaller by a large factor, and whether by about a shift."""
        before, after = (f.word(f.at(values, k), i, f.real) for i in range(2))
        shift = _size(f, f.sub(after, before))
        sizes = _size(f, before), _size(f, after)
        small = f.select(f.compare("olt", *sizes), *sizes)
        large = f.select(f.compare("ogt", *sizes), *sizes)
        above = f.compare("ogt", large, f.mul(f.constant(_FACTOR), small))
        by_factor = _both(f, above, f.compare("ogt", small, f.constant(0.0)))
        return by_factor, f.compare("olt", _size(f, f.sub(shift, f.constant(KELVIN))), f.constant(NEAR))

    def keep(k: str) -> None:
        for true, room, count in zip(large(k), (factors, shifts), counts, strict=True):
            _keep(f, true, f.scalar("add", k, "1"), room, count)

    _seldom(f, f.word("%taken", 4), lambda k: f.let(f"or {f.mask} {', '.join(large(k))}"), keep)
    f.store(f.load(counts[1], "i64"), ends, "i64")
    f.do(f"ret i64 {f.load(counts[0], 'i64')}")


def _gaps(f: Function) -> None:
    taken, room = (f.word("%taken", i, "ptr") for i in range(2))
    count = f.slot("i64")
    f.store("0", count, "i64")

    def wide(k: str) -> str:
        before, after = (f.word(f.at(taken, k), i, f.real) for i in range(2))
        return f.compare("ogt", f.sub(after, before), f.splat("%real"))

    def keep(k: str) -> None:
        _keep(f, wide(k), f.scalar("add", k, "1"), room, count)

    _seldom(f, f.word("%taken", 2), wide, keep)
    f.do(f"ret i64 {f.load(count, 'i64')}")


def _equal(f: Function) -> None:
    values, room = (f.word("%taken", i, "ptr") for i in range(2))

    def same(k: str) -> str:
        return f.compare("oeq", *(f.word(f.at(values, k), i, f.real) for i in range(2)))

    _runs(f, f.word("%taken", 2), same, room, beyond="1")


def _runs(
    f: Function, size: str, holds: Callable[[str], str], room: str, *, least: str = "1", beyond: str = "0"
) -> None:
    """Write where each run of places begins at which something holds, and so far beyond its end; return how many.

    Parameters
    ----------
    size : str
        How many places there are.
    holds : callable
        Of a place, or as many as there are lanes, a mask.
    room : str
        Of pairs, for what is found.
    least : str
        The fewest places of a run.
    beyond : str
    """
    begin, count = f.slot("i64"), f.slot("i64")
    f.store("-1", begin, "i64")
    f.store("0", count, "i64")

    def end(at: str) -> None:
        """Keep the run that ends before a place, if there is one and it is long enough."""
        with f.when(f.test("sge", f.load(begin, "i64"), "0")):
            first = f.load(begin, "i64")
            with f.when(f.test("sge", f.scalar("sub", at, first), least)):
                number = f.load(count, "i64")
                row = f.at(room, f.scalar("mul", number, "2"))
                f.store(first, row, "i64")
                f.store(f.scalar("add", at, beyond), f.at(row, 1), "i64")
                f.store(f.scalar("add", number, "1"), count, "i64")
            f.store("-1", begin, "i64")

    def follow(k: str) -> None:
        goes_on, ends, after = f.label(), f.label(), f.label()
        f.branch(holds(k), goes_on, ends)
        f.place(goes_on)
        with f.when(f.test("slt", f.load(begin, "i64"), "0")):
            f.store(k, begin, "i64")
        f.jump(after)
        f.place(ends)
        end(k)
        f.jump(after)
        f.place(after)

    _seldom(f, size, holds, follow, end)
    end(size)
    f.do(f"ret i64 {f.load(count, 'i64')}")


def _seldom(
    f: Function,
    size: str,
    holds: Callable[[str], str],
    tell: Callable[[str], None],
    nowhere: Callable[[str], None] = lambda _: None,
) -> None:
    """Go through places, as many at once as a vector has lanes where something holds at none of them.

    Parameters
    ----------
    size : str
        How many places there are.
    holds : callable
        Of a place, or as many as there are lanes, a mask.
    tell : callable
        Emits what happens at a place, in order.
    nowhere : callable
        Emits what does in place of that at the first of as many places, where it holds at none of them.
    """
    lanes = vector_doubles()
    whole = f.let(f"and i64 {size}, {-lanes}")
    with f.count(0, f.scalar("sdiv", whole, str(lanes))) as block:
        first = f.scalar("mul", block, str(lanes))
        with f.wide(lanes):
            somewhere = f.any(holds(first))
        each, none, after = f.label(), f.label(), f.label()
        f.branch(somewhere, each, none)
        f.place(each)
        with f.count(first, f.scalar("add", first, str(lanes))) as k:
            tell(k)
        f.jump(after)
        f.place(none)
        nowhere(first)
        f.jump(after)
        f.place(after)
    with f.count(whole, size) as k:
        tell(k)


def _both(f: Function, a: str, b: str) -> str:
    return f.let(f"and {f.mask} {a}, {b}")


def _keep(f: Function, true: str, value: str, room: str, count: str) -> None:
    """Put a value behind those that are kept, where an i1 holds."""
    with f.when(true):
        number = f.load(count, "i64")
        f.store(value, f.at(room, number), "i64")
        f.store(f.scalar("add", number, "1"), count, "i64")


def _size(f: Function, value: str) -> str:
    return f.intrinsic("fabs", value)


_passes = Passes({"straight": _straight, "steps": _large_steps, "gaps": _gaps, "equal": _equal})
