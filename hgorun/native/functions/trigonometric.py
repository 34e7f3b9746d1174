"""sin, cos and tan.

Up to PERIODIC_LIMIT the argument is reduced by multiples of a π of three doubles (Cody and Waite), beyond it by
those of a π of as many digits as it takes (Payne and Hanek), in a function that runs only where a lane needs it.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from hgorun.native.functions.arithmetic import (
    ROUND,
    ROUND_8,
    Pair,
    exact_product,
    exact_sum,
    flip,
    integer,
    ordered_sum,
    polynomial,
    quotient,
    select,
    sign_bit,
)
from hgorun.native.functions.coefficients import COSINE_QUARTER, PI, SINE, SINE_QUARTER
from hgorun.native.functions.reduction import nearest, quarter_turns
from hgorun.native.functions.shared import each
from hgorun.native.ir import Block

# above it the quotient of sin or cos would leave the range of ROUND_8
PERIODIC_LIMIT = 2.0**43


def _signed_sine(block: Block, a: str, q: str, sign: str) -> str:
    """sin(a - q π), its sign flipped by the sign bit of an integer, for a <= PERIODIC_LIMIT.

    The first fma is exact for a >= 2: a and q times the first part of π are multiples of 2^-51 and their
    difference is below 2. Below that it is, too, or its rounding is no more than that of the second.
    """
    first, second, third = PI
    r = block.fma(q, block.constant(-first), a)
    r = block.fma(q, block.constant(-second), r)
    # the third part counts only in a tiny r, whose square does not count
    z = block.mul(r, r)
    r = block.fma(q, block.constant(-third), r)
    # r + r·(z P(z)) rounds z P less than r + (r z)·P rounds the two factors
    sine = block.fma(r, _sine_factor(block, z), r)
    return flip(block, sine, sign)


def _sine_factor(block: Block, z: str) -> str:
    """z P(z) of sin r = r + r z P(z), z = r²."""
    rest = block.mul(block.mul(z, z), polynomial(block, SINE[1:], z))
    return block.fma(z, block.constant(SINE[0]), rest)


def sin(block: Block, x: str) -> str:
    """sin x = ±sin r with r = |x| - q π, q = rint(|x|/π).

    sin r = r + r³ P(r²), P of degree 7 on |r| <= 1.005 π/2. Below 1.7 ulp, never above 1.
    """
    a = block.intrinsic("fabs", x)
    t = block.fma(a, block.constant(1 / math.pi), block.constant(ROUND))
    q = block.sub(t, block.constant(ROUND))
    odd = integer(block, "shl", block.bits(t), 63)
    sign = sign_bit(block, x)
    usual = _signed_sine(block, a, q, integer(block, "xor", odd, sign))
    return _unless_large(
        block, a, usual, lambda large: flip(block, each(block, "large_sine", _large_sine, large, 0.0), sign)
    )


def cos(block: Block, x: str) -> str:
    """cos x = ±sin r with r = |x| - q π, q = k + 1/2, k = floor(|x|/π).

    The sine is that of :func:`sin`. Below 1.7 ulp, never above 1.
    """
    a = block.intrinsic("fabs", x)
    # the last 8 bits are rounded: k may be one more where |x|/π is within 1/512 below an integer. The 1 makes
    # an odd k even: cos((k + 1/2) π + r) = -(-1)^k sin r
    t = block.fma(a, block.constant(1 / math.pi), block.constant(ROUND_8 + 1))
    k = integer(block, "and", block.bits(t), -(2**8))
    q = block.sub(block.from_bits(k), block.constant(ROUND_8 + 1 - 0.5))
    usual = _signed_sine(block, a, q, integer(block, "shl", k, 63 - 8))
    return _unless_large(block, a, usual, lambda large: each(block, "large_sine", _large_sine, large, 1.0))


def _unless_large(block: Block, a: str, usual: str, of_large: Callable[[str], str]) -> str:
    """The usual value for a <= PERIODIC_LIMIT, beyond it another one."""
    limit = block.constant(PERIODIC_LIMIT)
    beyond = block.compare("ogt", a, limit)

    def otherwise() -> str:
        return block.select(beyond, of_large(block.select(beyond, a, limit)), usual)

    return block.rarely(block.any(beyond), usual, otherwise)


def _large_sine(block: Block, a: str, quarter: str) -> str:
    """sin(a + quarter π/2) of a large a on one lane, for a quarter of 0 or 1; NaN for an infinite a."""
    turns = quarter_turns(block, a)
    shift = block.let(f"zext i1 {block.compare('ogt', quarter, block.constant(0.0))} to i64")
    turns = turns._replace(high=integer(block, "add", turns.high, integer(block, "shl", shift, 62)))
    k, r = nearest(block, turns, 2)
    z = block.mul(r.high, r.high)
    cubic = block.mul(r.high, _sine_factor(block, z))
    # the slope of the sine, 1 - z/2 + ..., for the low part
    rest = block.fma(r.low, block.fma(z, block.constant(-0.5), block.constant(1.0)), cubic)
    sine = flip(block, block.add(r.high, rest), integer(block, "shl", k, 63))
    return _of_finite(block, a, sine)


def _large_tangent(block: Block, a: str) -> str:
    """tan a of a large a on one lane; NaN for an infinite a."""
    k, r = nearest(block, quarter_turns(block, a), 1)
    return _of_finite(block, a, _tangent(block, *_sine_cosine(block, r), k))


def _of_finite(block: Block, a: str, value: str) -> str:
    return block.select(block.compare("olt", a, block.constant(math.inf)), value, block.constant(math.nan))


def _odd(block: Block, k: str) -> str:
    """Where an integer is odd, a mask."""
    low = integer(block, "and", k, 1)
    return block.let(f"icmp ne {block.integer} {low}, {block.integer_constant(0)}")


def tan(block: Block, x: str) -> str:
    """tan x = tan r or -1/tan r with r = |x| - q π/2, q = rint(2 |x|/π), of the sign of x.

    tan r = sin r/cos r on |r| <= 1.005 π/4, all three as pairs. Below 1 ulp.
    """
    a = block.intrinsic("fabs", x)
    t = block.fma(a, block.constant(2 / math.pi), block.constant(ROUND))
    q = block.sub(t, block.constant(ROUND))
    first, second, third = (part / 2 for part in PI)
    # exact: both terms are multiples of 2^-53, or q = 0, and their difference is below 1
    r = block.fma(q, block.constant(-first), a)
    shift = exact_product(block, q, block.constant(-second))
    high, error = exact_sum(block, r, shift.high)
    low = block.add(block.fma(q, block.constant(-third), shift.low), error)
    sine, cosine = _sine_cosine(block, Pair(high, low))
    usual = _tangent(block, sine, cosine, block.bits(t))
    found = _unless_large(block, a, usual, lambda large: each(block, "large_tangent", _large_tangent, large))
    return flip(block, found, sign_bit(block, x))


def _tangent(block: Block, sine: Pair, cosine: Pair, quarters: str) -> str:
    """sin r/cos r, for an odd integer -cos r/sin r."""
    odd = _odd(block, quarters)
    minus = Pair(block.neg(cosine.high), block.neg(cosine.low))
    return block.add(*quotient(block, select(block, odd, minus, sine), select(block, odd, sine, cosine)))


def _sine_cosine(block: Block, r: Pair) -> tuple[Pair, Pair]:
    """sin r and cos r for |r| <= 1.005 π/4, within 2^-56.

    sin r = r + r³ P(r²), cos r = 1 - r²/2 + r⁴ Q(r²), P of degree 6 and Q of degree 5.
    """
    square = exact_product(block, r.high, r.high)
    z = square.high
    sixth = block.constant(SINE_QUARTER[0])
    tail = block.mul(block.mul(z, z), polynomial(block, SINE_QUARTER[1:], z))
    cubic = exact_product(block, r.high, block.fma(z, sixth, block.fma(square.low, sixth, tail)))
    sine = ordered_sum(block, r.high, cubic.high)
    sine = Pair(sine.high, block.add(sine.low, block.add(cubic.low, r.low)))
    half = block.constant(-0.5)
    main = ordered_sum(block, block.constant(1.0), block.mul(z, half))
    rest = block.fma(block.mul(z, z), polynomial(block, COSINE_QUARTER, z), block.mul(square.low, half))
    rest = block.add(block.fma(block.neg(r.high), r.low, rest), main.low)
    return sine, ordered_sum(block, main.high, rest)
