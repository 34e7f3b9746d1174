"""The elementary functions as LLVM IR on W lanes.

Special cases are selects or fall out of the arithmetic: every lane runs the same instructions, and an fma
stands only where one is written. A result therefore has the same bits in each lane, for each W and on each
processor (but for the payload of a NaN). Only where a processor has no fma, a C library computes it, exactly.

The bounds in the docstrings are on the distance to the true value in units of its last place (ulp), measured
on 10⁷ to 10⁸ points per function. The polynomials are fitted by tools/fit_functions.py.

sin, cos, exp, tanh and log, which models of plants are full of, and powers are written where they are called; the
others are functions of the module, written once.
"""

from __future__ import annotations

from importlib import import_module

from hgorun.native.functions import shared
from hgorun.native.ir import Block

# The files that they are in, which are imported for a function that is called: all of them take some 5 ms.
INLINE = {
    "sin": "trigonometric",
    "cos": "trigonometric",
    "exp": "exponential",
    "tanh": "exponential",
    "log": "logarithmic",
}
UNARY = {
    "tan": "trigonometric",
    "asin": "inverse",
    "acos": "inverse",
    "atan": "inverse",
    "sinh": "exponential",
    "cosh": "exponential",
    "expm1": "exponential",
    "asinh": "logarithmic",
    "acosh": "logarithmic",
    "atanh": "logarithmic",
    "log1p": "logarithmic",
}
BINARY = {"atan2": "inverse", "pow": "power", "hypot": "hypotenuse", "fmod": "remainder"}
_IN_PLACE = {*INLINE, "pow"}


def call(name: str, block: Block, *arguments: str) -> str:
    """The value of a function."""
    home = (INLINE | UNARY | BINARY)[name]
    emit: shared.Emit = getattr(import_module(f"hgorun.native.functions.{home}"), name)
    if name in _IN_PLACE:
        return emit(block, *arguments)
    return shared.call(block, name, emit, *arguments)
