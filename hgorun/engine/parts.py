"""The native functions that every integrator calls: events, output rows, divergence, history."""

from __future__ import annotations

from hgorun.engine.emit import Emitted, emit
from hgorun.engine.layout import (
    ACTION_WORDS,
    ARRIVE,
    COUNT,
    JUMP,
    REBASE,
    RECORD,
    SET,
    SPAN,
    TAKE,
    WORD,
    Held,
    HybridSystem,
)
from hgorun.native.ir import Function, hexadecimal


class Module:
    """The native module under construction: its functions share declarations, lanes and a system."""

    def __init__(self, system: HybridSystem, lanes: int) -> None:
        self.system, self.lanes = system, lanes
        self.declarations: set[str] = set()
        self.functions: list[str] = []
        self.constants = 0
        self._offset: dict[str, int] = {}
        self._emitted: list[Emitted] = []

    def function(self, name: str, arguments: str, *, returns: str = "void", attributes: str = "nounwind") -> Function:
        return Function(name, arguments, self.lanes, self.declarations, returns=returns, attributes=attributes)

    def finish(self, f: Function, linkage: str = "internal") -> None:
        self.functions.append(f.text(linkage))

    def emit(self, function: object, name: str, *, inlined: bool = True) -> Emitted:
        """Emit a symbolic function and give it a place among the constants of a run."""
        emitted = emit(function, name, self.lanes, self.declarations, inlined=inlined)
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
    base = f.at(f.word("%ctx", WORD["spans"], "ptr"), f.scalar("mul", segment, str(len(SPAN))))
    return tuple(f.word(base, i, "double") for i in range(len(SPAN)))


def counts(f: Function, segment: str) -> dict[str, str]:
    """The integers of a segment, by name."""
    base = f.at(f.word("%ctx", WORD["counts"], "ptr"), f.scalar("mul", segment, str(len(COUNT))))
    return {name: f.word(base, i) for i, name in enumerate(COUNT)}


def copy(f: Function, source: str, target: str, words: int | str) -> None:
    """Copy 8-byte words, rarely: a loop."""
    with f.count(0, words) as i:
        f.store(f.word(source, i, "double"), f.at(target, i))


def move(f: Function, source: str, target: str, count: int) -> None:
    """Copy ``count`` values of all lanes, unrolled, so that the arrays may become registers."""
    for i in range(count):
        f.store(f.load(f.at(source, i * f.lanes), f.real), f.at(target, i * f.lanes), f.real)


def add_channels(m: Module) -> None:
    """``channels(ctx, t)``: all channels at the state z of the context, into its channel buffer."""
    emitted = m.emit(m.system.channels, "channels_of")
    f = m.function("channels", "ptr %ctx, double %t", attributes="nounwind noinline")
    p, z, w, out = (f.word("%ctx", WORD[name], "ptr") for name in ("p", "z", "w", "channels"))
    c = m.constants_of(f, emitted)
    tau = f.slot("double", emitted.clocked * m.lanes)
    emitted.clock(f, "%t", p, c, tau)
    emitted.main(f, p, c, tau, z, w, out)
    f.do("ret void")
    m.finish(f)


