"""The functions of an observer in C that are its equations: each evaluates some of its operations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from hgorun.export.c_code import Real, Writer
from hgorun.export.observer import Exported
from hgorun.export.operations import Operations

_SHORT = 60  # statements
_ORDER = ("tau", "u", "du", "e", "z", "dz")


@dataclass(frozen=True, eq=False, repr=False)
class Function:
    """A static function of C that fills an array.

    Attributes
    ----------
    name : str
    operations : Operations
    output : str
        Which of their outputs.
    writer : Writer
    """

    name: str
    operations: Operations
    output: str
    writer: Writer

    @property
    def size(self) -> int:
        """Numbers that it gives."""
        return len(self.operations.outputs[self.output])

    @cached_property
    def arrays(self) -> tuple[str, ...]:
        """The arrays that it reads."""
        ops, places = self.operations, self.writer.places
        own = [k for k in ops.needed(self.output) if not ops.steps[k].clocked]
        clocked = {*ops.clocked}
        found = {places[entry][0] for entry in ops.inputs(3, self.output)}
        found |= {"z"} if ops.inputs(2, self.output) else set()
        wanted = {a for k in own for a in ops.steps[k].arguments} | {*ops.outputs[self.output]}
        found |= {"tau"} if wanted & clocked else set()
        return tuple(name for name in [*_ORDER, *sorted(found - {*_ORDER})] if name in found)

    def call(self, target: str, **others: str) -> str:
        """A call; ``others``: what is given in place of an array of the same name."""
        return f"{self.name}({', '.join([*(others.get(name, name) for name in self.arrays), target])});"

    def lines(self, state: str, target: str) -> list[str]:
        """What it computes, from an array of this name into one of that name."""
        targets: dict[int, list[str]] = {}
        for i, k in enumerate(self.operations.outputs[self.output]):
            targets.setdefault(k, []).append(f"{target}[{i}]")
        return replace(self.writer, state=state).statements(targets)

    def text(self) -> list[str]:
        """All of it in C."""
        real = self.writer.real.name
        parameters = [*(f"const {real} {name}[]" for name in self.arrays), f"{real} out[]"]
        body = (f"    {line}" for line in self.lines("z", "out"))
        return [f"static void {self.name}({', '.join(parameters)})", "{", *body, "}", ""]


@dataclass(frozen=True, eq=False, repr=False)
class Functions:
    """All of an observer's.

    Attributes
    ----------
    observer : Exported
    real : Real
    prefix : str
        ``hgo_<label>_``.
    """

    observer: Exported
    real: Real
    prefix: str

    def writer(self, operations: Operations, places: Sequence[tuple[str, int]]) -> Writer:
        return Writer(operations, self.real, self.prefix, places)

    @cached_property
    def all(self) -> dict[str, Function]:
        """By the names of their outputs."""
        observer = self.observer
        flow = self.writer(observer.equations, observer.places)
        found = {
            name: Function(f"{self.prefix}eq_{name}", observer.equations, name, flow)
            for name in observer.equations.outputs
        }
        if not self.needs_guess:
            del found["guess"]
        if observer.jump is not None:
            found["jump"] = Function(
                f"{self.prefix}eq_jump", observer.jump, "jump", self.writer(observer.jump, self._held)
            )
        return found

    @property
    def needs_guess(self) -> bool:
        """Whether C xhat is compared with anything at the same time, or kept at samples."""
        observer = self.observer
        undelayed = any(o.continuous and o.delay is None for o in observer.outputs)
        unremembered = any(o.sampled and not o.remembered for o in observer.outputs)
        return observer.compares and (undelayed or unremembered)

    @property
    def timed(self) -> bool:
        """Whether some equation depends on time itself."""
        return bool(self.observer.equations.clocked)

    def clock_at(self, time: str) -> list[str]:
        """Lines that compute what depends on time alone, if there is something."""
        if not self.timed:
            return []
        size = len(self.observer.equations.clocked)
        return [f"    {self.real.name} tau[{size}];", f"    {self.prefix}clock({time}, tau);"]

    def told_at(self, time: str, *, slopes: bool = False) -> list[str]:
        """Lines that fill u, and du, with the inputs at a time, if they are told."""
        m = len(self.observer.inputs)
        if not m:
            return []
        arrays = ["u", "du"] if slopes else ["u"]
        lines = [f"    {self.real.name} {name}[{m}];" for name in arrays]
        return [*lines, f"    {self.prefix}inputs(s, {time}, u{', du' if slopes else ', NULL'});"]

    def read_now(self, function: Function) -> list[str]:
        """Lines that fill what a function reads beside the state, at the present time."""
        found = self.clock_at("s->t") if "tau" in function.arrays else []
        return [*found, *(self.told_at("s->t") if "u" in function.arrays else [])]

    @property
    def _held(self) -> list[tuple[str, int]]:
        """What the entries of the engine's w are called at a jump."""
        held, observer = self.observer.held, self.observer
        places: list[tuple[str, int]] = [("interval", 0)] * held.size
        for i in range(held.outputs):
            places[held.previous(i)], places[held.output(i)] = ("previous", i), ("y", i)
            places[held.noise(i)] = places[held.s(i, 0)] = ("nothing", i)
            if held.flags:
                places[held.fresh(i)] = ("fresh", i)
        for i in range(len(observer.inputs)):
            value, _, _, before = held.input(i)
            places[value], places[before] = ("u", i), ("before", i)
        return places

    def _clock(self, operations: Operations, name: str, places: Sequence[tuple[str, int]]) -> list[str]:
        """What depends on time alone, as a function that fills ``tau``; nothing where there is none of it."""
        if not operations.clocked:
            return []
        # in double, whatever else is float: a clock needs its digits
        writer, real = Writer(operations, Real(), self.prefix, places), self.real
        targets = {k: [f"tau[{i}]"] for i, k in enumerate(operations.clocked)}
        body = writer.statements(targets, clock=True, cast="(float)" if real.single else "")
        return [f"static void {name}(double t, {real.name} tau[])", "{", *(f"    {line}" for line in body), "}", ""]

    @cached_property
    def written_out(self) -> bool:
        """Whether the right-hand side is so short that it stands wherever it is evaluated: no call, no array."""
        if not self.observer.flows:
            return False
        found = [f for name, f in self.all.items() if name in ("rate", "guess")]
        return sum(len(f.lines("z", "out")) for f in found) <= _SHORT

    def text(self) -> list[str]:
        """Those that are called."""
        observer = self.observer
        lines = self._clock(observer.equations, f"{self.prefix}clock", observer.places)
        if observer.jump is not None:
            lines += self._clock(observer.jump, f"{self.prefix}jump_clock", self._held)
        for name, function in self.all.items():
            if not (name == "rate" and self.written_out):
                lines += function.text()
        return lines


@dataclass(frozen=True, eq=False, repr=False)
class Part:
    """A part of the file that uses the observer's equations.

    Attributes
    ----------
    functions : Functions
        These equations.
    """

    functions: Functions

    @property
    def observer(self) -> Exported:
        """The observer."""
        return self.functions.observer

    @property
    def real(self) -> Real:
        """The type of numbers."""
        return self.functions.real

    @property
    def prefix(self) -> str:
        """Of names."""
        return self.functions.prefix

    @property
    def upper(self) -> str:
        """Of macros."""
        return self.prefix.upper()
