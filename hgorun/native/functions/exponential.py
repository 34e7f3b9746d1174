"""exp, expm1, sinh, cosh and tanh."""

from __future__ import annotations

import math
from typing import NamedTuple

from hgorun.native.functions.arithmetic import (
    ROUND,
    ROUND_8,
    Pair,
    exact_product,
    exact_sum,
    integer,
    ordered_sum,
    polynomial,
)
from hgorun.native.functions.coefficients import COSH, COTH, EXP, EXP_CUBIC, LN2, SINH
from hgorun.native.functions.shared import call
from hgorun.native.ir import Block

# 2046 is twice the bias of the exponent: n + 2046 splits into the exponent fields of two factors
_MAGIC = ROUND + 2046
_NORMAL = 708.0  # up to it the exponential is a normal number


def clamped(block: Block, x: str, low: float, high: float) -> str:
    """x between two ends; a NaN fails both comparisons and stays."""
    lowest, highest = block.constant(low), block.constant(high)
    x = block.select(block.compare("olt", x, lowest), lowest, x)
    return block.select(block.compare("ogt", x, highest), highest, x)


def _power_of_two(block: Block, biased: str) -> Pair:
    """Two factors whose product is 2^n, neither of which can overflow, of the bits of n + _MAGIC."""
    half = integer(block, "lshr", biased, 1)
    first = block.from_bits(integer(block, "shl", half, 52))
    second = block.from_bits(integer(block, "shl", integer(block, "sub", biased, half), 52))
    return Pair(first, second)


def exp(block: Block, x: str) -> str:
    """exp x = 2^n exp r with r = x - n log 2, n = rint(x/log 2).

    exp r = 1 + r + r² P(r), P of degree 9 on |r| <= 1.005 log(2)/2. Below 1.1 ulp, and a subnormal result
    within its last place.
    """
    t = block.fma(x, block.constant(1 / math.log(2)), block.constant(ROUND + 1023))
    p = _exp_less_1(block, x, block.sub(t, block.constant(ROUND + 1023)))
    power = block.from_bits(integer(block, "shl", block.bits(t), 52))
    usual = block.fma(p, power, power)
    # where 2^n or the result is no normal number, or x none at all
    beyond = block.compare("uge", block.intrinsic("fabs", x), block.constant(_NORMAL))
    return block.rarely(
        block.any(beyond), usual, lambda: block.select(beyond, call(block, "exp", _exp_of_any, x), usual)
    )


def _exp_of_any(block: Block, x: str) -> str:
    """The same where 2^n is applied as two factors, neither of which can overflow."""
    # beyond these ends the result is 0 or infinite
    x = clamped(block, x, -746.0, 710.0)
    magic = block.constant(_MAGIC)
    t = block.fma(x, block.constant(1 / math.log(2)), magic)
    p = _exp_less_1(block, x, block.sub(t, magic))
    first, second = _power_of_two(block, block.bits(t))
    # the fma rounds like 1 + p, first being a power of 2 and far from both ends
    return block.mul(block.fma(p, first, first), second)


def _exp_less_1(block: Block, x: str, n: str) -> str:
    """exp(x - n log 2) - 1."""
    r = block.fma(n, block.constant(-LN2[0]), x)
    r = block.fma(n, block.constant(-LN2[1]), r)
    return block.fma(block.mul(r, r), polynomial(block, EXP, r), r)


def exp_of_pair(block: Block, x: Pair) -> str:
    """The exponential of a pair between -746 and 710. Below 0.53 ulp.

    As in :func:`exp`, but exp r = 1 + r + r²/2 + r³ P(r) with the first three terms as pairs.
    """
    magic = block.constant(_MAGIC)
    t = block.fma(x.high, block.constant(1 / math.log(2)), magic)
    n = block.sub(t, magic)
    r = _remainder(block, x.high, n, x.low)
    square = exact_product(block, r.high, block.mul(r.high, block.constant(0.5)))
    one = ordered_sum(block, block.constant(1.0), r.high)
    main = ordered_sum(block, one.high, square.high)
    cube = block.mul(block.mul(r.high, r.high), block.mul(r.high, polynomial(block, EXP_CUBIC, r.high)))
    rest = block.add(block.add(one.low, main.low), block.add(square.low, block.fma(r.high, r.low, r.low)))
    first, second = _power_of_two(block, block.bits(t))
    total = block.fma(block.add(cube, rest), first, block.mul(main.high, first))
    return block.mul(total, second)


def _remainder(block: Block, x: str, n: str, low: str) -> Pair:
    """x + low - n log 2. The first step is exact: its terms are multiples of 2^-54, its result is below 1/2."""
    r = block.fma(n, block.constant(-LN2[0]), x)
    return ordered_sum(block, r, block.fma(n, block.constant(-LN2[1]), low))


class _Reduced(NamedTuple):
    """x = n log 2 + r, and 2^n as s·scale with s far from overflow."""

    r: Pair
    s: str
    inverse: str  # 1/s
    one: str  # 1/scale
    scale: str


def _reduce(block: Block, x: str) -> _Reduced:
    t = block.fma(x, block.constant(1 / math.log(2)), block.constant(ROUND))
    n = block.sub(t, block.constant(ROUND))
    large = block.compare("ogt", n, block.constant(1000.0))
    scale = block.select(large, block.constant(2.0**64), block.constant(1.0))
    one = block.select(large, block.constant(2.0**-64), block.constant(1.0))
    biased = integer(block, "shl", block.bits(t), 52)
    s = block.from_bits(integer(block, "add", biased, block.bits(one)))
    # of the negative exponent: bits of one count down from those of 1 twice
    inverse = block.from_bits(integer(block, "sub", block.integer_constant(2046 << 52), block.bits(s)))
    return _Reduced(_remainder(block, x, n, block.constant(0.0)), s, inverse, one, scale)


