"""pow, and what it takes where an exponent is a fraction.

Equations of observers have powers of errors like |e|^0.9, several of one base, at every evaluation. Where the exponent
is a fraction up to 2 no result but 1 is a double that must come out as such, and one logarithm in double precision
serves all powers of a base; all others have the logarithm as a pair. The cube root takes less than either.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from hgorun.native.functions.arithmetic import (
    ROUND,
    Pair,
    exact_product,
    flip,
    integer,
    mask,
    ordered_sum,
    polynomial,
    product,
    quotient,
    sign_bit,
)
from hgorun.native.functions.coefficients import EXP2, LOG2, RATIO_SQUARE
from hgorun.native.functions.exponential import clamped, exp_of_pair
from hgorun.native.functions.logarithmic import BIAS, add_exponent, split
from hgorun.native.functions.roots import THIRD, cube_root
from hgorun.native.functions.shared import call
from hgorun.native.ir import Block

_LARGEST = 2.0  # of the fractions: beyond it the logarithm would need more digits
_FAR = 500.0  # of |log2 x| where any such power is a normal number

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


class Exponent(NamedTuple):
    """An exponent, and how large |log2 x| may be for powers of it in double precision."""

    y: str
    limit: str


def limit_of(block: Block, y: str) -> str:
    """The limit of an exponent: 0 for halves of integers, for what is larger than 2, and for 1/3."""
    twice = block.intrinsic("fabs", block.add(y, y))
    halves = _is_integer(block, twice)
    small = block.compare("ole", twice, block.constant(2 * _LARGEST))
    limit = block.select(halves, block.constant(0.0), block.select(small, block.constant(_FAR), block.constant(0.0)))
    return block.select(block.compare("oeq", y, block.constant(THIRD)), block.constant(0.0), limit)


def pow(block: Block, x: str, y: str) -> str:
    """x^y. Below 0.7 ulp; for fractions up to 1 below 1.9, up to 2 below 3 ulp; a subnormal result within a last place.

    A result that is a double comes out as it, but for fractions other than halves; x² is x·x. An exponent that is the
    double next to 1/3 is taken for 1/3. Special values are those of C: 1 for y = 0 and for x = 1 whatever the other,
    NaN for x < 0 and a fractional y.
    """
    return powers(block, x, [Exponent(y, limit_of(block, y))])[0]


def powers(block: Block, x: str, exponents: Sequence[Exponent]) -> list[str]:
    """Powers of one base, each of them as of :func:`pow`; those of fractions share a logarithm."""
    if block.lanes > 1:
        return _powers(block, x, exponents)
    one_each = [(x, *exponent) for exponent in exponents]
    return block.side_by_side(lambda b, x, y, limit: _powers(b, x, [Exponent(y, limit)])[0], one_each, least=2)


def _powers(block: Block, x: str, exponents: Sequence[Exponent]) -> list[str]:
    """Where |log2 x| is below the limit in double precision.

    x = 2^k m, log2 m = s P(s²) with s = (m - 1)/(m + 1), P of degree 7. Of y (k + log2 m) the nearest integer n is the
    exponent of the power, and y k - n loses no digit, however large k is; 2^r = 1 + r Q(r), Q of degree 10.
    """
    one = block.constant(1.0)
    k, m, _ = split(block, x, block.constant(BIAS))
    s = block.div(block.sub(m, one), block.add(m, one))
    fraction = block.mul(s, polynomial(block, LOG2, block.mul(s, s)))
    # of zero, subnormal numbers, infinity, NaN and negative numbers k is beyond the limit, too
    size = block.intrinsic("fabs", k)
    beyond = [block.compare("uge", size, exponent.limit) for exponent in exponents]
    usual = [_fractional(block, k, fraction, y) for y, _ in exponents]

    def otherwise() -> list[str]:
        every = [call(block, "pow", _any_power, x, y) for y, _ in exponents]
        return [block.select(*three) for three in zip(beyond, every, usual, strict=True)]

    some = beyond[0]
    for other in beyond[1:]:
        some = mask(block, "or", some, other)
    return block.rarely_all(block.any(some), usual, otherwise)


def _fractional(block: Block, k: str, fraction: str, y: str) -> str:
    """2^(y (k + fraction)), a normal number."""
    magic = block.constant(ROUND + 1023)
    t = block.fma(y, block.add(k, fraction), magic)
    r = block.fma(y, fraction, block.fma(y, k, block.neg(block.sub(t, magic))))
    scale = block.from_bits(integer(block, "shl", block.bits(t), 52))
    return block.fma(block.mul(r, scale), polynomial(block, EXP2, r), scale)


def _any_power(block: Block, x: str, y: str) -> str:
    """The power of any exponent."""
    third = block.compare("oeq", y, block.constant(THIRD))
    return block.select(third, cube_root(block, x), _power_by_pairs(block, x, y))


def _power_by_pairs(block: Block, x: str, y: str) -> str:
    """x^y = exp(y log |x|), the logarithm a pair, with the sign that an odd y takes from x."""
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
