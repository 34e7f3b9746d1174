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

    def __init__(
        self, name: str, lanes: int, declarations: set[str], *, inlined: bool, timed: bool, literal: bool = False
    ) -> None:
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
        self.name, self.lanes, self.declarations = name, lanes, declarations
        self.timed, self.literal = timed, literal
        self.sizes = [0, 0]  # numbers in c and in tau
        self.products: dict[int, tuple[int, int]] = {}  # what is a product in the last part -> its factors
        self.made: dict[tuple[int, ...], int] = {}  # operation and arguments -> a value of our own, below zero
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
        name = self._shortened(value, op, arguments) if part == MAIN and not self.literal else None
        f = self.parts[part]
        self.define(value, part, name or operation(f, op, [self.use(a, part) for a in arguments]))

    def _shortened(self, value: int, op: int, arguments: Sequence[int]) -> str | None:
        """An operation of every evaluation in another way that takes less time; None where there is none.

        Whether there is follows from the formula alone and not from the order of its terms and factors, nor from
        what else the function computes: symmetric matrices stay symmetric, and bits are the same in any company.
        """
        if op == ca.OP_DIV:
            return self._product(value, arguments[0], self._reciprocal(arguments[1]))
        if op in (ca.OP_MUL, ca.OP_SQ):
            return self._product(value, arguments[0], arguments[-1])
        if op in (ca.OP_ADD, ca.OP_SUB):
            return self._fused(op, arguments)
        return None

    def _product(self, value: int, a: int, b: int) -> str:
        """A product; what it has of factors that depend on parameters alone is multiplied once a run."""
        for constant, other in ((a, b), (b, a)):
            if self.level[constant] == SETUP and other in self.products:
                for own, rest in (self.products[other], self.products[other][::-1]):
                    if self.level[own] == SETUP:
                        a, b = self._made(ca.OP_MUL, min(constant, own), max(constant, own)), rest
        self.products[value] = a, b
        return self.parts[MAIN].mul(self.use(a, MAIN), self.use(b, MAIN))

    def _reciprocal(self, value: int) -> int:
        """1 over a value: one division for all that is divided by it; once a run, if it depends on parameters alone."""
        if self.level[value] == SETUP:
            return self._made(ca.OP_INV, value)
        key = ca.OP_INV, value
        if key not in self.made:
            self.made[key] = -1 - len(self.made)
            self.define(self.made[key], MAIN, operation(self.parts[MAIN], ca.OP_INV, [self.use(value, MAIN)]))
        return self.made[key]

    def _made(self, op: int, *arguments: int) -> int:
        """A value that depends on parameters alone and that the function does not have itself."""
        key = op, *arguments
        if key not in self.made:
            self.made[key] = -1 - len(self.made)
            self.operation(self.made[key], op, arguments)
        return self.made[key]

    def _fused(self, op: int, arguments: Sequence[int]) -> str | None:
        """A sum of a product and something else, rounded once; None for other sums.

        The sum of two products would depend on which of them is rounded by itself, and what is symmetric in its
        formulas would no longer be to the last bit: it stays as it is written.
        """
        left, right = (self.products.get(a) for a in arguments)
        if (left is None) == (right is None):
            return None
        f, product = self.parts[MAIN], left or right
        assert product is not None
        a, b = (self.use(factor, MAIN) for factor in product)
        other = self.use(arguments[1] if left else arguments[0], MAIN)
        if op == ca.OP_SUB:
            a, other = (a, f.neg(other)) if left else (f.neg(a), other)
        return f.fma(a, b, other)

    def calls(self, calls: Sequence[Instruction]) -> None:
        """Calls in one part that do not wait for each other: those of one function side by side."""
        part = max(self.level[a] for a in calls[0].arguments)
        powers = [call for call in calls if CALLS[call.op] == "pow"]
        others = [call for call in calls if CALLS[call.op] != "pow"]
        for call, value in together(self.parts[part], others, lambda a: self.use(a, part)):
            self.define(call.value, part, value)
        for base in dict.fromkeys(call.arguments[0] for call in powers):
            self._powers(base, [call for call in powers if call.arguments[0] == base], part)

    def _powers(self, base: int, calls: Sequence[Instruction], part: int) -> None:
        """Powers of one base, which share what they have in common."""
        from hgorun.native.functions.power import Exponent, powers
        from hgorun.native.functions.roots import THIRD, cube_root

        f, x = self.parts[part], self.use(base, part)
        thirds = [call for call in calls if self.numbers.get(call.arguments[1]) == THIRD]
        others = [call for call in calls if call not in thirds]
        found = [cube_root(f, x)] * len(thirds) if thirds else []
        if others:
            given = [call.arguments[1] for call in others]
            found += powers(f, x, [Exponent(self.use(y, part), self.use(self._limit(y), part)) for y in given])
        for call, value in zip([*thirds, *others], found, strict=True):
            self.define(call.value, part, value)

    def _limit(self, y: int) -> int:
        """What the base of a power of this exponent may be, see :class:`~hgorun.native.functions.power.Exponent`."""
        from hgorun.native.functions.power import limit_of

        key = ca.OP_POW, y
        if key not in self.made:
            self.made[key] = -1 - len(self.made)
            part = self.level[y]
            self.define(self.made[key], part, limit_of(self.parts[part], self.use(y, part)))
        return self.made[key]

    def output(self, value: int, index: int) -> None:
        main = self.parts[MAIN]
        main.store(self.use(value, MAIN), main.at("%d", index * self.lanes), main.real)
