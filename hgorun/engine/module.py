"""The native module under construction, and what its functions have in common."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hgorun.engine.emit import Emitted, emit
from hgorun.engine.layout import COUNT, WORD, HybridSystem
from hgorun.native.ir import Function

_UNROLLED = 8
_REGISTERS = 512  # doubles of an array that registers and what they spill into may hold


class Module:
    """The native module under construction: its functions share declarations, lanes and a system.

    ``shown`` are the states that rows have, all of them where it is None. Lanes that are ``loose`` have times of
    their own, see :mod:`hgorun.engine.loose`.
    """

    def __init__(
        self, system: HybridSystem, lanes: int, shown: Sequence[int] | None = None, *, loose: bool = False
    ) -> None:
        self.system, self.lanes, self.shown, self.loose = system, lanes, shown, loose
        self.declarations: set[str] = set()
        self.functions: list[str] = []
        self.constants = 0
        self._offset: dict[str, int] = {}
        self._emitted: list[Emitted] = []

    @property
    def time(self) -> str:
        """The type of a time."""
        return f"<{self.lanes} x double>" if self.loose and self.lanes > 1 else "double"

    @property
    def row_words(self) -> int:
        """Words of an output point."""
        return self.lanes * (self.system.states if self.shown is None else len(self.shown))

    def function(self, name: str, arguments: str, *, returns: str = "void", attributes: str = "nounwind") -> Function:
        return Function(name, arguments, self.lanes, self.declarations, returns=returns, attributes=attributes)

    def finish(self, f: Function, linkage: str = "internal") -> None:
        self.functions.append(f.text(linkage))

    def emit(self, function: object, name: str, *, inlined: bool = True) -> Emitted:
        """Emit a symbolic function and give it a place among the constants of a run."""
        emitted = emit(function, name, self.lanes, self.declarations, inlined=inlined, timed=self.loose)
        self.functions.append(emitted.text)
        self._offset[name] = self.constants
        self._emitted.append(emitted)
        self.constants += emitted.constants
        return emitted

    def constants_of(self, f: Function, emitted: Emitted, ctx: str = "%ctx") -> str:
        return f.at(f.word(ctx, WORD["c"], "ptr"), self._offset[emitted.name] * self.lanes)

    def text(self) -> str:
        return "\n".join([*sorted(self.declarations), *self.functions])

    def setup(self) -> None:
        """``setup(ctx)``: what depends on the parameters alone, once a run."""
        f = self.function("setup", "ptr %ctx")
        for emitted in self._emitted:
            emitted.setup(f, f.word("%ctx", WORD["p"], "ptr"), self.constants_of(f, emitted))
        f.do("ret void")
        self.finish(f, "dso_local")


def span(f: Function, segment: str) -> tuple[str, ...]:
    """The four times of a segment."""
    base = f.at(f.word("%ctx", WORD["spans"], "ptr"), f.scalar("mul", segment, f.word("%ctx", WORD["span_words"])))
    inside = f.at(base, f.word("%ctx", WORD["inside"]))
    return tuple(f.word(ends, i, "double") for ends in (base, inside) for i in range(2))


def counts(f: Function, segment: str) -> dict[str, str]:
    """The integers of a segment, by name."""
    row = f.scalar("and", segment, f.word("%ctx", WORD["count_mask"]))
    base = f.at(f.word("%ctx", WORD["counts"], "ptr"), f.scalar("mul", row, str(len(COUNT))))
    return {name: f.word(base, i) for i, name in enumerate(COUNT)}


def each(f: Function, count: int) -> Iterator[str | int]:
    """The numbers of ``count`` values, which lie in all lanes one after the other: a loop where they are many."""
    if count <= _UNROLLED:
        yield from range(count)
    else:
        with f.count(0, count) as i:
            yield i


def copy(f: Function, source: str, target: str, count: int) -> None:
    """Copy ``count`` values of all lanes, in a loop where they are many."""
    if count <= _UNROLLED:
        return move(f, source, target, count)
    with f.count(0, count) as i:
        place = f.scalar("mul", i, str(f.lanes))
        f.store(f.load(f.at(source, place), f.real), f.at(target, place), f.real)
    return None


def move(f: Function, source: str, target: str, count: int) -> None:
    """Copy ``count`` values of all lanes, unrolled, so that the arrays may become registers."""
    for i in range(count):
        f.store(f.load(f.at(source, i * f.lanes), f.real), f.at(target, i * f.lanes), f.real)


def lent(f: Function, array: str, count: int) -> str:
    """An array for a function that is called rarely: a copy, since only what no function is given becomes registers.

    A store that is loaded again takes longer than an addition, above all where scalars are loaded as a vector.
    """
    if count * f.lanes > _REGISTERS:
        return array
    own = f.slot("double", count * f.lanes)
    move(f, array, own, count)
    return own
