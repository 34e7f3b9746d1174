"""Operations on intervals: of a function's values, given those of its arguments.

Every operation is rounded outwards: by one unit in the last place where IEEE 754 rounds correctly (sums,
products, quotients, roots), by four for elementary functions, which are right to within that. The functions are our
own, so that the bounds, and the events that are found with them, are the same on every machine.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce

import casadi as ca
import numpy as np

from hgorun.native import boxes
from hgorun.native.elementary import apply

Bounds = tuple[np.ndarray, np.ndarray]
Operation = Callable[..., Bounds]
_TOUCH = 1e-9  # how near to an extremum of sin an interval counts as holding it
_LARGEST_ANGLE = 1e13  # whose place in its period is still known
_MANY = 100  # boxes, from which on compiled loops are faster than NumPy's


def _outward(low: np.ndarray, high: np.ndarray, units: int = 1) -> Bounds:
    """Moved apart by units in the last place; what is not a number is the whole line."""
    if low.size >= _MANY:
        return boxes.apply(f"outward_{units}", (low, high))
    lost = np.isnan(low) | np.isnan(high)
    for _ in range(units):
        low, high = np.nextafter(low, -np.inf), np.nextafter(high, np.inf)
    return (np.where(lost, -np.inf, low), np.where(lost, np.inf, high)) if lost.any() else (low, high)


def _many(*arguments: Bounds) -> bool:
    """Whether compiled loops are faster than NumPy's."""
    return max(bounds[0].size for bounds in arguments) >= _MANY


def _add(a: Bounds, b: Bounds) -> Bounds:
    if _many(a, b):
        return boxes.apply("add", a, b)
    return _outward(a[0] + b[0], a[1] + b[1])


def _subtract(a: Bounds, b: Bounds) -> Bounds:
    if _many(a, b):
        return boxes.apply("subtract", a, b)
    return _add(a, _negative(b))


def _negative(a: Bounds) -> Bounds:
    return -a[1], -a[0]


def _products(a: Bounds, b: Bounds) -> Bounds:
    if _many(a, b):
        return boxes.apply("multiply", a, b)
    if a[0].min(initial=np.inf) > 0 and b[0].min(initial=np.inf) > 0:  # the smallest and the largest are known
        return _outward(a[0] * b[0], a[1] * b[1])
    products = [p * q for p in _ends(a) for q in _ends(b)]
    low, high = reduce(np.minimum, products), reduce(np.maximum, products)
    if np.isnan(low).any():
        parts = [_product(p, q) for p in a for q in b]
        low, high = reduce(np.minimum, parts), reduce(np.maximum, parts)
    return _outward(low, high)


def _ends(a: Bounds) -> Bounds | tuple[np.ndarray]:
    """Both bounds, or the only value."""
    return (a[0],) if a[0] is a[1] else a


def _product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """A bound of zero times an infinite one is zero: infinity is a bound here, not a value."""
    return np.where((p == 0) | (q == 0), 0.0, p * q)


def _inverse(a: Bounds) -> Bounds:
    if _many(a):
        return boxes.apply("inverse", a)
    apart = (a[0] > 0) | (a[1] < 0)
    with np.errstate(divide="ignore"):
        low, high = _outward(1 / a[1], 1 / a[0])
    return np.where(apart, low, -np.inf), np.where(apart, high, np.inf)


def _square(a: Bounds) -> Bounds:
    size = _absolute(a)
    low, high = _outward(size[0] ** 2, size[1] ** 2)
    return np.maximum(low, 0.0), high


def _absolute(a: Bounds) -> Bounds:
    across = (a[0] <= 0) & (a[1] >= 0)
    return np.where(across, 0.0, np.minimum(np.abs(a[0]), np.abs(a[1]))), np.maximum(np.abs(a[0]), np.abs(a[1]))


def _increasing(name: str, low: float, high: float) -> Operation:
    """An increasing function with values in [low, high]; nothing is known where it is not defined."""

    def bounds(a: Bounds) -> Bounds:
        with np.errstate(all="ignore"):
            found = _outward(apply(name, a[0]), apply(name, a[1]), 4)
        return np.maximum(found[0], low), np.minimum(found[1], high)

    return bounds


