"""The functions of an observer in C that are its equations: each evaluates some of its operations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from hgorun.export.c_code import Real, Writer
from hgorun.export.observer import Exported
from hgorun.export.operations import Operations

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

    def text(self) -> list[str]:
        """Its lines."""
        real = self.writer.real.name
        targets: dict[int, list[str]] = {}
        for i, k in enumerate(self.operations.outputs[self.output]):
            targets.setdefault(k, []).append(f"out[{i}]")
        parameters = [*(f"const {real} {name}[]" for name in self.arrays), f"{real} out[]"]
        body = self.writer.statements(targets)
        return [f"static void {self.name}({', '.join(parameters)})", "{", *(f"    {line}" for line in body), "}", ""]


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
            found["jump"] = Function(f"{self.prefix}eq_jump", observer.jump, "jump", self.writer(observer.jump, self._held))
        return found

    @property
    def needs_guess(self) -> bool:
        """Whether C xhat is compared with anything at the same time, or kept at samples."""
        observer = self.observer
        undelayed = any(o.continuous and o.delay is None for o in observer.outputs)
        unremembered = any(o.sampled and not o.remembered for o in observer.outputs)
        return observer.flows and (undelayed or unremembered)

    @property
    def _held(self) -> list[tuple[str, int]]:
        """What the entries of the engine's w are called at a jump."""
        held, observer = self.observer.held, self.observer
        places: list[tuple[str, int]] = [("interval", 0)] * held.size
        for i in range(held.outputs):
            places[held.previous(i)], places[held.output(i)] = ("previous", i), ("y", i)
            places[held.noise(i)] = places[held.s(i, 0)] = ("nothing", i)
        for i in range(len(observer.inputs)):
            value, _, _, before = held.input(i)
            places[value], places[before] = ("u", i), ("before", i)
        return places

    def _clock(self, operations: Operations, name: str, places: Sequence[tuple[str, int]]) -> list[str]:
        """What depends on time alone, as a function that fills ``tau``; nothing where there is none of it."""
        if not operations.clocked:
            return []
        writer, real = self.writer(operations, places), self.real
        targets = {k: [f"tau[{i}]"] for i, k in enumerate(operations.clocked)}
        first = ["const float t = (float)time;"] if real.single else ["const double t = time;"]
        body = first + writer.statements(targets, clock=True)
        return [f"static void {name}(double time, {real.name} tau[])", "{", *(f"    {line}" for line in body), "}", ""]

    def text(self) -> list[str]:
        """All of them in C."""
        observer = self.observer
        lines = self._clock(observer.equations, f"{self.prefix}clock", observer.places)
        if observer.jump is not None:
            lines += self._clock(observer.jump, f"{self.prefix}jump_clock", self._held)
        for function in self.all.values():
            lines += function.text()
        return lines
