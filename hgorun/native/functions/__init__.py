"""The elementary functions as LLVM IR on W lanes.

Special cases are selects or fall out of the arithmetic: every lane runs the same instructions, and an fma
stands only where one is written. A result therefore has the same bits in each lane, for each W and on each
processor (but for the payload of a NaN). Only where a processor has no fma, a C library computes it, exactly.

The bounds in the docstrings are on the distance to the true value in units of its last place (ulp), measured
on 10⁷ to 10⁸ points per function. The polynomials are fitted by tools/fit_functions.py.

sin, cos, exp, tanh and log, which models of plants are full of, are written where they are called; the others
are functions of the module, written once.
"""

from __future__ import annotations

from collections.abc import Callable

from hgorun.native.functions import exponential, inverse, logarithmic, power, remainder, shared, trigonometric
from hgorun.native.ir import Block

INLINE: dict[str, Callable[[Block, str], str]] = {
    "sin": trigonometric.sin,
    "cos": trigonometric.cos,
    "exp": exponential.exp,
    "tanh": exponential.tanh,
    "log": logarithmic.log,
}
UNARY: dict[str, shared.Emit] = {
    "tan": trigonometric.tan,
    "asin": inverse.asin,
    "acos": inverse.acos,
    "atan": inverse.atan,
    "sinh": exponential.sinh,
    "cosh": exponential.cosh,
    "expm1": exponential.expm1,
    "asinh": logarithmic.asinh,
    "acosh": logarithmic.acosh,
    "atanh": logarithmic.atanh,
    "log1p": logarithmic.log1p,
}
BINARY: dict[str, shared.Emit] = {
    "atan2": inverse.atan2,
    "pow": power.pow,
    "hypot": power.hypot,
    "fmod": remainder.fmod,
}


def call(name: str, block: Block, *arguments: str) -> str:
    """The value of a function."""
    if name in INLINE:
        return INLINE[name](block, *arguments)
    return shared.call(block, name, (UNARY | BINARY)[name], *arguments)
