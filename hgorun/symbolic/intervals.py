"""Interval arithmetic over CasADi's expressions: where a function's values must lie, for all arguments in a box.

An operation that is not known gives the whole line, so that what comes out is never too narrow.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from hgorun.symbolic.instructions import Instruction, read
from hgorun.symbolic.interval_operations import LIBRARY, Bounds

_WHOLE_LINE = np.array(-np.inf), np.array(np.inf)


def enclose(
    function: ca.Function,
    argument: Callable[[int, int], Bounds],
    *,
    instructions: Sequence[Instruction] | None = None,
) -> list[list[Bounds]]:
    """Bounds of all entries of all outputs of a function of dense vectors.

    Parameters
    ----------
    function : casadi.Function
        Made of SX.
    argument : callable
        Bounds of an entry of an argument, from the numbers of both. Their shapes are broadcast: what is the same
        in all boxes can be a single number.
    instructions : sequence of Instruction, optional
        Those of the function, where they have been read before.
    """
    values: dict[int, Bounds] = {}
    steps = read(function) if instructions is None else instructions
    last = {value: i for i in steps for value in i.arguments}  # who needs a value for the last time
    zero = np.array(0.0)
    found: list[list[Bounds]] = [[(zero, zero)] * function.numel_out(i) for i in range(function.n_out())]
    with np.errstate(all="ignore"):
        for i in steps:
            if i.op == ca.OP_OUTPUT:
                found[i.place[0]][i.place[1]] = values[i.arguments[0]]
            elif i.op == ca.OP_INPUT:
                values[i.value] = argument(*i.place)
            elif i.op == ca.OP_CONST:
                values[i.value] = (np.array(i.number),) * 2
            else:
                operation = LIBRARY.get(i.op)
                values[i.value] = operation(*[values[a] for a in i.arguments]) if operation else _WHOLE_LINE
            for value in set(i.arguments):
                if last[value] is i:  # its memory is used again while it is in the processor's
                    del values[value]
    return found