def add_actions(m: Module) -> None:
    """``act(ctx, segment)``: what happens at the event that starts a segment.

    TAKE (output, slot): remember the output and every observer's s. ARRIVE (output, slot): the sample taken
    in the slot becomes what the observers compare with; RECORD: it came after a newer one and is only
    noted. SET (place, index): a new value of the held noise or of the time between samples, in w. REBASE
    (output, first, last): count alpha from zero again, also in the slots that are still on their way. JUMP
    (number): a part of the state becomes what its jump says.
    """
    for number in range(len(m.system.jumps)):
        _add_jump(m, number)
    s, lanes = m.system, m.lanes
    f = m.function("act", "ptr %ctx, i64 %segment", attributes="nounwind noinline")
    c = counts(f, "%segment")
    t = span(f, "%segment")[2]
    w, z, slots, channels = (f.word("%ctx", WORD[name], "ptr") for name in ("w", "z", "slots", "channels"))
    with f.count(c["action_first"], c["action_last"]) as index:
        row = f.at(f.word("%ctx", WORD["actions"], "ptr"), f.scalar("mul", index, str(ACTION_WORDS)))
        op, output, slot, first, last = (f.word(row, i) for i in range(ACTION_WORDS))
        held = f.at(w, f.scalar("mul", output, str(s.held.width * lanes)))
        here = f.at(slots, f.scalar("mul", slot, str(s.width * lanes)))
        with f.when(f.test("eq", op, str(TAKE))):
            f.call("channels", f"ptr %ctx, double {t}")
            copy(f, f.at(channels, f.scalar("mul", output, str(s.width * lanes))), here, s.width * lanes)
        with f.when(f.test("eq", op, str(SET))):
            value = f.at(f.word("%ctx", WORD["holds"], "ptr"), f.scalar("mul", slot, str(lanes)))
            copy(f, value, f.at(w, f.scalar("mul", output, str(lanes))), lanes)
        for number in range(len(s.jumps)):
            wanted = f.test("eq", output, str(number))
            with f.when(f.let(f"and i1 {f.test('eq', op, str(JUMP))}, {wanted}")):
                f.call(f"jump{number}", f"ptr %ctx, double {t}")
        arrives, notes = f.test("eq", op, str(ARRIVE)), f.test("eq", op, str(RECORD))
        with f.when(f.let(f"or i1 {arrives}, {notes}")):
            at_slot = f.scalar("mul", slot, str(lanes))
            gain, bias, measured = (
                f.at(f.word("%ctx", WORD[name], "ptr"), at_slot) for name in ("gain", "bias", "measured")
            )
            with f.count(0, lanes) as lane:
                y = f.scalar("fmul", f.word(gain, lane, "double"), f.word(here, lane, "double"))
                f.store(f.scalar("fadd", y, f.word(bias, lane, "double")), f.at(measured, lane))
            with f.when(arrives):
                copy(f, f.at(held, Held.OUTPUT * lanes), f.at(held, Held.PREVIOUS * lanes), lanes)
                copy(f, measured, f.at(held, Held.OUTPUT * lanes), lanes)
                copy(f, f.at(here, lanes), f.at(held, Held.S * lanes), s.observers * lanes)
        with f.when(f.test("eq", op, str(REBASE))), f.count(0, s.observers * lanes) as i:
            place = f.scalar("add", f.scalar("mul", output, str(s.observers * lanes)), i)
            alpha_at = f.at(z, f.word(f.word("%ctx", WORD["alpha"], "ptr"), place))
            alpha = f.load(alpha_at)
            f.store(hexadecimal(0.0), alpha_at)
            held_s = f.at(f.at(held, Held.S * lanes), i)
            f.store(f.scalar("fadd", f.load(held_s), alpha), held_s)
            with f.count(first, last) as pending:
                there = f.at(slots, f.scalar("mul", pending, str(s.width * lanes)))
                pending_s = f.at(f.at(there, lanes), i)
                f.store(f.scalar("fadd", f.load(pending_s), alpha), pending_s)
    f.do("ret void")
    m.finish(f)


def _add_jump(m: Module, number: int) -> None:
    """``jump<number>(ctx, t)``: evaluated whole before it is written; what has diverged stays masked."""
    start, stop, function = m.system.jumps[number]
    emitted = m.emit(function, f"jump_of{number}")
    f = m.function(f"jump{number}", "ptr %ctx, double %t", attributes="nounwind noinline")
    p, z, w = (f.word("%ctx", WORD[name], "ptr") for name in ("p", "z", "w"))
    c = m.constants_of(f, emitted)
    tau, new = f.slot("double", emitted.clocked * m.lanes), f.slot("double", (stop - start) * m.lanes)
    emitted.clock(f, "%t", p, c, tau)
    emitted.main(f, p, c, tau, z, w, new)
    observers = [j for j, block in enumerate(m.system.blocks) if block[0] <= start < block[2]]  # none: the plant
    with f.count(0, m.lanes) as lane:
        alive = "true"
        if observers:
            diverged = f.at(f.word("%ctx", WORD["diverged"], "ptr"), observers[0] * m.lanes)
            alive = f.test("oeq", f.word(diverged, lane, "double"), hexadecimal(float("inf")))
        with f.when(alive), f.count(0, stop - start) as i:
            place = f.scalar("add", f.scalar("mul", i, str(m.lanes)), lane)
            f.store(f.word(new, place, "double"), f.at(z, f.scalar("add", place, str(start * m.lanes))))
    f.do("ret void")
    m.finish(f)


def add_flag(m: Module) -> None:
    """``flag(ctx, t, z, bound)``: mask the observers that have left the bound; 1 when the plant has."""
    lanes = m.lanes
    f = m.function("flag", "ptr %ctx, double %t, ptr %z, ptr %bound", returns="i64", attributes="nounwind noinline")
    bad = f.slot("i64")

    def watch(start: str, stop: str, lane: str, bound: str) -> str:
        f.store("0", bad, "i64")
        with f.count(start, stop) as i:
            value = f.word("%z", f.scalar("add", f.scalar("mul", i, str(lanes)), lane), "double")
            size = f.let(f"call double @llvm.fabs.f64(double {value})")
            with f.when(f.test("ugt", size, bound)):
                f.store("1", bad, "i64")
        return f.test("eq", f.load(bad, "i64"), "1")

    m.declarations.add("declare double @llvm.fabs.f64(double)")
    lost = f.slot("i64")
    f.store("0", lost, "i64")
    blocks, diverged = f.word("%ctx", WORD["blocks"], "ptr"), f.word("%ctx", WORD["diverged"], "ptr")
    with f.count(0, lanes) as lane:
        with f.when(watch("0", str(m.system.plant_states), lane, hexadecimal(1e300))):
            f.store("1", lost, "i64")
        bound = f.word("%bound", lane, "double")
        with f.count(0, m.system.observers) as j:
            block = f.at(blocks, f.scalar("mul", j, "3"))
            start, stop, end = (f.word(block, i) for i in range(3))
            with f.when(watch(start, stop, lane, bound)):
                when = f.at(diverged, f.scalar("add", f.scalar("mul", j, str(lanes)), lane))
                with f.when(f.test("olt", "%t", f.load(when))):  # infinity until then
                    f.store("%t", when)
                with f.count(start, end) as i:
                    place = f.scalar("add", f.scalar("mul", i, str(lanes)), lane)
                    f.store(hexadecimal(float("nan")), f.at("%z", place))
    f.do(f"ret i64 {f.load(lost, 'i64')}")
    m.finish(f)


