"""atan, atan2, asin and acos: angles of points whose coordinates are pairs."""

from __future__ import annotations

import math

from hgorun.native.functions.arithmetic import (
    Pair,
    constant,
    exact_product,
    exact_sum,
    flip,
    integer,
    mask,
    ordered_sum,
    polynomial,
    quotient,
    root,
    select,
    sign_bit,
)
from hgorun.native.functions.coefficients import ATAN, PI
from hgorun.native.ir import Block

# (k π/4) as pairs
_QUARTER = (PI[0] / 4, PI[1] / 4)
_ANGLES = ((0.0, 0.0), _QUARTER, (PI[0] / 2, PI[1] / 2), (2.356194490192345, 9.184850993605148e-17), PI[:2])


def _angle(block: Block, y: Pair, x: Pair, left: str) -> str:
    """The angle of the point (±x, y) in [0, π], for x >= 0 and y >= 0, not both 0.

    Turned by 0, π/4 or π/2 the point is within π/8 of the horizontal: there atan r = r + r³ P(r²), P of degree 11
    on |r| <= 1.005 tan(π/8). Coordinates must be far enough from the ends of the range for their sum.

    Parameters
    ----------
    left : str
        Sign bit of an integer, set where the point is (-x, y).
    """
    steep = block.compare("ogt", y.high, block.mul(x.high, block.constant(1 + math.sqrt(2))))
    middle = block.compare("ogt", y.high, block.mul(x.high, block.constant(math.sqrt(2) - 1)))
    minus = Pair(block.neg(x.high), block.neg(x.low))
    less, more = exact_sum(block, y.high, minus.high), exact_sum(block, y.high, x.high)
    less = Pair(less.high, block.add(less.low, block.sub(y.low, x.low)))
    more = Pair(more.high, block.add(more.low, block.add(y.low, x.low)))
    above = select(block, steep, minus, select(block, middle, less, y))
    beside = select(block, steep, y, select(block, middle, more, x))
    high, low = quotient(block, above, beside)
    z = block.mul(high, high)
    # the slope of atan, 1/(1 + z), for the low part
    low = block.fma(low, block.mul(z, block.sub(z, block.constant(1.0))), low)
    cube = block.mul(block.mul(z, high), polynomial(block, ATAN, z))
    mirrored = block.let(f"icmp ne {block.integer} {left}, {block.integer_constant(0)}")
    angles = [constant(block, angle) for angle in _ANGLES]
    flat, slanted = select(block, mirrored, angles[4], angles[0]), select(block, mirrored, angles[3], angles[1])
    base = select(block, steep, angles[2], select(block, middle, slanted, flat))
    total, error = ordered_sum(block, base.high, flip(block, high, left))
    rest = flip(block, block.add(low, cube), left)
    return block.add(total, block.add(block.add(error, base.low), rest))


def atan(block: Block, x: str) -> str:
    """The angle of (1, |x|), with the sign of x. Below 0.8 ulp."""
    a = block.intrinsic("fabs", x)
    # from 2^60 on it is π/2 rounded; a NaN fails the comparison and stays
    end = block.constant(2.0**60)
    a = block.select(block.compare("ogt", a, end), end, a)
    zero = block.constant(0.0)
    found = _angle(block, Pair(a, zero), Pair(block.constant(1.0), zero), block.integer_constant(0))
    return block.intrinsic("copysign", found, x)


def atan2(block: Block, y: str, x: str) -> str:
    """The angle of the point (x, y) in [-π, π]. Below 0.8 ulp, and a subnormal result within one last place.

    Both coordinates are scaled by the power of 2 that brings the larger one near 2^500, if there is one: far from
    overflow, and a smaller one that loses digits there makes a subnormal result.
    """
    zero, one, infinity = block.constant(0.0), block.constant(1.0), block.constant(math.inf)
    a, b = block.intrinsic("fabs", y), block.intrinsic("fabs", x)
    # infinite coordinates count as 1, finite ones beside them as 0; at the origin, the point (±1, 0) is taken
    far_a, far_b = block.compare("oeq", a, infinity), block.compare("oeq", b, infinity)
    far = mask(block, "or", far_a, far_b)
    sum_ = block.add(a, b)
    nan = block.compare("uno", sum_, sum_)
    a = block.select(far, block.select(far_a, one, zero), a)
    b = block.select(far, block.select(far_b, one, zero), b)
    larger = block.select(block.compare("ogt", a, b), a, b)
    b = block.select(block.compare("oeq", larger, zero), one, b)
    # the exponent E of the larger one, at least 501, makes the factor 2^(1524 - E)
    least = block.constant(2.0**-522)
    larger = block.select(block.compare("olt", larger, least), least, larger)
    exponent = integer(block, "and", block.bits(larger), 0x7FF << 52)
    factor = block.from_bits(integer(block, "sub", block.integer_constant((2547 - 4096) << 52), exponent))
    a, b = block.mul(a, factor), block.mul(b, factor)
    found = _angle(block, Pair(a, zero), Pair(b, zero), sign_bit(block, x))
    found = block.select(nan, block.constant(math.nan), found)
    return block.intrinsic("copysign", found, y)


def _leg(block: Block, a: str) -> Pair:
    """√(1 - a²)."""
    one = block.constant(1.0)
    less, more = exact_sum(block, one, block.neg(a)), exact_sum(block, one, a)
    high, low = exact_product(block, less.high, more.high)
    low = block.fma(less.high, more.low, block.fma(less.low, more.high, low))
    return root(block, Pair(high, low))


def asin(block: Block, x: str) -> str:
    """The angle of (√(1 - x²), |x|), with the sign of x; NaN for |x| > 1. Below 0.8 ulp."""
    a = block.intrinsic("fabs", x)
    found = _angle(block, Pair(a, block.constant(0.0)), _leg(block, a), block.integer_constant(0))
    return block.intrinsic("copysign", found, x)


def acos(block: Block, x: str) -> str:
    """The angle of (x, √(1 - x²)); NaN for |x| > 1. Below 0.8 ulp."""
    a = block.intrinsic("fabs", x)
    return _angle(block, _leg(block, a), Pair(a, block.constant(0.0)), sign_bit(block, x))
