"""Functions of time where all lanes have the same parameters: computed once, on one lane, for all of them.

Members of an ensemble often differ in what time has nothing to do with: seeds, gains, initial states. Whether
they do is found when their run begins.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from hgorun.engine.emitter import Emitter, operation, together
from hgorun.native.ir import Function
from hgorun.symbolic.instructions import CLOCK, Instruction, rounds
from hgorun.symbolic.interpreter import CALLS


def add_alike(e: Emitter, instructions: Sequence[Instruction]) -> None:
    """``<name>_clock_alike(t, p, c, tau)``, and whether it holds in the last word of c, which the set-up writes.

    The set-up's name and the numbers that it gives to the clock are those of the emitter, which has finished its own
    clock.
    """
    twin = _clock(e, instructions)
    setup = e.parts[0]
    same = "true"
    for array, index in _read_by_clock(e):
        base = setup.at(array, index * e.lanes)
        own = setup.load(base, setup.integer)
        first = setup.let(f"insertelement {setup.integer} poison, i64 {setup.load(base, 'i64')}, i64 0")
        zeros = f"<{e.lanes} x i32> zeroinitializer"
        all_first = setup.let(f"shufflevector {setup.integer} {first}, {setup.integer} poison, {zeros}")
        differs = setup.any(setup.let(f"icmp ne {setup.integer} {own}, {all_first}"))
        same = setup.let(f"and i1 {same}, {setup.let(f'xor i1 {differs}, true')}")
    setup.store(setup.let(f"zext i1 {same} to i64"), setup.at("%c", e.sizes[0] * e.lanes), "i64")
    e.sizes[0] += 1
    e.parts.append(twin)


def _read_by_clock(e: Emitter) -> list[tuple[str, int]]:
    """What the clock reads: places of parameters, and of what the set-up passes on."""
    read = [value for value in e.names[CLOCK] if e.level[value] < CLOCK]
    found = [("%p", e.parameters[value]) for value in read if value in e.parameters]
    return found + [("%c", e.passed[value]) for value in read if value in e.passed]


def _clock(e: Emitter, instructions: Sequence[Instruction]) -> Function:
    """The clock on one lane, which writes its values for all lanes."""
    arguments = "double %t, ptr noalias %p, ptr noalias %c, ptr noalias %tau"
    f = Function(f"{e.name}_clock_alike", arguments, 1, e.declarations, attributes="noinline nounwind")
    names: dict[int, str] = {}

    def use(value: int) -> str:
        if value not in names:
            if value in e.parameters:
                names[value] = f.word("%p", e.parameters[value] * e.lanes, "double")
            elif value in e.passed:
                names[value] = f.word("%c", e.passed[value] * e.lanes, "double")
            else:
                names[value] = f.constant(e.numbers[value])
        return names[value]

    for some in rounds(instructions, calls=CALLS):
        own = [i for i in some if i.op != ca.OP_OUTPUT and e.level[i.value] == CLOCK]
        if own and own[0].op in CALLS:
            names |= {call.value: value for call, value in together(f, own, use)}
            continue
        for i in own:
            names[i.value] = "%t" if i.op == ca.OP_INPUT else operation(f, i.op, [use(a) for a in i.arguments])
    for value, place in e.passed.items():
        if e.level[value] == CLOCK:
            scalar = use(value)
            with f.wide(e.lanes):
                f.store(f.splat(scalar), f.at("%tau", place * e.lanes), f.real)
    return f
