"""The operations of CasADi in LLVM IR, and where the instructions of a function go."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import casadi as ca

from hgorun.errors import HgorunError
from hgorun.native import functions
from hgorun.native.ir import Block, Function
from hgorun.symbolic.instructions import CLOCK, MAIN, SETUP, Instruction
from hgorun.symbolic.interpreter import CALLS

_TOGETHER = 4  # calls of one function in one vector; 8 gained nothing with AVX-512

_BINARY: dict[int, Callable[[Block, str, str], str]] = {
    ca.OP_ADD: Block.add,
    ca.OP_SUB: Block.sub,
    ca.OP_MUL: Block.mul,
    ca.OP_DIV: Block.div,
    # of two that are not ordered the second, as the processor's own minimum and maximum
    ca.OP_FMIN: lambda b, x, y: b.select(b.compare("olt", x, y), x, y),
    ca.OP_FMAX: lambda b, x, y: b.select(b.compare("ogt", x, y), x, y),
    ca.OP_LT: lambda b, x, y: _truth(b, b.compare("olt", x, y)),
    ca.OP_LE: lambda b, x, y: _truth(b, b.compare("ole", x, y)),
    ca.OP_EQ: lambda b, x, y: _truth(b, b.compare("oeq", x, y)),
    ca.OP_NE: lambda b, x, y: _truth(b, b.compare("une", x, y)),
    ca.OP_AND: lambda b, x, y: _truth(b, b.let(f"and {b.mask} {_holds(b, x)}, {_holds(b, y)}")),
    ca.OP_OR: lambda b, x, y: _truth(b, b.let(f"or {b.mask} {_holds(b, x)}, {_holds(b, y)}")),
    ca.OP_IF_ELSE_ZERO: lambda b, x, y: b.select(_holds(b, x), y, b.constant(0.0)),
    ca.OP_COPYSIGN: lambda b, x, y: b.intrinsic("copysign", x, y),
}

_UNARY: dict[int, Callable[[Block, str], str]] = {
    ca.OP_ASSIGN: lambda b, x: x,
    ca.OP_NEG: Block.neg,
    ca.OP_SQ: lambda b, x: b.mul(x, x),
    ca.OP_TWICE: lambda b, x: b.add(x, x),
    ca.OP_INV: lambda b, x: b.div(b.constant(1.0), x),
    ca.OP_FABS: lambda b, x: b.intrinsic("fabs", x),
    ca.OP_SQRT: lambda b, x: b.intrinsic("sqrt", x),
    ca.OP_FLOOR: lambda b, x: b.intrinsic("floor", x),
    ca.OP_CEIL: lambda b, x: b.intrinsic("ceil", x),
    ca.OP_NOT: lambda b, x: _truth(b, b.compare("oeq", x, b.constant(0.0))),
    ca.OP_SIGN: lambda b, x: b.select(
        b.compare("ogt", x, b.constant(0.0)),
        b.constant(1.0),
        b.select(b.compare("olt", x, b.constant(0.0)), b.constant(-1.0), x),
    ),
}


def _truth(b: Block, mask: str) -> str:
    return b.select(mask, b.constant(1.0), b.constant(0.0))


def _holds(b: Block, value: str) -> str:
    return b.compare("une", value, b.constant(0.0))


def together(f: Function, calls: Sequence[Instruction], use: Callable[[int], str]) -> Iterator[tuple[Instruction, str]]:
    """Calls that do not wait for each other, with their values: on one lane those of one function side by side."""
    size = _TOGETHER if f.lanes == 1 else 1
    for name in {CALLS[call.op]: None for call in calls}:
        alike = [call for call in calls if CALLS[call.op] == name]
        for i in range(0, len(alike), size):
            some = alike[i : i + size]
            arguments = [[use(a) for a in call.arguments] for call in some]
            yield from zip(some, f.side_by_side(partial(functions.call, name), arguments), strict=True)


def operation(f: Function, op: int, names: Sequence[str]) -> str:
    """The value of an operation that is no call."""
    if op in _BINARY:
        return _BINARY[op](f, names[0], names[1])
    if op in _UNARY:
        return _UNARY[op](f, names[0])
    raise HgorunError(
        f"CasADi operation {op} has no native code; abs, sign, sqrt, floor, ceil, fmin, fmax, pow, exp, log, "
        "sin, cos, tan, their inverses, hyperbolic functions and if_else are available"
    )


class Emitter:
    """Walks the instruction list once, appending each instruction to the part that it belongs to."""

    def __init__(self, name: str, lanes: int, declarations: set[str], *, inlined: bool, timed: bool) -> None:
        inline = f"{'alwaysinline' if inlined else 'noinline'} nounwind"
        clock = inline if lanes == 1 else "noinline nounwind"  # it is there twice, and rarely runs
        pointers = "ptr noalias %p, ptr noalias %c"
        self.parts = [
            Function(f"{name}_setup", pointers, lanes, declarations, attributes=inline),
            Function(
                f"{name}_clock",
                f"{f'<{lanes} x double>' if timed else 'double'} %t, {pointers}, ptr noalias %tau",
                lanes,
                declarations,
                attributes=clock,
            ),
            Function(
                name,
                f"{pointers}, ptr noalias %tau, ptr noalias %z, ptr noalias %w, ptr noalias %d",
                lanes,
                declarations,
                attributes=inline,
            ),
        ]
        self.name, self.lanes, self.declarations, self.timed = name, lanes, declarations, timed
        self.sizes = [0, 0]  # numbers in c and in tau
        self.level: dict[int, int] = {}  # value -> the part that computes it
        self.names: list[dict[int, str]] = [{}, {}, {}]  # per part: value -> its name there
        self.passed: dict[int, int] = {}  # value -> its place in c or tau
        self.parameters: dict[int, int] = {}  # value -> its index in p
        self.numbers: dict[int, float] = {}  # value -> itself, of constants

    def _address(self, part: int, array: str, index: int) -> str:
        return self.parts[part].at(array, index * self.lanes)

    def _load(self, part: int, array: str, index: int) -> str:
        f = self.parts[part]
        return f.load(self._address(part, array, index), f.real)

    def define(self, value: int, part: int, name: str) -> None:
        self.level[value] = part
        self.names[part][value] = name

    def use(self, value: int, part: int) -> str:
        """The name of a value inside a part, passed on through c or tau where an earlier part made it."""
        known = self.names[part]
        if value not in known:
            source = self.level[value]
            if value in self.parameters:
                known[value] = self._load(part, "%p", self.parameters[value])
            else:
                array = ("%c", "%tau")[source]
                if value not in self.passed:
                    self.passed[value] = self.sizes[source]
                    self.sizes[source] += 1
                    maker = self.parts[source]
                    maker.store(
                        self.names[source][value],
                        self._address(source, array, self.passed[value]),
                        maker.real,
                    )
                known[value] = self._load(part, array, self.passed[value])
        return known[value]

    def constant(self, value: int, number: float) -> None:
        self.level[value] = SETUP
        self.numbers[value] = number
        for names, part in zip(self.names, self.parts, strict=True):
            names[value] = part.constant(number)

    def input(self, value: int, argument: int, index: int) -> None:
        if argument == 0:
            self.define(value, CLOCK, "%t" if self.timed else self.parts[CLOCK].splat("%t"))
        elif argument == 1:
            self.level[value] = SETUP
            self.parameters[value] = index
        else:
            self.define(value, MAIN, self._load(MAIN, "%z" if argument == 2 else "%w", index))

    def operation(self, value: int, op: int, arguments: Sequence[int]) -> None:
        part = max((self.level[a] for a in arguments), default=SETUP)
        f = self.parts[part]
        self.define(value, part, operation(f, op, [self.use(a, part) for a in arguments]))

    def calls(self, calls: Sequence[Instruction]) -> None:
        """Calls in one part that do not wait for each other: those of one function side by side."""
        part = max(self.level[a] for a in calls[0].arguments)
        for call, value in together(self.parts[part], calls, lambda a: self.use(a, part)):
            self.define(call.value, part, value)

    def output(self, value: int, index: int) -> None:
        main = self.parts[MAIN]
        main.store(self.use(value, MAIN), main.at("%d", index * self.lanes), main.real)