def expm1(block: Block, x: str) -> str:
    """exp(x) - 1 = (2^n - 1) + 2^n (r + r²/2 + r³ P(r)), the first three terms as pairs. Below 0.7 ulp."""
    # below the lower end the result is -1 rounded
    reduced = _reduce(block, clamped(block, x, -40.0, 710.0))
    r, s = reduced.r, reduced.s
    whole = exact_sum(block, s, block.neg(reduced.one))
    linear = ordered_sum(block, whole.high, block.mul(s, r.high))
    square = exact_product(block, r.high, block.mul(r.high, block.constant(0.5)))
    main = ordered_sum(block, linear.high, block.mul(s, square.high))
    cube = block.mul(block.mul(r.high, r.high), block.mul(r.high, polynomial(block, EXP_CUBIC, r.high)))
    small = block.add(block.add(square.low, block.fma(r.high, r.low, r.low)), cube)
    rest = block.fma(s, small, block.add(block.add(linear.low, main.low), whole.low))
    return block.intrinsic("copysign", block.mul(block.add(main.high, rest), reduced.scale), x)


def _hyperbolic(block: Block, x: str, *, odd: bool) -> str:
    """sinh |x| or cosh |x| of |x| = n log 2 + r, by addition.

    With s = 2^n they are A cosh r + B sinh r, A and B being (s - 1/s)/2 and (s + 1/s)/2 for sinh and the reverse
    for cosh; sinh r = r + r³ P(r²) and cosh r = 1 + r² Q(r²).
    """
    reduced = _reduce(block, clamped(block, block.intrinsic("fabs", x), 0.0, 712.0))
    r = reduced.r
    half = block.constant(0.5)
    s = block.mul(reduced.s, half)
    # 1/s beside an s that is scaled down does not count
    inverse = block.mul(reduced.inverse, half)
    less, more = ordered_sum(block, s, block.neg(inverse)), ordered_sum(block, s, inverse)
    a, b = (less, more) if odd else (more, less)
    linear = exact_product(block, b.high, r.high)
    main = ordered_sum(block, a.high, linear.high)
    z = block.mul(r.high, r.high)
    even = block.mul(a.high, polynomial(block, COSH, z))
    rest = block.mul(z, block.fma(block.mul(b.high, r.high), polynomial(block, SINH, z), even))
    slope = block.fma(a.high, r.high, b.high)
    low = block.add(block.fma(b.low, r.high, a.low), block.fma(r.low, slope, linear.low))
    total = block.add(main.high, block.add(block.add(main.low, low), rest))
    return block.mul(total, reduced.scale)


def sinh(block: Block, x: str) -> str:
    """The hyperbolic sine. Below 1 ulp."""
    return block.intrinsic("copysign", _hyperbolic(block, x, odd=True), x)


def cosh(block: Block, x: str) -> str:
    """The hyperbolic cosine. Below 0.8 ulp."""
    return _hyperbolic(block, x, odd=False)


def tanh(block: Block, x: str) -> str:
    """tanh of |x| = r + n log(2)/2, from s = 2^n and c = r coth r, so that exp 2r = (c + r)/(c - r).

    tanh |x| = N/(N + c - r), N = ((s - 1) c + (s + 1) r)/2; for n = 0 that is r/c, computed as such.
    c = 1 + r² P(r²), P of degree 5 on -log(2)/8 <= r <= 3 log(2)/8. r is off the centre because n = 1 loses
    digits where N is small. Below 1.9 ulp, never above 1, x itself for |x| < 1e-8.
    """
    a = block.intrinsic("fabs", x)
    # tanh rounds to 1 from 19.07 on; a NaN fails the comparison and stays
    end = block.constant(20.0)
    a = block.select(block.compare("ogt", a, end), end, a)
    # n = floor(2a/log 2 + 1/4), on top of the bias of the exponent, which makes s of the bits
    t = block.fma(a, block.constant(2 / math.log(2)), block.constant(ROUND_8 + 1023 + 0.25))
    biased = integer(block, "and", block.bits(t), -(2**8))
    s = block.from_bits(integer(block, "shl", biased, 52 - 8))
    n = block.sub(block.from_bits(biased), block.constant(ROUND_8 + 1023))
    # one part of log 2 is enough: what n times the next adds to r, the slope of tanh takes away
    r = block.fma(n, block.constant(-LN2[0] / 2), a)
    z = block.mul(r, r)
    one, half = block.constant(1.0), block.constant(0.5)
    c = block.fma(z, polynomial(block, COTH, z), one)
    less, more = block.fma(s, half, block.constant(-0.5)), block.fma(s, half, half)
    numerator = block.fma(less, c, block.mul(more, r))
    # built on the numerator, the denominator shares its rounding error, which drops out of a ratio near 1;
    # for n = 0 the r would cancel with a loss, and m = 0 leaves c alone
    m = block.select(block.compare("olt", n, one), n, one)
    denominator = block.fma(m, numerator, block.fma(block.neg(m), r, c))
    return block.intrinsic("copysign", block.div(numerator, denominator), x)
