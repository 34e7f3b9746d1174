"""Where the right-hand side is not smooth: kinks of functions of time, and what delays make of them.

A step of a Runge-Kutta method keeps its order only if everything is smooth inside it. Functions of time
have kinks or jumps where the argument of abs, sign, min, max, floor or a comparison crosses zero; a
continuous delay repeats every event, one derivative smoother each time, at the times t with t - d(t) = event.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np

from hgorun.memo import Memo
from hgorun.symbolic.evaluate import along
from hgorun.symbolic.graph import arguments, operations

LEVELS = 4  # repetitions of an event that a fourth-order method can see
_DIFFERENCES = {ca.OP_FMIN, ca.OP_FMAX, ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE}


def kink_arguments(expressions: Iterable[ca.SX]) -> list[ca.SX]:
    """The expressions whose zeros are the kinks."""
    zeros_of: list[ca.SX] = []
    for node in operations(expressions):
        op, parts = node.op(), arguments(node)
        if op in (ca.OP_FABS, ca.OP_SIGN):
            zeros_of.append(parts[0])
        elif op in _DIFFERENCES:
            zeros_of.append(parts[0] - parts[1])
        elif op in (ca.OP_FLOOR, ca.OP_CEIL):
            zeros_of.append(ca.sin(np.pi * parts[0]))
    return zeros_of


def roots(functions: list[Callable[[np.ndarray], np.ndarray]], start: float, end: float, points: int) -> np.ndarray:
    """Zeros of functions of time between start and end, both ends included, to the last digit.

    Zeros closer to each other than the spacing of ``points`` may be missed.
    """
    grid = np.linspace(start, end, points)
    zeros = []
    for function in functions:
        values = function(grid)
        zeros.append(grid[values == 0.0])
        change = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
        low, high = grid[change], grid[change + 1]
        zeros.append(_bisect(function, low, high))
    return np.unique(np.concatenate(zeros)) if zeros else np.zeros(0)


def _bisect(function: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Roots bracketed by low and high, all at once."""
    if not low.size:
        return low
    positive = function(low) > 0
    for _ in range(80):
        middle = 0.5 * (low + high)
        same = (function(middle) > 0) == positive
        moved = np.where(same, middle, low), np.where(same, high, middle)
        if np.array_equal(moved[0], low) and np.array_equal(moved[1], high):
            break
        low, high = moved
    return high


@dataclass(frozen=True, eq=False)
class Kinks:
    """Kinks and jumps of expressions at times that depend on t and p alone, not on a state.

    Attributes
    ----------
    arguments : tuple of casadi.Function
        Of (t, p); a kink is where one of them is zero.
    needed : ndarray of int
        The entries of p that they depend on.
    """

    arguments: tuple[ca.Function, ...]
    needed: np.ndarray

    @classmethod
    def of(cls, expressions: Iterable[ca.SX], t: ca.SX, p: ca.SX) -> Kinks:
        """Look for them in expressions."""
        functions, needed = [], np.zeros(p.numel(), dtype=bool)
        for argument in kink_arguments(expressions):
            f = ca.Function("g", [t, p], [argument], {"allow_free": True})
            if ca.depends_on(argument, t) and not f.has_free():
                functions.append(f)
                needed |= np.array(ca.which_depends(argument, p, 1, False), dtype=bool).reshape(needed.shape)
        return cls(tuple(functions), np.flatnonzero(needed))

    def between(self, values: np.ndarray, start: float, end: float, points: int) -> np.ndarray:
        """The kinks for given values of p, as :func:`roots` finds them."""
        key = self, values[self.needed].tobytes(), start, end, points
        return _FOUND.get(key, lambda: roots([partial(_at, f, values) for f in self.arguments], start, end, points))


_FOUND: Memo[np.ndarray] = Memo(32)


def _at(function: ca.Function, values: np.ndarray, times: np.ndarray) -> np.ndarray:
    return along(function, times, values)


def repeated(
    events: np.ndarray,
    delay: Callable[[np.ndarray], np.ndarray],
    constant: bool,
    start: float,
    end: float,
    points: int,
) -> np.ndarray:
    """The times t in (start, end] with t - d(t) = an event."""
    if constant:
        times = events + delay(np.array([start]))[0]
        return np.asarray(times[(times > start) & (times <= end)])
    grid = np.linspace(start, end, points)
    then = grid - delay(grid)
    ordered = np.sort(events)
    low, high = np.minimum(then[:-1], then[1:]), np.maximum(then[:-1], then[1:])
    first, last = np.searchsorted(ordered, low, side="right"), np.searchsorted(ordered, high, side="right")
    cells = np.repeat(np.arange(points - 1), last - first)
    inside = np.arange(cells.size) - np.repeat(np.cumsum(last - first) - (last - first), last - first)
    target = ordered[first[cells] + inside]
    return _bisect(lambda times: times - delay(times) - target, grid[cells], grid[cells + 1])


def merge(times: np.ndarray, tolerance: float) -> np.ndarray:
    """Sorted times, those closer than ``tolerance`` to their predecessor dropped."""
    times = np.unique(times)
    if times.size < 2:
        return times
    groups = np.concatenate([[True], np.diff(times) > tolerance])
    return np.asarray(times[groups])
