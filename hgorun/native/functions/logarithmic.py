"""log, log1p, asinh, acosh and atanh."""

from __future__ import annotations

import math
from typing import NamedTuple

from hgorun.native.functions.arithmetic import (
    Pair,
    exact_product,
    exact_sum,
    integer,
    ordered_sum,
    polynomial,
    quotient,
    root,
    scaled,
    select,
)
from hgorun.native.functions.coefficients import LN2, LOG, RATIO
from hgorun.native.ir import Block

# the bits of 1 less those of √½: adding them carries into the exponent from √2 on
_ONE, _ROOT = 0x3FF0000000000000, 0x3FE6A09E667F3BCD
# in the low bits of 2^52 an integer reads as a double
BIAS = 2.0**52 + 1023


class Mantissa(NamedTuple):
    """x = 2^k m with √½ <= m < √2."""

    k: str
    m: str
    biased: str  # k + 1023 as an integer


def split(block: Block, x: str, bias: str) -> Mantissa:
    """Exponent and mantissa of a normal number; ``bias`` is what to take from the biased exponent."""
    shifted = integer(block, "add", block.bits(x), _ONE - _ROOT)
    exponent = integer(block, "lshr", shifted, 52)
    k = block.sub(block.from_bits(integer(block, "or", exponent, 0x4330000000000000)), bias)
    m = block.from_bits(integer(block, "add", integer(block, "and", shifted, 2**52 - 1), _ROOT))
    return Mantissa(k, m, exponent)


def log(block: Block, x: str) -> str:
    """log x = k log 2 + log(1 + f) with x = 2^k (1 + f), √½ <= 1 + f < √2.

    log(1 + f) = f - (f²/2 - s (f²/2 + w P(w))), s = f/(2 + f), w = s², P of degree 6 on w <= (3 - √8)²: the
    rounded terms are small against f. Below 0.9 ulp.
    """
    zero = block.constant(0.0)
    subnormal = block.compare("olt", x, block.constant(2.0**-1022))
    # k comes as a double less an offset; an infinite or NaN offset makes the result so:
    # +inf for 0, NaN below, and -x for inf and NaN
    at_zero = block.select(block.compare("olt", x, zero), block.constant(math.nan), block.constant(math.inf))
    low = block.select(block.compare("ogt", x, zero), block.constant(BIAS + 54), at_zero)
    finite = block.compare("olt", x, block.constant(math.inf))
    offset = block.select(subnormal, low, block.select(finite, block.constant(BIAS), block.neg(x)))
    x = block.select(subnormal, block.mul(x, block.constant(2.0**54)), x)
    k, m, _ = split(block, x, offset)
    f = block.sub(m, block.constant(1.0))
    s = block.div(f, block.add(f, block.constant(2.0)))
    w = block.mul(s, s)
    half_square = block.mul(block.mul(f, f), block.constant(0.5))
    series = block.fma(w, polynomial(block, LOG, w), half_square)
    rest = block.fma(s, series, block.mul(k, block.constant(LN2[1])))
    return block.fma(k, block.constant(LN2[0]), block.sub(f, block.sub(half_square, rest)))


def _ratio(block: Block, k: str, n: Pair, d: Pair) -> str:
    """k log 2 + log((2 d + n)/(2 d - n)) for |n/d| <= 0.345, within 0.6 ulp.

    log((2 + s)/(2 - s)) = s + s³ P(s²), P of degree 6: only s and the sum are pairs.
    """
    s = quotient(block, n, d)
    w = block.mul(s.high, s.high)
    cubic = block.mul(block.mul(w, s.high), polynomial(block, RATIO, w))
    high, low = add_exponent(block, k, s.high)
    return block.add(high, block.add(block.add(s.low, cubic), low))


def add_exponent(block: Block, k: str, log: str) -> Pair:
    """k log 2 + log without error but for one of 2^-107 |k|."""
    exponent = exact_product(block, k, block.constant(LN2[0]))
    total = ordered_sum(block, exponent.high, log)
    return Pair(total.high, block.add(total.low, block.fma(k, block.constant(LN2[1]), exponent.low)))


def _mantissa_pair(block: Block, m: str, low: str) -> tuple[Pair, Pair]:
    """n and d of :func:`_ratio` for the number m + low."""
    half = block.constant(0.5)
    n = exact_sum(block, block.sub(m, block.constant(1.0)), low)
    d = ordered_sum(block, block.constant(1.0), block.mul(n.high, half))
    return n, Pair(d.high, block.fma(n.low, half, d.low))


def _split_pair(block: Block, x: Pair) -> tuple[Mantissa, str]:
    """Exponent and mantissa of a pair, and the low part of the mantissa."""
    found = split(block, x.high, block.constant(BIAS))
    # 2^(1 - k), for 2^-k need not be normal
    factor = integer(block, "shl", integer(block, "sub", block.integer_constant(2047), found.biased), 52)
    return found, block.mul(block.mul(x.low, block.constant(0.5)), block.from_bits(factor))


