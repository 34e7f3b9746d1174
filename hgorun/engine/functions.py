"""sin, cos, exp, tanh and log as branch-free LLVM IR on W lanes.

Special cases are selects or fall out of the arithmetic: every lane runs the same instructions, and an fma
stands only where one is written. A result therefore has the same bits in each lane and for each W (but for
the payload of a NaN).

The bounds in the docstrings are on the distance to the true value in units of its last place (ulp), measured
on some 10⁸ points per function. The polynomials are fitted by tools/fit_functions.py, which prints the
coefficients and their errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from hgorun.engine.ir import Block

# degree 7 on [0.00000, 2.49214], relative error 2^-61.5
SINE = (
    -0.16666666666666666,
    0.008333333333333191,
    -0.00019841269841207361,
    2.7557319210744582e-06,
    -2.505210683185592e-08,
    1.6058937451742549e-10,
    -7.642928669344119e-13,
    2.720476662807398e-15,
)
# degree 9 on [-0.34831, 0.34831], relative error 2^-57.9
EXP = (
    0.5000000000000011,
    0.166666666666664,
    0.04166666666652513,
    0.008333333333501261,
    0.0013888888945161797,
    0.00019841269495723696,
    2.4801491330483665e-05,
    2.7557592503469626e-06,
    2.7630935026292426e-07,
    2.4999266139047215e-08,
)
# degree 5 on [0.00000, 0.06824], relative error 2^-62.1
COTH = (
    0.33333333333333315,
    -0.022222222222169706,
    0.002116402111441502,
    -0.00021163999620341773,
    2.1373065702768614e-05,
    -2.1131308019428946e-06,
)
# degree 6 on [0.00000, 0.02944], relative error 2^-59.5
LOG = (
    0.6666666666666734,
    0.3999999999941709,
    0.2857142874187486,
    0.22222198624124348,
    0.18183561746558274,
    0.1531411509436047,
    0.14795316682886162,
)

# π and log 2 as sums of doubles, each the rounded rest: an fma needs no low bits cleared for an exact product
PI = (3.141592653589793, 1.2246467991473532e-16, -2.9947698097183397e-33)
LN2 = (0.6931471805599453, 2.3190468138462996e-17)
# 1.5·2^52 + y for |y| < 2^51 is rounded to an integer, whose low bits are those of the sum; in 1.5·2^44 + y
# clearing the last 8 bits rounds down
ROUND = 1.5 * 2.0**52
ROUND_8 = 1.5 * 2.0**44
# above it the quotient of sin or cos would leave the range of these
PERIODIC_LIMIT = 2.0**43


def _integer(block: Block, operation: str, a: str, b: str | int) -> str:
    """An instruction on 64-bit integers."""
    other = block.integer_constant(b) if isinstance(b, int) else b
    return block.let(f"{operation} {block.integer} {a}, {other}")


def _polynomial(block: Block, coefficients: Sequence[float], x: str) -> str:
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


def _signed_sine(block: Block, a: str, q: str, sign: str) -> str:
    """sin(a - q π), its sign flipped by the sign bit of an integer; NaN for a > PERIODIC_LIMIT.

    The first fma is exact for a >= 2: a and q times the first part of π are multiples of 2^-51 and their
    difference is below 2. Below that it is, too, or its rounding is no more than that of the second.
    """
    first, second, third = PI
    in_range = block.compare("ole", a, block.constant(PERIODIC_LIMIT))
    third_or_nan = block.select(in_range, block.constant(-third), block.constant(math.nan))
    r = block.fma(q, block.constant(-first), a)
    r = block.fma(q, block.constant(-second), r)
    # the third part counts only in a tiny r, whose square does not count
    z = block.mul(r, r)
    r = block.fma(q, third_or_nan, r)
    # r + r·(z P(z)) rounds z P less than r + (r z)·P rounds the two factors
    rest = block.mul(block.mul(z, z), _polynomial(block, SINE[1:], z))
    sine = block.fma(r, block.fma(z, block.constant(SINE[0]), rest), r)
    return block.from_bits(_integer(block, "xor", block.bits(sine), sign))


def sin(block: Block, x: str) -> str:
    """sin x = ±sin r with r = |x| - q π, q = rint(|x|/π) (Cody and Waite).

    sin r = r + r³ P(r²), P of degree 7 on |r| <= 1.005 π/2. Below 1.7 ulp for |x| <= 2^43 = 8.8e12, never
    above 1; NaN beyond, where libm still reduces but neighbouring doubles are 2e-3 apart.
    """
    a = block.intrinsic("fabs", x)
    t = block.fma(a, block.constant(1 / math.pi), block.constant(ROUND))
    q = block.sub(t, block.constant(ROUND))
    odd = _integer(block, "shl", block.bits(t), 63)
    sign = _integer(block, "xor", odd, _integer(block, "and", block.bits(x), -(2**63)))
    return _signed_sine(block, a, q, sign)


def cos(block: Block, x: str) -> str:
    """cos x = ±sin r with r = |x| - q π, q = k + 1/2, k = floor(|x|/π).

    The sine and its range are those of :func:`sin`. Below 1.7 ulp, never above 1.
    """
    a = block.intrinsic("fabs", x)
    # the last 8 bits are rounded: k may be one more where |x|/π is within 1/512 below an integer. The 1 makes
    # an odd k even: cos((k + 1/2) π + r) = -(-1)^k sin r
    t = block.fma(a, block.constant(1 / math.pi), block.constant(ROUND_8 + 1))
    k = _integer(block, "and", block.bits(t), -(2**8))
    q = block.sub(block.from_bits(k), block.constant(ROUND_8 + 1 - 0.5))
    return _signed_sine(block, a, q, _integer(block, "shl", k, 63 - 8))


def exp(block: Block, x: str) -> str:
    """exp x = 2^n exp r with r = x - n log 2, n = rint(x/log 2).

    exp r = 1 + r + r² P(r), P of degree 9 on |r| <= 1.005 log(2)/2. Below 1.1 ulp, and a subnormal result
    within its last place. 2^n is applied as two factors, neither of which can overflow.
    """
    # beyond these ends the result is 0 or infinite; a NaN fails both comparisons and stays
    low, high = block.constant(-746.0), block.constant(710.0)
    x = block.select(block.compare("olt", x, low), low, x)
    x = block.select(block.compare("ogt", x, high), high, x)
    # 2046 is twice the bias of the exponent: n + 2046 splits into the exponent fields of the two factors
    magic = block.constant(ROUND + 2046)
    t = block.fma(x, block.constant(1 / math.log(2)), magic)
    n = block.sub(t, magic)
    r = block.fma(n, block.constant(-LN2[0]), x)
    r = block.fma(n, block.constant(-LN2[1]), r)
    both = block.bits(t)
    half = _integer(block, "lshr", both, 1)
    first = block.from_bits(_integer(block, "shl", half, 52))
    second = block.from_bits(_integer(block, "shl", _integer(block, "sub", both, half), 52))
    p = block.fma(block.mul(r, r), _polynomial(block, EXP, r), r)
    # the fma rounds like 1 + p, first being a power of 2 and far from both ends
    return block.mul(block.fma(p, first, first), second)


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
    biased = _integer(block, "and", block.bits(t), -(2**8))
    s = block.from_bits(_integer(block, "shl", biased, 52 - 8))
    n = block.sub(block.from_bits(biased), block.constant(ROUND_8 + 1023))
    # one part of log 2 is enough: what n times the next adds to r, the slope of tanh takes away
    r = block.fma(n, block.constant(-LN2[0] / 2), a)
    z = block.mul(r, r)
    one, half = block.constant(1.0), block.constant(0.5)
    c = block.fma(z, _polynomial(block, COTH, z), one)
    less, more = block.fma(s, half, block.constant(-0.5)), block.fma(s, half, half)
    numerator = block.fma(less, c, block.mul(more, r))
    # built on the numerator, the denominator shares its rounding error, which drops out of a ratio near 1;
    # for n = 0 the r would cancel with a loss, and m = 0 leaves c alone
    m = block.select(block.compare("olt", n, one), n, one)
    denominator = block.fma(m, numerator, block.fma(block.neg(m), r, c))
    return block.intrinsic("copysign", block.div(numerator, denominator), x)


def log(block: Block, x: str) -> str:
    """log x = k log 2 + log(1 + f) with x = 2^k (1 + f), √½ <= 1 + f < √2.

    log(1 + f) = f - (f²/2 - s (f²/2 + w P(w))), s = f/(2 + f), w = s², P of degree 6 on w <= (3 - √8)²: the
    rounded terms are small against f. Below 0.9 ulp.
    """
    zero = block.constant(0.0)
    subnormal = block.compare("olt", x, block.constant(2.0**-1022))
    # k comes as a double less an offset; an infinite or NaN offset makes the result so:
    # +inf for 0, NaN below, and -x for inf and NaN
    bias = 2.0**52 + 1023
    at_zero = block.select(block.compare("olt", x, zero), block.constant(math.nan), block.constant(math.inf))
    low = block.select(block.compare("ogt", x, zero), block.constant(bias + 54), at_zero)
    finite = block.compare("olt", x, block.constant(math.inf))
    offset = block.select(subnormal, low, block.select(finite, block.constant(bias), block.neg(x)))
    x = block.select(subnormal, block.mul(x, block.constant(2.0**54)), x)
    # from √2 on, adding the bits of 1 less those of √½ carries into the exponent
    one, root = 0x3FF0000000000000, 0x3FE6A09E667F3BCD
    shifted = _integer(block, "add", block.bits(x), one - root)
    exponent = _integer(block, "lshr", shifted, 52)
    # in the low bits of 2^52 the exponent reads as a double
    k = block.sub(block.from_bits(_integer(block, "or", exponent, 0x4330000000000000)), offset)
    m = block.from_bits(_integer(block, "add", _integer(block, "and", shifted, 2**52 - 1), root))
    f = block.sub(m, block.constant(1.0))
    s = block.div(f, block.add(f, block.constant(2.0)))
    w = block.mul(s, s)
    half_square = block.mul(block.mul(f, f), block.constant(0.5))
    series = block.fma(w, _polynomial(block, LOG, w), half_square)
    rest = block.fma(s, series, block.mul(k, block.constant(LN2[1])))
    return block.fma(k, block.constant(LN2[0]), block.sub(f, block.sub(half_square, rest)))


Emit = Callable[[Block, str], str]
INLINE: dict[str, Emit] = {"sin": sin, "cos": cos, "exp": exp, "tanh": tanh, "log": log}


def function_definition(name: str, lanes: int, declarations: set[str]) -> str:
    """The IR of ``@hgorun_<name>`` on W lanes; the name is the same for every W."""
    block = Block(lanes, declarations)
    result = INLINE[name](block, "%x")
    signature = f"{block.real} @hgorun_{name}({block.real} %x)"
    return "\n".join(
        [
            f"define internal {signature} alwaysinline nounwind memory(none) {{",
            *block.lines,
            f"  ret {block.real} {result}",
            "}",
        ]
    )
