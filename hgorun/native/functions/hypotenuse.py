"""hypot."""

from __future__ import annotations

import math

from hgorun.native.functions.arithmetic import Pair, exact_product, mask, ordered_sum, root
from hgorun.native.ir import Block


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
