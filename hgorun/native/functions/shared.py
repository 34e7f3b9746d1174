"""Functions of the module, written once and called."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from hgorun.native.ir import Block, Function

Emit = Callable[..., str]  # of a Function and its arguments, the name of the result


def symbol(name: str, lanes: int) -> str:
    """What a function on W lanes is called in the module."""
    return f"hgorun_{name}_{lanes}"


@cache
def definition(name: str, emit: Emit, arguments: int, lanes: int) -> frozenset[str]:
    """The IR of a function and of what it needs itself."""
    needed: set[str] = set()
    kind = Block(lanes, set()).real
    names = ("%x", "%y")[:arguments]
    signature = ", ".join(f"{kind} {name}" for name in names)
    f = Function(symbol(name, lanes), signature, lanes, needed, returns=kind, attributes="nounwind memory(none)")
    f.do(f"ret {kind} {emit(f, *names)}")
    return frozenset({*needed, f.text()})


def call(block: Block, name: str, emit: Emit, *arguments: str) -> str:
    """The value of a function, whose definition goes into the block's module."""
    block.declarations.update(definition(name, emit, len(arguments), block.lanes))
    values = ", ".join(f"{block.real} {a}" for a in arguments)
    return block.let(f"call {block.real} @{symbol(name, block.lanes)}({values})")


def each(block: Block, name: str, emit: Emit, x: str, *numbers: float) -> str:
    """The value of a function of x and constants that is called so rarely that scalars must do, lane after lane."""
    values = []
    with block.on_lanes(1) as scalar:
        constants = [scalar.constant(number) for number in numbers]
        for lane in range(block.lanes):
            one = x if block.lanes == 1 else scalar.let(f"extractelement {block.real} {x}, i64 {lane}")
            values.append(call(scalar, name, emit, one, *constants))
    return values[0] if block.lanes == 1 else block.gather(values)
