"""Places of numbers in a long ascending array."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Literal

import numpy as np

from hgorun.native.ir import Function, hexadecimal
from hgorun.native.passes import Passes

_FEW = 64
_WALKED = 16  # places on the way to each sought one, on average: beyond that a search takes less time


def places_in(ascending: np.ndarray, sought: np.ndarray, side: Literal["left", "right"] = "left") -> np.ndarray:
    """``numpy.searchsorted``, which takes ten times as long where many ascending ones are sought.

    As output points and samples of one clock are: from each place the next one is not far, and is walked to.

    Parameters
    ----------
    ascending : ndarray, shape (N,)
    sought : ndarray, shape (n,)
    side : {"left", "right"}
        Before or behind those that are equal.

    Returns
    -------
    ndarray of int, shape (n,)
    """
    found = np.empty(sought.size, dtype=np.int64)
    if _walked(side, ascending, sought, found, side):
        return found
    return np.asarray(np.searchsorted(ascending, sought, side=side))


def since_last_in(ascending: np.ndarray, sought: np.ndarray, side: Literal["left", "right"] = "right") -> np.ndarray:
    """How far behind the last ascending one that is not above it each sought one is; infinite below the first.

    Parameters
    ----------
    ascending : ndarray, shape (N,), N > 0
    sought : ndarray, shape (n,)
    side : {"left", "right"}
        ``left``: the last one that is below it.
    """
    found = np.empty(sought.size)
    if _walked(f"since_{side}", ascending, sought, found, side):
        return found
    places = np.searchsorted(ascending, sought, side=side)
    return np.where(places > 0, sought - ascending[np.maximum(places, 1) - 1], np.inf)


def moved_up(ascending: np.ndarray, sought: np.ndarray, tolerance: float) -> np.ndarray:
    """The sought ones, of which those that lie before the next ascending one by no more than a tolerance are at it.

    Parameters
    ----------
    ascending : ndarray, shape (N,), N > 0
    sought : ndarray, shape (n,)
    tolerance : float
    """
    found = np.empty(sought.size)
    if _walked("up", ascending, sought, found, "left", tolerance):
        return found
    following = ascending[np.minimum(np.searchsorted(ascending, sought), ascending.size - 1)]
    return np.where((sought < following) & (following - sought <= tolerance), following, sought)


def last_near(ascending: np.ndarray, sought: np.ndarray, tolerance: float) -> np.ndarray:
    """The last ascending one that is no farther from each sought one than a tolerance; -infinity where none is.

    Parameters
    ----------
    ascending : ndarray, shape (N,), N > 0
    sought : ndarray, shape (n,)
    tolerance : float
    """
    found = np.empty(sought.size)
    if _walked("near", ascending, sought, found, "right", tolerance):
        return found
    last = ascending[np.maximum(np.searchsorted(ascending, sought + tolerance, side="right") - 1, 0)]
    return np.where(np.abs(last - sought) <= tolerance, last, -np.inf)


def _walked(
    name: str,
    ascending: np.ndarray,
    sought: np.ndarray,
    found: np.ndarray,
    side: Literal["left", "right"],
    tolerance: float = 0.0,
) -> bool:
    """Whether machine code has found what is sought."""
    doubles = ascending.dtype == float == sought.dtype and ascending.flags.c_contiguous
    if sought.size < _FEW or not doubles:
        return False
    sought = np.ascontiguousarray(sought)  # every so many samples are not
    first = int(np.searchsorted(ascending, sought[0], side=side))
    numbers = (ascending.size, sought.size, first, _WALKED * sought.size)
    return _passes(name, (ascending, sought, found), numbers, tolerance) == sought.size


def _walk(
    before: str, tell: Callable[[Function, str, str, str], str] | None, f: Function, *, beyond: bool = False
) -> None:
    """How many of the sought are found; fewer than all where they are too far apart, or one is no number.

    ``beyond``: by a tolerance behind each of them.
    """
    ascending, sought, found = (f.word("%taken", i, "ptr") for i in range(3))
    size, count, first, far = (f.word("%taken", i) for i in range(3, 7))
    place, left = f.slot("i64"), f.slot("i64")
    f.store(first, place, "i64")
    f.store(far, left, "i64")
    given_up = f.label()
    with f.count(0, count) as k:
        one = f.word(sought, k, "double")
        end = f.scalar("fadd", one, "%real") if beyond else one
        f.leave_if(f.test("uno", end, end), given_up)
        with f.loop() as after:
            here = f.load(place, "i64")
            f.leave_if(f.test("eq", here, "0"), after)
            back = f.scalar("sub", here, "1")
            f.leave_if(f.test(before, f.word(ascending, back, "double"), end), after)
            _step(f, back, place, left, given_up)
        with f.loop() as after:
            here = f.load(place, "i64")
            f.leave_if(f.test("sge", here, size), after)
            f.leave_if(f.let(f"xor i1 {f.test(before, f.word(ascending, here, 'double'), end)}, true"), after)
            _step(f, f.scalar("add", here, "1"), place, left, given_up)
        here = f.load(place, "i64")
        if tell is None:
            f.store(here, f.at(found, k), "i64")
        else:
            f.store(tell(f, ascending, here, one), f.at(found, k))
    f.do(f"ret i64 {count}")
    f.place(given_up)
    f.do("ret i64 -1")


def _since(f: Function, ascending: str, here: str, one: str) -> str:
    """How far behind the last one before a place one is."""
    none = f.test("eq", here, "0")
    last = f.let(f"select i1 {none}, i64 0, i64 {f.scalar('sub', here, '1')}")
    behind = f.scalar("fsub", one, f.word(ascending, last, "double"))
    return f.let(f"select i1 {none}, double {hexadecimal(float('inf'))}, double {behind}")


def _up(f: Function, ascending: str, here: str, one: str) -> str:
    """The one at a place, where it is not far behind; else one itself."""
    last = f.scalar("sub", f.word("%taken", 3), "1")
    place = f.let(f"select i1 {f.test('slt', here, last)}, i64 {here}, i64 {last}")
    following = f.word(ascending, place, "double")
    near = f.test("ole", f.scalar("fsub", following, one), "%real")
    moved = f.let(f"and i1 {f.test('olt', one, following)}, {near}")
    return f.let(f"select i1 {moved}, double {following}, double {one}")


def _near(f: Function, ascending: str, here: str, one: str) -> str:
    """The one before a place, where it is not far from one."""
    last = f.scalar("sub", here, "1")
    last = f.let(f"select i1 {f.test('sgt', here, '0')}, i64 {last}, i64 0")
    found = f.word(ascending, last, "double")
    near = f.test("ole", f.intrinsic("fabs", f.scalar("fsub", found, one)), "%real")
    return f.let(f"select i1 {near}, double {found}, double {hexadecimal(float('-inf'))}")


def _step(f: Function, to: str, place: str, left: str, given_up: str) -> None:
    """To another place, as long as there are steps left."""
    f.leave_if(f.test("eq", f.load(left, "i64"), "0"), given_up)
    f.store(f.scalar("sub", f.load(left, "i64"), "1"), left, "i64")
    f.store(to, place, "i64")


_passes = Passes(
    {
        "left": partial(_walk, "olt", None),
        "right": partial(_walk, "ole", None),
        "since_left": partial(_walk, "olt", _since),
        "since_right": partial(_walk, "ole", _since),
        "up": partial(_walk, "olt", _up),
        "near": partial(_walk, "ole", _near, beyond=True),
    }
)
