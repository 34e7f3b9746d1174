"""pow and hypot."""

from __future__ import annotations

import math

from hgorun.native.functions.arithmetic import (
    Pair,
    exact_product,
    flip,
    mask,
    ordered_sum,
    polynomial,
    product,
    quotient,
    root,
    sign_bit,
)
from hgorun.native.functions.coefficients import RATIO_SQUARE
from hgorun.native.functions.exponential import clamped, exp_of_pair
from hgorun.native.functions.logarithmic import BIAS, add_exponent, split
from hgorun.native.ir import Block

_TWELFTH = (1 / 12, 4.625929269271485e-18)


def _is_integer(block: Block, a: str) -> str:
    """Where a number >= 0 is an integer, a mask."""
    shift = block.constant(2.0**52)
    rounded = block.sub(block.add(a, shift), shift)
    return mask(block, "or", block.compare("oge", a, shift), block.compare("oeq", rounded, a))


def _log_pair(block: Block, a: str) -> Pair:
    """log a of a >= 0 to about 2^-63, infinite at both ends.

    log a = k log 2 + log((2 + s)/(2 - s)) = k log 2 + s (1 + s²/12 + s⁴ P(s²)), P of degree 7 and the other
    terms pairs.
    """
    zero, infinity = block.constant(0.0), block.constant(math.inf)
    subnormal = block.compare("olt", a, block.constant(2.0**-1022))
    bias = block.select(subnormal, block.constant(BIAS + 54), block.constant(BIAS))
    k, m, _ = split(block, block.select(subnormal, block.mul(a, block.constant(2.0**54)), a), bias)
    f = block.sub(m, block.constant(1.0))
    d = ordered_sum(block, block.constant(1.0), block.mul(f, block.constant(0.5)))
    s = quotient(block, Pair(f, zero), d)
    w = product(block, s, s)
    factor = polynomial(block, RATIO_SQUARE, w.high)
    series = ordered_sum(block, block.constant(_TWELFTH[0]), block.mul(w.high, factor))
    low = block.fma(w.low, factor, block.constant(_TWELFTH[1]))
    cubic = product(block, s, product(block, w, Pair(series.high, block.add(series.low, low))))
    mantissa = ordered_sum(block, s.high, cubic.high)
    low = block.add(mantissa.low, block.add(s.low, cubic.low))
    total = add_exponent(block, k, mantissa.high)
    high = block.select(block.compare("oeq", a, zero), block.neg(infinity), total.high)
    return Pair(block.select(block.compare("olt", a, infinity), high, a), block.add(total.low, low))


def pow(block: Block, x: str, y: str) -> str:
    """x^y = exp(y log |x|), the logarithm a pair, with the sign that an odd y takes from x.

    Below 0.7 ulp, and a subnormal result within one last place: a result that is a double comes out as it. x² is
    x·x. Special values are those of C: 1 for y = 0 and for x = 1 whatever the other, NaN for x < 0 and a
    fractional y.
    """
    zero, one = block.constant(0.0), block.constant(1.0)
    a, b = block.intrinsic("fabs", x), block.intrinsic("fabs", y)
    log = _log_pair(block, a)
    # y beyond 2^64 makes 0, 1 or infinity of any x
    bounded = clamped(block, y, -(2.0**64), 2.0**64)
    high, error = exact_product(block, bounded, log.high)
    low = block.fma(bounded, log.low, error)
    inside = block.compare("olt", block.intrinsic("fabs", high), block.constant(746.0))
    exponent = Pair(clamped(block, high, -746.0, 710.0), block.select(inside, low, zero))
    size = exp_of_pair(block, exponent)
    size = block.select(block.compare("oeq", y, block.constant(2.0)), block.mul(a, a), size)
    whole, even = _is_integer(block, b), _is_integer(block, block.mul(b, block.constant(0.5)))
    sign = block.bits(block.select(even, zero, block.from_bits(sign_bit(block, x))))
    sign = block.bits(block.select(whole, block.from_bits(sign), zero))
    found = flip(block, size, sign)
    negative = mask(block, "and", block.compare("olt", x, zero), block.compare("one", a, block.constant(math.inf)))
    nan = block.constant(math.nan)
    found = block.select(negative, block.select(whole, found, nan), found)
    found = block.select(block.compare("uno", x, y), nan, found)
    certain = mask(block, "or", block.compare("oeq", y, zero), block.compare("oeq", x, one))
    return block.select(certain, one, found)


def hypot(block: Block, x: str, y: str) -> str:
    """√(x² + y²), the sum a pair, scaled away from both ends of the range. Below 0.51 ulp.

    A subnormal result is within one last place; infinite if one argument is, even where the other is NaN.
    """
    infinity = block.constant(math.inf)
    a, b = block.intrinsic("fabs", x), block.intrinsic("fabs", y)
    swap = block.compare("ogt", b, a)
    larger, smaller = block.select(swap, b, a), block.select(swap, a, b)
    big = block.compare("ogt", larger, block.constant(2.0**500))
    tiny = block.compare("olt", larger, block.constant(2.0**-500))

    def choose(if_big: float, if_tiny: float) -> str:
        other = block.select(tiny, block.constant(if_tiny), block.constant(1.0))
        return block.select(big, block.constant(if_big), other)

    factor = choose(2.0**-600, 2.0**600)
    larger, smaller = block.mul(larger, factor), block.mul(smaller, factor)
    first, second = exact_product(block, larger, larger), exact_product(block, smaller, smaller)
    total, error = ordered_sum(block, first.high, second.high)
    high, low = root(block, Pair(total, block.add(error, block.add(first.low, second.low))))
    found = block.mul(block.add(high, low), choose(2.0**600, 2.0**-600))
    infinite = mask(block, "or", block.compare("oeq", a, infinity), block.compare("oeq", b, infinity))
    return block.select(infinite, infinity, found)
