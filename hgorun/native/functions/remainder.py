"""fmod."""

from __future__ import annotations

import math

from hgorun.native.functions.arithmetic import ROUND, mask
from hgorun.native.ir import Function

_STRIDE = 2.0**50


def fmod(f: Function, x: str, y: str) -> str:
    """The remainder of x/y with the sign of x, exact.

    It is that of |x| by the multiples 2^(50 i) |y|, from the largest one below |x| down to |y| itself. Each
    quotient is below 2^51, so that an fma makes the remainder without error. A lane that is done waits for the
    others unchanged; the usual one goes through the loop downwards once.
    """
    zero, one, infinity = f.constant(0.0), f.constant(1.0), f.constant(math.inf)
    a, b = f.intrinsic("fabs", x), f.intrinsic("fabs", y)
    # nothing to divide where the answer is x or NaN
    defined = mask(f, "and", f.compare("olt", a, infinity), f.compare("ogt", b, zero))
    divides = mask(f, "and", defined, f.compare("oge", a, b))
    rest, divisor = f.slot(f.real), f.slot(f.real)
    f.store(f.select(divides, a, zero), rest, f.real)
    b = f.select(divides, b, one)
    f.store(b, divisor, f.real)
    with f.loop() as after:
        c = f.load(divisor, f.real)
        far = f.compare("oge", f.div(f.load(rest, f.real), c), f.constant(_STRIDE))
        f.leave_if(f.let(f"xor i1 {f.any(far)}, true"), after)
        f.store(f.select(far, f.mul(c, f.constant(_STRIDE)), c), divisor, f.real)
    with f.loop() as after:
        r, c = f.load(rest, f.real), f.load(divisor, f.real)
        q = f.sub(f.add(f.div(r, c), f.constant(ROUND)), f.constant(ROUND))
        r = f.fma(f.neg(q), c, r)
        # the nearest quotient may be one too many
        r = f.select(f.compare("olt", r, zero), f.add(r, c), r)
        f.store(r, rest, f.real)
        above = f.compare("ogt", c, b)
        f.leave_if(f.let(f"xor i1 {f.any(above)}, true"), after)
        f.store(f.select(above, f.mul(c, f.constant(1 / _STRIDE)), c), divisor, f.real)
    found = f.select(divides, f.load(rest, f.real), a)
    found = f.select(defined, found, f.constant(math.nan))
    found = f.select(f.compare("uno", x, y), f.constant(math.nan), found)
    return f.intrinsic("copysign", found, x)
