"""Compiled interval arithmetic: neighbours of exact fractions, and the rules at zero and infinity."""

from fractions import Fraction
from math import inf, nan, nextafter

import numpy as np
import pytest

from hgorun.native import boxes

LARGEST, SMALLEST = 1.7976931348623157e308, 5e-324
LINE = (-inf, inf)


def intervals(seed: int, count: int) -> boxes.Bounds:
    """Of both signs and many sizes, some of them one point."""
    rng = np.random.default_rng(seed)
    ends = np.sort(rng.standard_normal((2, count)) * 10.0 ** rng.integers(-30, 30, (2, count)), axis=0)
    ends[1, ::5] = ends[0, ::5]
    return ends[0], ends[1]


def corners(name: str, a: tuple[float, float], b: tuple[float, float]) -> list[Fraction]:
    """The exact values among which the smallest and the largest are."""
    (a0, a1), (b0, b1) = (tuple(map(Fraction, one)) for one in (a, b))
    if name == "add":
        return [a0 + b0, a1 + b1]
    if name == "subtract":
        return [a0 - b1, a1 - b0]
    return [p * q for p in (a0, a1) for q in (b0, b1)]


@pytest.mark.parametrize("count", [8, 9, 61])  # whole groups of lanes, and the last one begins in another
@pytest.mark.parametrize("name", ["add", "subtract", "multiply"])
def test_bounds_are_the_neighbours_of_the_rounded_exact_ones(name: str, count: int) -> None:
    a, b = intervals(1, count), intervals(2, count)
    low, high = boxes.apply(name, a, b)
    for k in range(count):
        exact = corners(name, (a[0][k], a[1][k]), (b[0][k], b[1][k]))
        assert low[k] == nextafter(float(min(exact)), -inf)
        assert high[k] == nextafter(float(max(exact)), inf)


def test_an_inverse_is_known_away_from_zero_only() -> None:
    low, high = intervals(3, 61)
    found = boxes.apply("inverse", (low, high))
    for k in range(61):
        ends = (float(1 / Fraction(high[k])), float(1 / Fraction(low[k])))
        expected = (nextafter(ends[0], -inf), nextafter(ends[1], inf)) if low[k] > 0 or high[k] < 0 else LINE
        assert (found[0][k], found[1][k]) == expected


@pytest.mark.parametrize("units", [1, 2, 4])
def test_bounds_move_by_units_as_nextafter_goes(units: int) -> None:
    ends = np.array(
        [0.0, -0.0, 1.0, -1.0, 2.0**-1022, -(2.0**-1022), SMALLEST, -SMALLEST, LARGEST, -LARGEST, inf, -inf]
    )
    low, high = boxes.apply(f"outward_{units}", (ends, ends))
    for k, value in enumerate(ends):
        below = above = float(value)
        for _ in range(units):
            below, above = nextafter(below, -inf), nextafter(above, inf)
        assert (low[k], high[k]) == (below, above)


@pytest.mark.parametrize(
    ("name", "a", "b", "expected"),
    [
        ("add", (-inf, 1.0), (-inf, inf), LINE),
        ("add", (inf, inf), (-inf, -inf), LINE),  # not a number
        ("subtract", (0.0, inf), (0.0, inf), LINE),
        ("multiply", (0.0, 0.0), (-inf, inf), (-SMALLEST, SMALLEST)),
        ("multiply", (0.0, 1.0), (2.0, inf), (-SMALLEST, inf)),
        ("multiply", (nan, 1.0), (2.0, 3.0), LINE),
        ("multiply", (1e-200, 1e-200), (1e-200, 1e-200), (-SMALLEST, SMALLEST)),
        ("multiply", (1e200, 1e200), (1e200, 1e200), (LARGEST, inf)),
    ],
)
def test_zero_and_infinity(
    name: str, a: tuple[float, float], b: tuple[float, float], expected: tuple[float, float]
) -> None:
    first, second = ((np.full(8, low), np.full(8, high)) for low, high in (a, b))
    low, high = boxes.apply(name, first, second)
    assert set(zip(low.tolist(), high.tolist(), strict=True)) == {expected}


def test_bounds_are_broadcast_and_may_lie_apart_in_memory() -> None:
    wide = np.arange(24.0).reshape(3, 8)
    low, high = boxes.apply("add", (wide[::-1], wide[::-1]), (np.float64(1.0) + np.zeros(8), np.array(2.0)))
    assert low.shape == high.shape == (3, 8)
    assert np.array_equal(low, np.nextafter(wide[::-1] + 1, -inf))
    assert np.array_equal(high, np.nextafter(wide[::-1] + 2, inf))