def log1p(block: Block, x: str) -> str:
    """log(1 + x), with 1 + x as a pair. Below 0.6 ulp."""
    infinity = block.constant(math.inf)
    minus_one = block.constant(-1.0)
    mantissa, low = _split_pair(block, exact_sum(block, block.constant(1.0), x))
    found = _ratio(block, mantissa.k, *_mantissa_pair(block, mantissa.m, low))
    found = block.intrinsic("copysign", found, x)
    at_end = block.select(block.compare("oeq", x, minus_one), block.neg(infinity), block.constant(math.nan))
    found = block.select(block.compare("ogt", x, minus_one), found, at_end)
    return block.select(block.compare("oeq", x, infinity), infinity, found)


def _area(block: Block, a: str, leg: Pair, n: Pair, d: Pair) -> str:
    """log(a + leg), from 2^30 on log 2 a.

    Near 1 the logarithm is that of (2 d + n)/(2 d - n), which keeps the digits that a + leg has lost.
    """
    half = block.constant(0.5)
    large = block.compare("ogt", a, block.constant(2.0**30))
    total = exact_sum(block, a, leg.high)
    both = scaled(block, Pair(total.high, block.add(total.low, leg.low)), half)
    mantissa, low = _split_pair(block, select(block, large, Pair(a, block.constant(0.0)), both))
    k = block.add(mantissa.k, block.constant(1.0))
    near = block.compare("oeq", k, block.constant(0.0))
    of_sum = _mantissa_pair(block, mantissa.m, low)
    found = _ratio(block, k, select(block, near, n, of_sum[0]), select(block, near, d, of_sum[1]))
    return block.select(block.compare("olt", a, block.constant(math.inf)), found, a)


def asinh(block: Block, x: str) -> str:
    """log(a + √(a² + 1)) of a = |x|, with the sign of x. Below 0.6 ulp.

    Near 1 with tanh(y/2) = sinh y/(1 + cosh y): n = a and 2 d = 1 + √(a² + 1).
    """
    a = block.intrinsic("fabs", x)
    one, limit = block.constant(1.0), block.constant(2.0**30)
    bounded = block.select(block.compare("ogt", a, limit), limit, a)
    square = exact_product(block, bounded, bounded)
    more = exact_sum(block, square.high, one)
    leg = root(block, Pair(more.high, block.add(more.low, square.low)))
    d = exact_sum(block, one, leg.high)
    d = scaled(block, Pair(d.high, block.add(d.low, leg.low)), block.constant(0.5))
    found = _area(block, a, leg, Pair(a, block.constant(0.0)), d)
    return block.intrinsic("copysign", found, x)


def acosh(block: Block, x: str) -> str:
    """log(x + √(x² - 1)); NaN for x < 1. Below 0.6 ulp.

    Near 1 with tanh(y/2) = sinh y/(1 + cosh y): n = √(x² - 1) and 2 d = 1 + x.
    """
    one, limit = block.constant(1.0), block.constant(2.0**30)
    bounded = block.select(block.compare("ogt", x, limit), limit, x)
    less, more = block.sub(bounded, one), exact_sum(block, bounded, one)
    square = exact_product(block, less, more.high)
    leg = root(block, Pair(square.high, block.fma(less, more.low, square.low)))
    found = _area(block, x, leg, leg, scaled(block, more, block.constant(0.5)))
    return block.select(block.compare("oge", x, one), found, block.constant(math.nan))


def atanh(block: Block, x: str) -> str:
    """log((1 + a)/(1 - a))/2 of a = |x|, with the sign of x; NaN for a > 1. Below 0.6 ulp.

    The ratio being 2^k m, m = (1 + a)/(2^k (1 - a)) without a rounding of the ratio.
    """
    a = block.intrinsic("fabs", x)
    one, half = block.constant(1.0), block.constant(0.5)
    more, less = exact_sum(block, one, a), exact_sum(block, one, block.neg(a))
    ratio = split(block, block.div(more.high, less.high), block.constant(BIAS))
    less = scaled(block, less, block.from_bits(integer(block, "shl", ratio.biased, 52)))
    n, d = exact_sum(block, more.high, block.neg(less.high)), exact_sum(block, more.high, less.high)
    n = exact_sum(block, n.high, block.add(n.low, block.sub(more.low, less.low)))
    d = scaled(block, Pair(d.high, block.add(d.low, block.add(more.low, less.low))), half)
    at_end = block.select(block.compare("oeq", a, one), block.constant(math.inf), block.constant(math.nan))
    found = block.select(block.compare("olt", a, one), block.mul(_ratio(block, ratio.k, n, d), half), at_end)
    return block.intrinsic("copysign", found, x)
