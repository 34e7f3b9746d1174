"""Where the elementary functions are tried: (x,) or (x, y) arrays for each."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
from mpmath import mp, mpf

from hgorun.native import functions
from hgorun.native.functions.trigonometric import PERIODIC_LIMIT

Array = npt.NDArray[np.float64]
HUGE = float(np.finfo(np.float64).max)
LEAST = 5e-324
INF, NAN = math.inf, math.nan
# of some 10⁷ random points per function, those of the largest errors
HARD: dict[str, list[list[float]]] = json.loads((Path(__file__).parent / "hard_points.json").read_text())
SPECIAL = [0.0, LEAST, 2.0**-1022, 1e-300, 0.5, 1.0, 1.5, 2.0, 3.0, 2.0**52 + 1, 2.0**53, 1e300, HUGE, INF]
SPECIAL = [*SPECIAL, *(-x for x in SPECIAL), NAN]


def neighbours(x: npt.ArrayLike, steps: int = 2) -> Array:
    """Each double with those up to so many places beside it."""
    below, above = [np.asarray(x, dtype=float)], [np.asarray(x, dtype=float)]
    for _ in range(steps):
        below.append(np.nextafter(below[-1], -INF))
        above.append(np.nextafter(above[-1], INF))
    return np.concatenate([*below, *above[1:]])


class Points:
    """Random points; the same ones each time."""

    def __init__(self) -> None:
        self.rng = np.random.default_rng(20240501)

    def spread(self, low: float, high: float, count: int = 600) -> Array:
        """Evenly in the exponent, of both signs."""
        size = np.exp(self.rng.uniform(math.log(low), math.log(high), count))
        both: Array = size * self.rng.choice([-1.0, 1.0], count)
        return both

    def even(self, low: float, high: float, count: int = 600) -> Array:
        return self.rng.uniform(low, high, count)

    def multiples_of_pi(self, shift: float) -> Array:
        """The doubles around (k + shift) π, small k and large."""
        k = np.concatenate([np.arange(20), np.exp(self.even(0, math.log(1e17), 200)).astype(np.int64)])
        with mp.workprec(160):
            nearest = [float((int(i) + mpf(shift)) * mp.pi) for i in k]
        return neighbours(nearest)

    def periodic(self) -> list[Array]:
        # the double next to a multiple of π/2, and one from the table of hard cases of Muller
        hardest = [6381956970095103 * 2.0**797, 5.319372648326541e255]
        return [
            self.spread(1e-300, 1),
            self.spread(1, 1e9),
            self.spread(1e9, PERIODIC_LIMIT),
            self.spread(PERIODIC_LIMIT, HUGE),
            self.multiples_of_pi(0),
            self.multiples_of_pi(0.5),
            neighbours([PERIODIC_LIMIT]),
            np.array([*hardest, 1e22, 2.0**1023, HUGE]),
        ]

    def unary(self, name: str) -> list[Array]:
        spread, even = self.spread, self.even
        if name in ("sin", "cos"):
            return [*self.periodic(), even(-10, 10), even(0.5, 0.6), even(1.5, 1.65)]
        if name == "tan":
            return [*self.periodic(), self.multiples_of_pi(0.25), even(-2, 2), even(0.7, 0.85)]
        if name in ("exp", "expm1"):
            ends = [even(-746, 710), even(-745.2, -708), even(709, 710), even(-40, 40), even(-1, 1)]
            return [*ends, spread(1e-300, 700), neighbours(np.log(2) * np.arange(-1076, 1026) / 2, 1)]
        if name in ("sinh", "cosh", "tanh"):
            ends = [even(-710.5, 710.5), even(-22, 22), even(-1, 1), even(0.3, 0.6), spread(1e-9, 1e-2)]
            return [*ends, spread(1e-300, 20), neighbours(np.log(2) / 2 * (np.arange(60) + 0.75))]
        if name in ("asin", "acos", "atanh"):
            near_one = 1 - np.abs(spread(1e-16, 1))
            return [even(-1, 1), even(0.35, 0.45), even(0.85, 0.95), near_one, -near_one, spread(1e-300, 1)]
        if name in ("atan", "asinh"):
            turning = neighbours([math.sqrt(2) - 1, 1.0, math.sqrt(2) + 1, 2.0**30, 2.0**60])
            return [even(-3, 3), even(0.35, 0.45), spread(1e-300, HUGE), spread(1e-5, 1e5), turning]
        if name == "acosh":
            turning = neighbours([2.0**30, 3 / math.sqrt(8)])
            return [1 + np.abs(spread(1e-16, 1)), even(1, 3), np.abs(spread(1, HUGE)), turning, np.array([1.0])]
        if name == "log1p":
            return [even(-1, 3), spread(1e-300, 0.99), np.abs(spread(1, HUGE)), -1 + np.abs(spread(1e-16, 1))]
        subnormal = self.rng.integers(1, 2**52, 300).view(np.float64)
        borders = neighbours([math.sqrt(0.5), 1.0, math.sqrt(2), 2.0**-1022])
        return [
            even(0.6, 1.5),
            1 + spread(1e-16, 0.1),
            np.abs(spread(1e-307, HUGE)),
            subnormal,
            borders,
            np.array([LEAST]),
        ]

    def binary(self, name: str) -> list[tuple[Array, Array]]:
        spread = self.spread
        small = self.rng.integers(1, 2**52, 600).view(np.float64)
        if name == "pow":
            size = np.abs(spread(1e-300, 1e300))
            to_range = spread(1, 745) / np.log(size)
            near_one = 1 + spread(1e-15, 0.1)
            return [
                (size, to_range),
                (np.abs(spread(0.5, 2)), spread(1e-3, 1000)),
                (np.abs(spread(1e-3, 1e3)), spread(0.1, 20)),
                (near_one, spread(1, 745) / np.log(near_one)),
                (-np.abs(spread(1e-3, 1e3)), self.rng.integers(-40, 40, 600).astype(float)),
                (small, spread(1e-3, 0.5)),
                (size, -np.abs(self.even(708, 745)) / np.log(size)),
                (np.abs(spread(1e-20, 1e20)), self.even(-2, 2)),
                (np.abs(spread(1e-300, 1e300)), np.full(600, 1 / 3)),
                (small, np.full(600, 1 / 3)),
            ]
        return [
            (spread(0.1, 10), spread(0.1, 10)),
            (spread(1e-300, HUGE / 2), spread(1e-300, HUGE / 2)),
            (small, spread(1e-320, 1e-300)),
            (spread(1e-310, 1e-300), spread(1e-3, 1e10)),
            (spread(1e300, HUGE / 2), spread(1e300, HUGE / 2)),
            (spread(1, 1e3) * (below := spread(1e-5, 1e5)), below),
        ]


def points(name: str) -> tuple[Array, ...]:
    """The arguments at which a function is tried."""
    hard = np.array(HARD.get(name, []), dtype=float)
    if name in functions.BINARY:
        pairs = Points().binary(name)
        x, y = (np.concatenate([pair[i] for pair in pairs]) for i in range(2))
        return (np.append(x, hard[:, 0]), np.append(y, hard[:, 1])) if hard.size else (x, y)
    return (np.concatenate([*Points().unary(name), hard.ravel()]),)


def special(name: str) -> tuple[Array, ...]:
    """Zeros, infinities, NaN and the ends of the range, for two arguments all pairs of them."""
    values = np.array(SPECIAL)
    if name in functions.BINARY:
        x, y = np.meshgrid(values, values)
        return x.ravel(), y.ravel()
    return (values,)
