"""CasADi's instruction list in single-assignment form, and the order in which it is emitted.

An instruction belongs to the part that its arguments allow: SETUP for what depends on the parameters alone,
CLOCK for what depends on time, too, MAIN for the rest.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import casadi as ca

SETUP, CLOCK, MAIN = 0, 1, 2
_PART_OF_INPUT = (CLOCK, SETUP, MAIN, MAIN)  # t, p, z, w


@dataclass(frozen=True, eq=False, repr=False)
class Instruction:
    """One of CasADi's, in single-assignment form.

    Attributes
    ----------
    value : int
        The value that it makes, its number.
    op : int
    arguments : tuple of int
        The values that it needs.
    place : (int, int)
        Of an input or output: which vector, and which entry.
    number : float
        Of a constant.
    """

    value: int
    op: int
    arguments: tuple[int, ...]
    place: tuple[int, int] = (0, 0)
    number: float = 0.0


def read(function: ca.Function) -> list[Instruction]:
    """The instructions of an SX function, in CasADi's order."""
    found = []
    slots: dict[int, int] = {}  # CasADi's work vector -> value
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        inputs, outputs = function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_CONST:
            found.append(Instruction(k, op, (), number=function.instruction_constant(k)))
        elif op == ca.OP_INPUT:
            found.append(Instruction(k, op, (), (inputs[0], inputs[1])))
        elif op == ca.OP_OUTPUT:
            found.append(Instruction(k, op, (slots[inputs[0]],), (outputs[0], outputs[1])))
            continue
        else:
            found.append(Instruction(k, op, tuple(slots[i] for i in inputs)))
        slots[outputs[0]] = k
    return found


def calls_of_state(function: ca.Function, calls: Container[int]) -> int:
    """How many of the operations that take long depend on more than time and parameters."""
    if not any(function.instruction_id(k) in calls for k in range(function.n_instructions())):
        return 0
    instructions = read(function)
    part = _parts(instructions)
    return sum(i.op in calls and part[i.value] == MAIN for i in instructions)


def _parts(instructions: Sequence[Instruction]) -> dict[int, int]:
    """The part of each value."""
    part: dict[int, int] = {}
    for i in instructions:
        if i.op == ca.OP_INPUT:
            part[i.value] = _PART_OF_INPUT[i.place[0]]
        elif i.op == ca.OP_OUTPUT:
            part[i.value] = MAIN
        else:
            part[i.value] = max((part[a] for a in i.arguments), default=SETUP)
    return part


def rounds(instructions: Sequence[Instruction], calls: Container[int]) -> Iterator[list[Instruction]]:
    """The instructions in an order that brings calls together which do not wait for each other.

    Each part has its rounds: first what needs no call of the part, then the calls that need no other, then
    what needs those, and so on. Within a round the order is CasADi's; a round has either calls only or none.

    Parameters
    ----------
    instructions : sequence of Instruction
        In an order in which they can be computed.
    calls : container of int
        The operations that take long.
    """
    part = _parts(instructions)
    depth: dict[int, int] = {}
    for i in instructions:
        before = [depth[a] for a in i.arguments if part[a] == part[i.value]]
        depth[i.value] = max(before, default=0) + (i.op in calls)

    def rank(i: Instruction) -> tuple[int, int, bool]:
        call = i.op in calls
        return part[i.value], depth[i.value] - call, call

    for _, alike in groupby(sorted(instructions, key=rank), key=rank):
        yield list(alike)