def _cosh(a: Bounds) -> Bounds:
    size = _absolute(a)
    with np.errstate(over="ignore"):
        low, high = _outward(apply("cosh", size[0]), apply("cosh", size[1]), 4)
    return np.maximum(low, 1.0), high


def _sine(a: Bounds) -> Bounds:
    """sin: 1 where a pi/2 + 2 pi k lies in the interval, -1 where a -pi/2 + 2 pi k does, else at the ends."""
    known = np.isfinite(a[0]) & np.isfinite(a[1])
    low, high = np.where(known, a[0], 0.0), np.where(known, a[1], 0.0)
    size = np.maximum(np.abs(low), np.abs(high))
    wide = ~known | (high - low >= 2 * np.pi) | (size > _LARGEST_ANGLE)
    touch = np.maximum(_TOUCH, size * 1e-15)

    def holds(phase: float) -> np.ndarray:
        first = np.ceil((low - phase) / (2 * np.pi) - touch)
        return np.asarray(wide | (first <= (high - phase) / (2 * np.pi) + touch))

    ends = apply("sin", low), apply("sin", high)
    smallest, largest = _outward(np.minimum(*ends), np.maximum(*ends), 4)
    return (
        np.where(holds(-np.pi / 2), -1.0, np.maximum(smallest, -1.0)),
        np.where(holds(np.pi / 2), 1.0, np.minimum(largest, 1.0)),
    )


def _cosine(a: Bounds) -> Bounds:
    return _sine(_outward(a[0] + np.pi / 2, a[1] + np.pi / 2, 2))


def _tangent(a: Bounds) -> Bounds:
    pole = np.floor(a[0] / np.pi - 0.5 - _TOUCH) != np.floor(a[1] / np.pi - 0.5 + _TOUCH)
    with np.errstate(all="ignore"):
        low, high = _outward(apply("tan", a[0]), apply("tan", a[1]), 4)
    return np.where(pole, -np.inf, low), np.where(pole, np.inf, high)


def whole_exponent(exponent: float) -> bool:
    """Whether a power is a product of so many factors."""
    return exponent == np.round(exponent) and abs(exponent) < 64


