"""LLVM IR as text, on W lanes: W runs side by side in one vector register.

A :class:`Block` collects the instructions of one function body. Values are SSA names or
constants, all of type ``<W x double>`` (``double`` for W = 1). No instruction carries a
fast-math flag: nothing is regrouped or contracted, so the bits of a value do not depend on
what stands around it. A fused multiply-add is written where it is meant.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager

_OF_LANES = ("lanes", "real", "integer", "mask", "_suffix")  # attributes of a block that say on how many lanes it is


def hexadecimal(value: float) -> str:
    """The exact LLVM spelling of a double."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


class Block:
    """Instructions on W lanes.

    Parameters
    ----------
    lanes : int
        W >= 1.
    declarations : set of str
        Collects the declarations and definitions that the body needs; shared by the blocks
        of one module.
    """

    def __init__(self, lanes: int, declarations: set[str]) -> None:
        self.lanes = lanes
        self.declarations = declarations
        self.lines: list[str] = []
        self.real = "double" if lanes == 1 else f"<{lanes} x double>"
        self.integer = "i64" if lanes == 1 else f"<{lanes} x i64>"
        self.mask = "i1" if lanes == 1 else f"<{lanes} x i1>"
        self._suffix = "f64" if lanes == 1 else f"v{lanes}f64"
        self._count = 0

    def let(self, instruction: str) -> str:
        """Append an instruction, return the name of its value."""
        self._count += 1
        name = f"%v{self._count}"
        self.lines.append(f"  {name} = {instruction}")
        return name

    def do(self, instruction: str) -> None:
        """Append an instruction that has no value."""
        self.lines.append("  " + instruction)

    def constant(self, value: float) -> str:
        one = hexadecimal(value)
        return one if self.lanes == 1 else "<" + ", ".join([f"double {one}"] * self.lanes) + ">"

    def integer_constant(self, value: int) -> str:
        return str(value) if self.lanes == 1 else "<" + ", ".join([f"i64 {value}"] * self.lanes) + ">"

    def splat(self, scalar: str) -> str:
        """A scalar SSA double in all lanes."""
        if self.lanes == 1:
            return scalar
        one = self.let(f"insertelement {self.real} poison, double {scalar}, i64 0")
        return self.let(f"shufflevector {self.real} {one}, {self.real} poison, <{self.lanes} x i32> zeroinitializer")

    def add(self, a: str, b: str) -> str:
        return self.let(f"fadd {self.real} {a}, {b}")

    def sub(self, a: str, b: str) -> str:
        return self.let(f"fsub {self.real} {a}, {b}")

    def mul(self, a: str, b: str) -> str:
        return self.let(f"fmul {self.real} {a}, {b}")

    def div(self, a: str, b: str) -> str:
        return self.let(f"fdiv {self.real} {a}, {b}")

    def neg(self, a: str) -> str:
        return self.let(f"fneg {self.real} {a}")

    def compare(self, predicate: str, a: str, b: str) -> str:
        """A mask; predicate as in LLVM's fcmp: olt, ole, oeq, une, uno, ..."""
        return self.let(f"fcmp {predicate} {self.real} {a}, {b}")

    def select(self, mask: str, yes: str, no: str) -> str:
        return self.let(f"select {self.mask} {mask}, {self.real} {yes}, {self.real} {no}")

    def any(self, mask: str) -> str:
        """Whether a mask holds in some lane, an i1."""
        if self.lanes == 1:
            return mask
        name = f"@llvm.vector.reduce.or.v{self.lanes}i1"
        self.declarations.add(f"declare i1 {name}({self.mask})")
        return self.let(f"call i1 {name}({self.mask} {mask})")

    def rarely(self, condition: str, usual: str, otherwise: Callable[[], str]) -> str:
        """A value, or where an i1 holds the one that ``otherwise`` emits: nothing of it runs elsewhere."""
        return self.rarely_all(condition, [usual], lambda: [otherwise()])[0]

    def rarely_all(self, condition: str, usual: Sequence[str], otherwise: Callable[[], Sequence[str]]) -> list[str]:
        """The same of several values."""
        self._count += 1
        here, there, after = (f"{kind}{self._count}" for kind in ("usual", "rare", "both"))
        for line in (f"  br label %{here}", f"{here}:", f"  br i1 {condition}, label %{there}, label %{after}"):
            self.lines.append(line)
        self.lines.append(f"{there}:")
        others = otherwise()
        self.lines += [f"  br label %{after}", f"{after}:"]
        both = zip(usual, others, strict=True)
        return [self.let(f"phi {self.real} [ {one}, %{here} ], [ {other}, %{there} ]") for one, other in both]

    def intrinsic(self, name: str, *arguments: str) -> str:
        """llvm.<name> on doubles: fabs, sqrt, floor, ceil, rint, copysign, fma, ..."""
        full = f"@llvm.{name}.{self._suffix}"
        types = ", ".join([self.real] * len(arguments))
        self.declarations.add(f"declare {self.real} {full}({types})")
        return self.let(f"call {self.real} {full}(" + ", ".join(f"{self.real} {a}" for a in arguments) + ")")

    def fma(self, a: str, b: str, c: str) -> str:
        return self.intrinsic("fma", a, b, c)

    def bits(self, a: str) -> str:
        """The doubles as 64-bit integers."""
        return self.let(f"bitcast {self.real} {a} to {self.integer}")

    def from_bits(self, a: str) -> str:
        return self.let(f"bitcast {self.integer} {a} to {self.real}")

    def side_by_side(self, function: Callable[..., str], calls: Sequence[Sequence[str]], least: int = 1) -> list[str]:
        """The values of ``function(block, *arguments)`` for several arguments.

        Those of scalars are computed in one vector of at least so many lanes, so that they take the time of one. With
        two lanes a single one, too, is: the bits of a vector are shifted where they are, which is faster than through
        other registers and back.
        """
        width = max(1 << (len(calls) - 1).bit_length(), least)
        if width == 1 or self.lanes > 1:
            return [function(self, *arguments) for arguments in calls]
        with self.on_lanes(width) as wide:
            vectors = [wide.gather(entries) for entries in zip(*calls, strict=True)]
            result = function(wide, *vectors)
            return [wide.let(f"extractelement {wide.real} {result}, i64 {i}") for i in range(len(calls))]

    @contextmanager
    def on_lanes(self, lanes: int) -> Iterator[Block]:
        """The same body, which the block goes on with on another number of lanes."""
        other = Block(lanes, self.declarations)
        other.lines, other._count = self.lines, self._count
        yield other
        self._count = other._count

    @contextmanager
    def wide(self, lanes: int) -> Iterator[None]:
        """Instructions of this block on another number of lanes, meanwhile."""
        kept = {name: value for name, value in vars(self).items() if name in _OF_LANES}
        vars(self).update({name: value for name, value in vars(Block(lanes, set())).items() if name in _OF_LANES})
        yield
        vars(self).update(kept)

    def gather(self, scalars: Sequence[str]) -> str:
        """Scalars in the first lanes, the last of them in the others, too."""
        vector = self.splat(scalars[-1])
        for lane, scalar in enumerate(scalars[:-1]):
            vector = self.let(f"insertelement {self.real} {vector}, double {scalar}, i64 {lane}")
        return vector


