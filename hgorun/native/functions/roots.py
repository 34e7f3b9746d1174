"""The cube root of numbers that are not negative."""

from __future__ import annotations

import math

from hgorun.native.functions.arithmetic import integer, polynomial
from hgorun.native.functions.coefficients import ROOT_FIRST, ROOT_SECOND
from hgorun.native.functions.shared import call
from hgorun.native.ir import Block

THIRD = 1 / 3
_START = 1364 - 0.06802150910010603  # of the exponent of x^(-1/3), the one with the least error of the first y
_CLOSE = 9e-6  # the first step leaves less of 1 - x y³ where x is a normal number


def cube_root(block: Block, x: str) -> str:
    """x^(1/3); NaN for x < 0. Below 1.5 ulp.

    Without a division: the bits of a number are nearly its logarithm, those of y = x^(-1/3) follow from them up to
    3.5 %. With h = 1 - x y³ it is x^(-1/3) = y (1 - h)^(-1/3) = y (1 + h P(h)), and then x^(1/3) = x y² (1 + h Q(h)),
    where y has been cut to 26 bits, so that its square has no rounding error.
    """
    return block.side_by_side(_cube_root, [[x]], least=2)[0]


def _cube_root(block: Block, x: str) -> str:
    """The root where :func:`_steps` is right, and that of anything elsewhere."""
    found, good = _steps(block, x)
    return block.rarely(
        block.any(block.let(f"xor {block.mask} {good}, {_all(block)}")),
        found,
        lambda: block.select(good, found, call(block, "cube_root", _any_root, x)),
    )


def _all(block: Block) -> str:
    return "true" if block.lanes == 1 else "<" + ", ".join(["i1 true"] * block.lanes) + ">"


def _steps(block: Block, x: str) -> tuple[str, str]:
    """The root of 0 and of normal numbers, and a mask of where it is right."""
    upper = integer(block, "and", integer(block, "lshr", block.bits(x), 20), 2**43 - 1)
    # the upper bits of |x| count in 2^52 + ..., and those of y come out so
    high = block.from_bits(integer(block, "or", upper, 0x4330000000000000))
    start = block.constant(2.0**52 + 2.0**52 / 3 + _START * 2.0**32)
    y = block.from_bits(integer(block, "shl", block.bits(block.fma(high, block.constant(-THIRD), start)), 20))
    one = block.constant(1.0)
    h = block.fma(block.neg(block.mul(x, y)), block.mul(y, y), one)
    y = block.fma(block.mul(y, h), polynomial(block, ROOT_FIRST, h), y)
    y = block.from_bits(integer(block, "and", block.bits(y), -(2**27)))
    xy = block.mul(x, y)
    h = block.fma(block.neg(xy), block.mul(y, y), one)
    root = block.mul(xy, y)
    rest = block.mul(root, h)
    # false for subnormal, infinite and negative x and for NaN; 0 <= 0 for 0
    good = block.compare("ole", block.intrinsic("fabs", rest), block.mul(root, block.constant(_CLOSE)))
    return block.fma(xy, y, block.mul(rest, polynomial(block, ROOT_SECOND, h))), good


def _any_root(block: Block, x: str) -> str:
    """The root of anything, subnormal numbers scaled up."""
    tiny = block.compare("olt", x, block.constant(2.0**-1000))
    up, down = (block.select(tiny, block.constant(a), block.constant(1.0)) for a in (2.0**54, 2.0**-18))
    found = block.mul(_steps(block, block.mul(x, up))[0], down)
    found = block.select(block.compare("olt", x, block.constant(0.0)), block.constant(math.nan), found)
    return block.select(block.compare("olt", x, block.constant(math.inf)), found, x)
