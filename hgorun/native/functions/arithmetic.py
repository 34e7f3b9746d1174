"""What the functions are made of: polynomials, bits, and pairs of doubles.

A pair stands for the sum of its doubles, about 106 bits where the low one is the rounding error of the high one.
The operations on pairs are those of Dekker, with an fma for the error of a product.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from hgorun.native.ir import Block

# 1.5·2^52 + y for |y| < 2^51 is rounded to an integer, whose low bits are those of the sum; in 1.5·2^44 + y
# clearing the last 8 bits rounds down
ROUND = 1.5 * 2.0**52
ROUND_8 = 1.5 * 2.0**44
SIGN = -(2**63)


class Pair(NamedTuple):
    """The sum of two doubles."""

    high: str
    low: str


def integer(block: Block, operation: str, a: str, b: str | int) -> str:
    """An instruction on 64-bit integers."""
    other = block.integer_constant(b) if isinstance(b, int) else b
    return block.let(f"{operation} {block.integer} {a}, {other}")


def sign_bit(block: Block, x: str) -> str:
    """The sign of x as an integer whose other bits are 0."""
    return integer(block, "and", block.bits(x), SIGN)


def flip(block: Block, x: str, sign: str) -> str:
    """x or -x, as the sign bit of an integer says."""
    return block.from_bits(integer(block, "xor", block.bits(x), sign))


def mask(block: Block, operation: str, a: str, b: str) -> str:
    """``and`` or ``or`` of two masks."""
    return block.let(f"{operation} {block.mask} {a}, {b}")


def polynomial(block: Block, coefficients: Sequence[float], x: str) -> str:
    """Σ coefficients[i] xⁱ, pairing neighbours to a polynomial in x² and so on (Estrin's scheme).

    Against Horner's scheme two or three multiplications more, which cost up to 8 % of the throughput of
    functions on 8 lanes, and a latency shorter by 10 to 25 % of the whole function's.
    """
    terms = [block.constant(c) for c in coefficients]
    while len(terms) > 1:
        pairs = [block.fma(high, x, low) for low, high in zip(terms[::2], terms[1::2], strict=False)]
        terms = pairs + terms[2 * len(pairs) :]
        if len(terms) > 1:
            x = block.mul(x, x)
    return terms[0]


def ordered_sum(block: Block, a: str, b: str) -> Pair:
    """a + b without error, for |a| >= |b| or a = 0."""
    high = block.add(a, b)
    return Pair(high, block.sub(b, block.sub(high, a)))


def exact_sum(block: Block, a: str, b: str) -> Pair:
    """a + b without error."""
    high = block.add(a, b)
    part = block.sub(high, a)
    return Pair(high, block.add(block.sub(a, block.sub(high, part)), block.sub(b, part)))


def exact_product(block: Block, a: str, b: str) -> Pair:
    """a b without error, if that error is in the range of the doubles."""
    high = block.mul(a, b)
    return Pair(high, block.fma(a, b, block.neg(high)))


def product(block: Block, a: Pair, b: Pair) -> Pair:
    """a b to about 2^-103."""
    high, low = exact_product(block, a.high, b.high)
    return Pair(high, block.fma(a.high, b.low, block.fma(a.low, b.high, low)))


def quotient(block: Block, a: Pair, b: Pair) -> Pair:
    """a/b to about 2^-100: the high part is within 2 ulp, the low part makes good what it misses."""
    inverse = block.div(block.constant(1.0), b.high)
    high = block.mul(a.high, inverse)
    minus = block.neg(high)
    rest = block.fma(minus, b.low, block.add(block.fma(minus, b.high, a.high), a.low))
    return Pair(high, block.mul(rest, inverse))


def root(block: Block, a: Pair) -> Pair:
    """√a to about 2^-100, for a >= 0; NaN below."""
    high = block.intrinsic("sqrt", a.high)
    rest = block.add(block.fma(block.neg(high), high, a.high), a.low)
    # 0 has the rest 0, of which nothing may make a NaN
    divisor = block.select(block.compare("oeq", high, block.constant(0.0)), block.constant(1.0), high)
    return Pair(high, block.div(block.mul(rest, block.constant(0.5)), divisor))


def scaled(block: Block, a: Pair, factor: str) -> Pair:
    """A pair times a power of 2."""
    return Pair(block.mul(a.high, factor), block.mul(a.low, factor))


def select(block: Block, condition: str, yes: Pair, no: Pair) -> Pair:
    """A pair where the mask holds, else another."""
    return Pair(block.select(condition, yes.high, no.high), block.select(condition, yes.low, no.low))


def constant(block: Block, parts: Sequence[float]) -> Pair:
    """The pair of two numbers, or of one and 0."""
    high, low = (*parts, 0.0)[:2]
    return Pair(block.constant(high), block.constant(low))