def hermite(f: Function, theta: str, h: str, z0: str, k0: str, z1: str, k1: str) -> str:
    """The cubic through (0, z0, k0) and (h, z1, k1) at theta h; all of them scalars."""
    one = hexadecimal(1.0)
    rest = f.scalar("fsub", one, theta)
    rise = f.scalar("fsub", z1, z0)
    # (1-T) z0 + T z1 + T (T-1) ((1-2T)(z1-z0) + (T-1) h k0 + T h k1)
    line = f.scalar("fadd", f.scalar("fmul", rest, z0), f.scalar("fmul", theta, z1))
    a = f.scalar("fmul", f.scalar("fsub", rest, theta), rise)
    b = f.scalar("fmul", rest, f.scalar("fmul", h, k0))
    c = f.scalar("fmul", theta, f.scalar("fmul", h, k1))
    bend = f.scalar("fsub", f.scalar("fadd", a, c), b)
    return f.scalar("fsub", line, f.scalar("fmul", f.scalar("fmul", theta, rest), bend))


def hermite_slope(f: Function, theta: str, h: str, z0: str, k0: str, z1: str, k1: str) -> str:
    """The time derivative of :func:`hermite`."""
    rest = f.scalar("fsub", hexadecimal(1.0), theta)
    bump = f.scalar("fmul", hexadecimal(3.0), f.scalar("fmul", theta, rest))
    # with B = 3 T (1-T): 2 B (z1-z0)/h + (1-T-B) k0 + (T-B) k1
    rise = f.scalar("fdiv", f.scalar("fsub", z1, z0), h)
    middle = f.scalar("fmul", f.scalar("fmul", hexadecimal(2.0), bump), rise)
    a = f.scalar("fmul", f.scalar("fsub", rest, bump), k0)
    b = f.scalar("fmul", f.scalar("fsub", theta, bump), k1)
    return f.scalar("fadd", middle, f.scalar("fadd", a, b))


def add_rows(m: Module, *, quintic: bool) -> None:
    """``rows(ctx, t0, t1, snap, z0, k0, z1, k1, q)``: the output points in [t0 - snap, t1 - snap).

    By the cubic Hermite polynomial, or that plus T^2 (1-T)^2 q, a method's own continuous extension.
    """
    width = m.system.states * m.lanes
    f = m.function(
        "rows",
        "ptr %ctx, double %t0, double %t1, double %snap, ptr %z0, ptr %k0, ptr %z1, ptr %k1, ptr %q",
        attributes="nounwind noinline",
    )
    grid, rows = f.word("%ctx", WORD["grid"], "ptr"), f.word("%ctx", WORD["rows"], "ptr")
    place = f.at("%ctx", WORD["row"])
    h = f.scalar("fsub", "%t1", "%t0")
    start, stop = f.scalar("fadd", "%t0", "%snap"), f.scalar("fsub", "%t1", "%snap")
    with f.loop() as after:
        row = f.load(place, "i64")
        t = f.word(grid, row, "double")
        f.leave_if(f.test("oge", t, stop), after)
        target = f.at(rows, f.scalar("mul", row, str(width)))
        on_step = f.test("ole", t, start)
        with f.when(on_step):
            copy(f, "%z0", target, width)
        with f.when(f.let(f"xor i1 {on_step}, true")):
            theta = f.scalar("fdiv", f.scalar("fsub", t, "%t0"), h)
            with f.count(0, width) as i:
                values = [f.word(array, i, "double") for array in ("%z0", "%k0", "%z1", "%k1")]
                value = hermite(f, theta, h, *values)
                if quintic:
                    bump = f.scalar("fmul", theta, f.scalar("fsub", hexadecimal(1.0), theta))
                    bump = f.scalar("fmul", bump, bump)
                    value = f.scalar("fadd", value, f.scalar("fmul", bump, f.word("%q", i, "double")))
                f.store(value, f.at(target, i))
        f.store(f.scalar("add", row, "1"), place, "i64")
    f.do("ret void")
    m.finish(f)
