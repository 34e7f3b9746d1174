"""sin, cos, exp, tanh and log as branch-free LLVM IR on W lanes.

Every special case is a select or falls out of the arithmetic, so all lanes run the same instructions; fma
stands only where written. A result has therefore the same bits in each lane and for each W (the payload of
a NaN excepted).

The bounds below are on the distance to the true value in units of its last place (ulp). They were measured
on some 10⁷ points per function; the polynomials are fitted by tools/fit_functions.py, which prints them and
their errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from hgorun.engine.ir import Block

SINE = (
    -0.16666666666666666,
    0.008333333333333175,
    -0.00019841269841202317,
    2.7557319209951344e-06,
    -2.5052106764331068e-08,
    1.6058934276233367e-10,
    -7.642851137428827e-13,
    2.7197098809735693e-15,
)
EXP = (
    0.5000000000000011,
    0.166666666666664,
    0.041666666666525125,
    0.008333333333501221,
    0.0013888888945164238,
    0.00019841269495844696,
    2.4801491327654067e-05,
    2.755759238286231e-06,
    2.763093609748753e-07,
    2.4999305750544713e-08,
)
COTH = (
    0.33333333333333315,
    -0.022222222222169703,
    0.002116402111441099,
    -0.000211639996186843,
    2.137306541493355e-05,
    -2.113129016940069e-06,
)
LOG = (
    0.6666666666666734,
    0.3999999999941698,
    0.2857142874191104,
    0.22222198619719408,
    0.18183561999826614,
    0.15314108161136025,
    0.14795389468278491,
)

# π and log 2 as sums of doubles, each the rest rounded: the products of an fma are exact, no bits need be cleared
PI = (3.141592653589793, 1.2246467991473532e-16, -2.9947698097183397e-33)
LN2 = (0.6931471805599453, 2.3190468138462996e-17)
# 1.5·2^52 added to |y| < 2^51 rounds y to an integer, which the low bits of the sum hold in two's complement;
# 1.5·2^44 rounds to a multiple of 2^-8, and clearing the last 8 bits of the sum then rounds down
ROUND = 1.5 * 2.0**52
ROUND_8 = 1.5 * 2.0**44
SINE_LIMIT = 2.0**43
SIGN = -(2**63)


def _integer(block: Block, operation: str, a: str, b: str | int) -> str:
    """An instruction on 64-bit integers."""
    other = block.integer_constant(b) if isinstance(b, int) else b
    return block.let(f"{operation} {block.integer} {a}, {other}")


def _polynomial(block: Block, coefficients: Sequence[float], x: str) -> str:
    """Σ coefficients[i] xⁱ by Estrin's scheme: neighbours pair up, then the pairs as polynomials in x².

    A few multiplications more than Horner's scheme, and a third of its latency.
    """
    terms = [block.constant(c) for c in coefficients]
    while True:
        pairs = [block.fma(high, x, low) for low, high in zip(terms[::2], terms[1::2], strict=False)]
        terms = pairs + terms[2 * len(pairs) :]
        if len(terms) == 1:
            return terms[0]
        x = block.mul(x, x)


def _sine_reduced(block: Block, a: str, q: str, sign: str) -> str:
    """±sin(a - q π), the sign bit given as an integer; NaN for a beyond SINE_LIMIT.

    With hi the first part of π, a and q hi are multiples of 2^-51 (2^-52 for a < 2) and their difference is
    below 2: the first fma is exact. The next two each round a difference as small as the result.
    """
    high, middle, low = PI
    # q has left the integers that the sum in ROUND holds, or will: no digit would be right
    last = block.select(
        block.compare("ole", a, block.constant(SINE_LIMIT)), block.constant(-low), block.constant(math.nan)
    )
    r = block.fma(q, block.constant(-high), a)
    r = block.fma(q, block.constant(-middle), r)
    # the last part tells only where r is tiny, and there z does not matter
    z = block.mul(r, r)
    r = block.fma(q, last, r)
    rest = block.mul(block.mul(z, z), _polynomial(block, SINE[1:], z))
    sine = block.fma(r, block.fma(z, block.constant(SINE[0]), rest), r)
    return block.from_bits(_integer(block, "xor", block.bits(sine), sign))


def sin(block: Block, x: str) -> str:
    a = block.intrinsic("fabs", x)
    t = block.fma(a, block.constant(1 / math.pi), block.constant(ROUND))
    q = block.sub(t, block.constant(ROUND))
    odd = _integer(block, "shl", block.bits(t), 63)
    sign = _integer(block, "xor", odd, _integer(block, "and", block.bits(x), SIGN))
    return _sine_reduced(block, a, q, sign)


def cos(block: Block, x: str) -> str:
    a = block.intrinsic("fabs", x)
    # the 1 turns even into odd: cos((k + 1/2) π + r) = -(-1)^k sin r
    t = block.fma(a, block.constant(1 / math.pi), block.constant(ROUND_8 + 1))
    k = _integer(block, "and", block.bits(t), -(2**8))
    q = block.sub(block.from_bits(k), block.constant(ROUND_8 + 1 - 0.5))
    return _sine_reduced(block, a, q, _integer(block, "shl", k, 63 - 8))


def exp(block: Block, x: str) -> str:
    # a NaN fails both comparisons and stays; beyond these ends the result is 0 or infinite anyway
    low, high = block.constant(-746.0), block.constant(710.0)
    x = block.select(block.compare("olt", x, low), low, x)
    x = block.select(block.compare("ogt", x, high), high, x)
    # 2046 = twice the bias of the exponent: the halves of n + 2046 are the exponent fields of the two factors
    magic = block.constant(ROUND + 2046)
    t = block.fma(x, block.constant(1 / math.log(2)), magic)
    n = block.sub(t, magic)
    r = block.fma(n, block.constant(-LN2[0]), x)
    r = block.fma(n, block.constant(-LN2[1]), r)
    whole = block.bits(t)
    half = _integer(block, "lshr", whole, 1)
    first = block.from_bits(_integer(block, "shl", half, 52))
    second = block.from_bits(_integer(block, "shl", _integer(block, "sub", whole, half), 52))
    p = block.fma(block.mul(r, r), _polynomial(block, EXP, r), r)
    # first is a power of 2 far from the ends: this rounds as 1 + p
    return block.mul(block.fma(p, first, first), second)


def tanh(block: Block, x: str) -> str:
    a = block.intrinsic("fabs", x)
    end = block.constant(20.0)
    a = block.select(block.compare("ogt", a, end), end, a)
    # the exponent's bias again, to make s of the bits
    t = block.fma(a, block.constant(2 / math.log(2)), block.constant(ROUND_8 + 1023 + 0.25))
    floor = _integer(block, "and", block.bits(t), -(2**8))
    n = block.sub(block.from_bits(floor), block.constant(ROUND_8 + 1023))
    s = block.from_bits(_integer(block, "shl", floor, 52 - 8))
    r = block.fma(n, block.constant(-LN2[0] / 2), a)
    z = block.mul(r, r)
    c = block.fma(z, _polynomial(block, COTH, z), block.constant(1.0))
    half = block.constant(0.5)
    less, more = block.fma(s, half, block.constant(-0.5)), block.fma(s, half, half)
    numerator = block.fma(less, c, block.mul(more, r))
    one = block.constant(1.0)
    m = block.select(block.compare("olt", n, one), n, one)
    denominator = block.fma(m, numerator, block.fma(block.neg(m), r, c))
    return block.intrinsic("copysign", block.div(numerator, denominator), x)


def log(block: Block, x: str) -> str:
    tiny = block.compare("olt", x, block.constant(2.0**-1022))
    positive = block.compare("ogt", x, block.constant(0.0))
    negative = block.compare("olt", x, block.constant(0.0))
    finite = block.compare("olt", x, block.constant(math.inf))
    bias = 2.0**52 + 1023
    at_zero = block.select(negative, block.constant(math.nan), block.constant(math.inf))
    below = block.select(positive, block.constant(bias + 54), at_zero)
    above = block.select(finite, block.constant(bias), block.neg(x))
    offset = block.select(tiny, below, above)
    scaled = block.select(tiny, block.mul(x, block.constant(2.0**54)), x)
    # adding (bits of 1) - (bits of √½) carries into the exponent from √2 on
    one, root = 0x3FF0000000000000, 0x3FE6A09E667F3BCD
    u = _integer(block, "add", block.bits(scaled), one - root)
    k = block.sub(
        block.from_bits(_integer(block, "or", _integer(block, "lshr", u, 52), 0x4330000000000000)), offset
    )
    m = block.from_bits(_integer(block, "add", _integer(block, "and", u, 2**52 - 1), root))
    f = block.sub(m, block.constant(1.0))
    s = block.div(f, block.add(f, block.constant(2.0)))
    w = block.mul(s, s)
    half_square = block.mul(block.mul(f, f), block.constant(0.5))
    rest = block.fma(w, _polynomial(block, LOG, w), half_square)
    correction = block.fma(s, rest, block.mul(k, block.constant(LN2[1])))
    return block.fma(k, block.constant(LN2[0]), block.sub(f, block.sub(half_square, correction)))


INLINE: dict[str, Callable[[Block, str], str]] = {"sin": sin, "cos": cos, "exp": exp, "tanh": tanh, "log": log}


def function_definition(name: str, lanes: int, declarations: set[str]) -> str:
    block = Block(lanes, declarations)
    result = INLINE[name](block, "%x")
    return "\n".join(
        [
            f"define internal {block.real} @hgorun_{name}({block.real} %x) alwaysinline nounwind memory(none) {{",
            *block.lines,
            f"  ret {block.real} {result}",
            "}",
        ]
    )