def _power(a: Bounds, b: Bounds) -> Bounds:
    """a^b: whole constant exponents exactly, others by exp(b log a) where a > 0."""
    exponent = float(b[0].flat[0])
    if np.all(b[0] == exponent) and np.all(b[1] == exponent) and whole_exponent(exponent):
        base = _inverse(a) if exponent < 0 else a
        result: Bounds = (np.ones_like(base[0]), np.ones_like(base[1]))
        for _ in range(abs(int(exponent)) // 2):
            result = _products(result, _square(base))
        return _products(result, base) if int(exponent) % 2 else result
    return LIBRARY[ca.OP_EXP](_products(b, LIBRARY[ca.OP_LOG](a)))


def _angle(y: Bounds, x: Bounds) -> Bounds:
    """atan2: the extremes lie in the corners of a box that the half line of the jump, y = 0 and x <= 0, misses."""
    jump = (y[0] <= 0) & (y[1] >= 0) & (x[0] <= 0)
    corners = [apply("atan2", p, q) for p in y for q in x]
    low, high = _outward(np.minimum.reduce(corners), np.maximum.reduce(corners), 4)
    return np.where(jump, -4.0, low), np.where(jump, 4.0, high)


def _root(a: Bounds) -> Bounds:
    with np.errstate(invalid="ignore"):
        return _outward(np.sqrt(a[0]), np.sqrt(a[1]))


def _truth(certain: np.ndarray, possible: np.ndarray) -> Bounds:
    return certain.astype(float), possible.astype(float)


def _zero(a: Bounds) -> tuple[np.ndarray, np.ndarray]:
    """Whether it certainly is zero, and whether it may be."""
    return (a[0] == 0) & (a[1] == 0), (a[0] <= 0) & (a[1] >= 0)


def _equal(a: Bounds, b: Bounds) -> Bounds:
    return _truth((a[0] == a[1]) & (b[0] == b[1]) & (a[0] == b[0]), (a[0] <= b[1]) & (b[0] <= a[1]))


def _not(a: Bounds) -> Bounds:
    return _truth(*_zero(a))


def _and(a: Bounds, b: Bounds) -> Bounds:
    (none_a, maybe_a), (none_b, maybe_b) = _zero(a), _zero(b)
    return _truth(~maybe_a & ~maybe_b, ~none_a & ~none_b)


def _or(a: Bounds, b: Bounds) -> Bounds:
    return _not(_and(_not(a), _not(b)))


def _either(condition: Bounds, value: Bounds) -> Bounds:
    """value where the condition holds, else zero."""
    never, perhaps = _zero(condition)
    low = np.where(perhaps, np.minimum(value[0], 0.0), value[0])
    high = np.where(perhaps, np.maximum(value[1], 0.0), value[1])
    return np.where(never, 0.0, low), np.where(never, 0.0, high)


def _plain(function: Callable[[np.ndarray], np.ndarray]) -> Operation:
    """An increasing function without rounding."""
    return lambda a: (function(a[0]), function(a[1]))


INCREASING: dict[int, tuple[str, float, float]] = {
    ca.OP_EXP: ("exp", 0.0, np.inf),
    ca.OP_LOG: ("log", -np.inf, np.inf),
    ca.OP_EXPM1: ("expm1", -1.0, np.inf),
    ca.OP_LOG1P: ("log1p", -np.inf, np.inf),
    ca.OP_ASIN: ("asin", -np.inf, np.inf),
    ca.OP_ATAN: ("atan", -np.inf, np.inf),
    ca.OP_SINH: ("sinh", -np.inf, np.inf),
    ca.OP_TANH: ("tanh", -1.0, 1.0),
}
"""Elementary functions, and between what their values lie."""

LIBRARY: dict[int, Operation] = {
    **{op: _increasing(*function) for op, function in INCREASING.items()},
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_ADD: _add,
    ca.OP_SUB: _subtract,
    ca.OP_MUL: _products,
    ca.OP_DIV: lambda a, b: _products(a, _inverse(b)),
    ca.OP_NEG: _negative,
    ca.OP_INV: _inverse,
    ca.OP_TWICE: lambda a: (2 * a[0], 2 * a[1]),
    ca.OP_SQ: _square,
    ca.OP_SQRT: _root,
    ca.OP_SIN: _sine,
    ca.OP_COS: _cosine,
    ca.OP_TAN: _tangent,
    ca.OP_ACOS: lambda a: _add((np.full_like(a[0], np.pi / 2),) * 2, _negative(LIBRARY[ca.OP_ASIN](a))),
    ca.OP_ATAN2: _angle,
    ca.OP_COSH: _cosh,
    ca.OP_POW: _power,
    ca.OP_CONSTPOW: _power,
    ca.OP_FABS: _absolute,
    ca.OP_SIGN: _plain(np.sign),
    ca.OP_FLOOR: _plain(np.floor),
    ca.OP_CEIL: _plain(np.ceil),
    ca.OP_FMIN: lambda a, b: (np.minimum(a[0], b[0]), np.minimum(a[1], b[1])),
    ca.OP_FMAX: lambda a, b: (np.maximum(a[0], b[0]), np.maximum(a[1], b[1])),
    ca.OP_LT: lambda a, b: _truth(a[1] < b[0], a[0] < b[1]),
    ca.OP_LE: lambda a, b: _truth(a[1] <= b[0], a[0] <= b[1]),
    ca.OP_EQ: _equal,
    ca.OP_NE: lambda a, b: _not(_equal(a, b)),
    ca.OP_NOT: _not,
    ca.OP_AND: _and,
    ca.OP_OR: _or,
    ca.OP_IF_ELSE_ZERO: _either,
}
