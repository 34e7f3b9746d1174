"""From a CasADi function to LLVM IR: its instruction list, on W lanes.

A function f(t, p, z, w) is split by what its parts depend on. What depends on the parameters p alone is
computed once a run (``setup``), what depends on time and parameters once a time (``clock``), the rest at
every evaluation (``main``). The operations are CasADi's, so a value has the same bits whatever else the
function computes. sin, tanh and the like take long: those that do not wait for each other are computed side
by side in one vector, which changes no bit of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import casadi as ca

from hgorun.errors import HgorunError
from hgorun.native import functions
from hgorun.native.ir import Block, Function
from hgorun.symbolic.instructions import CLOCK, MAIN, SETUP, Instruction, read, rounds
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


@dataclass(eq=False, repr=False)
class Emitted:
    """The three parts of one function, and how much memory their results take.

    ``<name>_setup(p, c)``, ``<name>_clock(t, p, c, tau)``, ``<name>(p, c, tau, z, w, d)``; c and tau hold
    ``constants`` and ``clocked`` values a lane, d the function's output.
    """

    name: str
    lanes: int
    constants: int = 0
    clocked: int = 0
    instructions: int = 0
    text: str = field(default="", repr=False)

    def setup(self, f: Function, p: str, c: str) -> None:
        f.call(f"{self.name}_setup", f"ptr {p}, ptr {c}")

    def clock(self, f: Function, t: str, p: str, c: str, tau: str) -> None:
        if self.clocked:
            f.call(f"{self.name}_clock", f"double {t}, ptr {p}, ptr {c}, ptr {tau}")

    def main(self, f: Function, p: str, c: str, tau: str, z: str, w: str, d: str) -> None:
        f.call(self.name, f"ptr {p}, ptr {c}, ptr {tau}, ptr {z}, ptr {w}, ptr {d}")


class _Emitter:
    """Walks the instruction list once, appending each instruction to the part that it belongs to."""

    def __init__(self, name: str, lanes: int, declarations: set[str], *, inlined: bool) -> None:
        inline = f"{'alwaysinline' if inlined else 'noinline'} nounwind"
        pointers = "ptr noalias %p, ptr noalias %c"
        self.parts = [
            Function(f"{name}_setup", pointers, lanes, declarations, attributes=inline),
            Function(
                f"{name}_clock",
                f"double %t, {pointers}, ptr noalias %tau",
                lanes,
                declarations,
                attributes=inline,
            ),
            Function(
                name,
                f"{pointers}, ptr noalias %tau, ptr noalias %z, ptr noalias %w, ptr noalias %d",
                lanes,
                declarations,
                attributes=inline,
            ),
        ]
        self.lanes = lanes
        self.sizes = [0, 0]
        self.level: dict[int, int] = {}  # value -> the part that computes it
        self.names: list[dict[int, str]] = [{}, {}, {}]  # per part: value -> its name there
        self.passed: dict[int, int] = {}  # value -> its place in c or tau
        self.parameters: dict[int, int] = {}  # value -> its index in p

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
        for names, part in zip(self.names, self.parts, strict=True):
            names[value] = part.constant(number)

    def input(self, value: int, argument: int, index: int) -> None:
        if argument == 0:
            self.define(value, CLOCK, self.parts[CLOCK].splat("%t"))
        elif argument == 1:
            self.level[value] = SETUP
            self.parameters[value] = index
        else:
            self.define(value, MAIN, self._load(MAIN, "%z" if argument == 2 else "%w", index))

    def operation(self, value: int, op: int, arguments: Sequence[int]) -> None:
        part = max((self.level[a] for a in arguments), default=SETUP)
        f = self.parts[part]
        names = [self.use(a, part) for a in arguments]
        if op in _BINARY:
            self.define(value, part, _BINARY[op](f, names[0], names[1]))
        elif op in _UNARY:
            self.define(value, part, _UNARY[op](f, names[0]))
        else:
            raise HgorunError(
                f"CasADi operation {op} has no native code; abs, sign, sqrt, floor, ceil, fmin, fmax, pow, exp, log, "
                "sin, cos, tan, their inverses, hyperbolic functions and if_else are available"
            )

    def calls(self, calls: Sequence[Instruction]) -> None:
        """Calls in one part that do not wait for each other: those of one function side by side."""
        part = max(self.level[a] for a in calls[0].arguments)
        f = self.parts[part]
        size = _TOGETHER if self.lanes == 1 else 1
        for name in {CALLS[call.op]: None for call in calls}:
            alike = [call for call in calls if CALLS[call.op] == name]
            for i in range(0, len(alike), size):
                some = alike[i : i + size]
                arguments = [[self.use(a, part) for a in call.arguments] for call in some]
                values = f.side_by_side(partial(functions.call, name), arguments)
                for call, value in zip(some, values, strict=True):
                    self.define(call.value, part, value)

    def output(self, value: int, index: int) -> None:
        main = self.parts[MAIN]
        main.store(self.use(value, MAIN), main.at("%d", index * self.lanes), main.real)


def emit(function: ca.Function, name: str, lanes: int, declarations: set[str], *, inlined: bool = True) -> Emitted:
    """Emit f(t, p, z, w) -> d.

    Parameters
    ----------
    function : casadi.Function
        Four inputs t (scalar), p, z, w and one dense vector output, on SX.
    name : str
        Prefix of the emitted functions.
    lanes : int
        W; arrays hold W values an entry.
    declarations : set of str
        Receives the intrinsics needed.
    inlined : bool
        Whether the code stands wherever it is called, or once.
    """
    emitter = _Emitter(name, lanes, declarations, inlined=inlined)
    instructions = read(function)
    for some in rounds(instructions, calls=CALLS):
        if some[0].op in CALLS:
            emitter.calls(some)
            continue
        for i in some:
            if i.op == ca.OP_CONST:
                emitter.constant(i.value, i.number)
            elif i.op == ca.OP_INPUT:
                emitter.input(i.value, *i.place)
            elif i.op == ca.OP_OUTPUT:
                emitter.output(i.arguments[0], i.place[1])
            else:
                emitter.operation(i.value, i.op, i.arguments)
    for part in emitter.parts:
        part.do("ret void")
    return Emitted(
        name,
        lanes,
        emitter.sizes[0],
        emitter.sizes[1],
        len(instructions),
        "\n".join(part.text() for part in emitter.parts),
    )