class Function(Block):
    """A function with structured control flow.

    Variables are stack slots: LLVM turns them into registers. Integers are ``i64``.
    """

    def __init__(
        self,
        name: str,
        arguments: str,
        lanes: int,
        declarations: set[str],
        *,
        returns: str = "void",
        attributes: str = "nounwind",
    ) -> None:
        super().__init__(lanes, declarations)
        self.name = name
        self._head = f"define {{linkage}} {returns} @{name}({arguments}) {attributes} {{{{"
        self._slots: list[str] = []
        self._labels = 0

    def text(self, linkage: str = "internal") -> str:
        """The finished definition."""
        return "\n".join([self._head.format(linkage=linkage), "entry:", *self._slots, *self.lines, "}"])

    def slot(self, kind: str, count: int = 1) -> str:
        """Stack memory for ``count`` values of a type."""
        name = f"%s{len(self._slots)}"
        array = kind if count <= 1 else f"[{count} x {kind}]"  # such a one may become registers
        self._slots.append(f"  {name} = alloca {array}, align 64")
        return name

    def load(self, pointer: str, kind: str = "double") -> str:
        return self.let(f"load {kind}, ptr {pointer}, align 8")

    def store(self, value: str, pointer: str, kind: str = "double") -> None:
        self.do(f"store {kind} {value}, ptr {pointer}, align 8")

    def at(self, pointer: str, index: str | int) -> str:
        """Address of the 8-byte word ``index`` behind a pointer."""
        return self.let(f"getelementptr double, ptr {pointer}, i64 {index}")

    def word(self, pointer: str, index: str | int, kind: str = "i64") -> str:
        """Load the 8-byte word ``index`` behind a pointer."""
        return self.load(self.at(pointer, index), kind)

    def scalar(self, operation: str, a: str, b: str) -> str:
        """Arithmetic on scalars: ``fadd``, ``fmul``, ... on double; ``add``, ``mul``, ... on i64."""
        return self.let(f"{operation} {'double' if operation.startswith('f') else 'i64'} {a}, {b}")

    def test(self, predicate: str, a: str, b: str) -> str:
        """Compare scalars: ``slt``, ``eq``, ... integers; ``olt``, ``ugt``, ... doubles."""
        integer = predicate in {"eq", "ne", "slt", "sle", "sgt", "sge"}
        return self.let(f"{'icmp' if integer else 'fcmp'} {predicate} {'i64' if integer else 'double'} {a}, {b}")

    def label(self) -> str:
        self._labels += 1
        return f"L{self._labels}"

    def place(self, label: str) -> None:
        self.lines.append(f"{label}:")

    def jump(self, label: str) -> None:
        self.do(f"br label %{label}")

    def branch(self, condition: str, yes: str, no: str) -> None:
        self.do(f"br i1 {condition}, label %{yes}, label %{no}")

    @contextmanager
    def when(self, condition: str) -> Iterator[None]:
        """The body runs when the i1 holds."""
        body, after = self.label(), self.label()
        self.branch(condition, body, after)
        self.place(body)
        yield
        self.jump(after)
        self.place(after)

    @contextmanager
    def choice(self, value: str) -> Iterator[Callable[..., AbstractContextManager[None]]]:
        """Cases of an i64: each is given its numbers, and its body runs for these; for others nothing does."""
        decide, after = self.label(), self.label()
        self.jump(decide)
        targets: list[str] = []

        @contextmanager
        def case(*numbers: int) -> Iterator[None]:
            body = self.label()
            targets.extend(f"i64 {number}, label %{body}" for number in numbers)
            self.place(body)
            yield
            self.jump(after)

        yield case
        self.place(decide)
        self.do(f"switch i64 {value}, label %{after} [ {' '.join(targets)} ]")
        self.place(after)

    @contextmanager
    def loop(self) -> Iterator[str]:
        """Repeat until :meth:`leave_if` leaves to the yielded label."""
        head, after = self.label(), self.label()
        self.jump(head)
        self.place(head)
        yield after
        self.jump(head)
        self.place(after)

    def leave_if(self, condition: str, after: str) -> None:
        stay = self.label()
        self.branch(condition, after, stay)
        self.place(stay)

    @contextmanager
    def count(self, start: str | int, stop: str | int) -> Iterator[str]:
        """A loop over i64 from start to stop - 1."""
        index = self.slot("i64")
        self.store(str(start), index, "i64")
        with self.loop() as after:
            i = self.load(index, "i64")
            self.leave_if(self.test("sge", i, str(stop)), after)
            yield i
            self.store(self.scalar("add", i, "1"), index, "i64")

    def call(self, function: str, arguments: str, returns: str = "void") -> str:
        if returns == "void":
            self.do(f"call void @{function}({arguments})")
            return ""
        return self.let(f"call {returns} @{function}({arguments})")
