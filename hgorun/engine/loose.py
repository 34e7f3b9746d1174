"""Members side by side whose events are at other times: each lane goes through tables of its own.

All lanes make a step at once, each with its own time and length of step. A lane that has reached the end of a segment
goes on to the next one, with what happens at the event between them, while the others wait. What a lane computes is
what :mod:`hgorun.engine.fixed` computes for it alone, operation by operation.
"""

from __future__ import annotations

from collections.abc import Sequence

from hgorun.engine.emit import Emitted
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
from hgorun.engine.methods import Method, Rosenbrock
from hgorun.engine.parts import Module, hermite, move
from hgorun.engine.stepper import guard, weighted
from hgorun.native.ir import Function, hexadecimal

# What each lane has of its own, one word a lane each: its tables, and where it is in them.
TABLES = ("spans", "counts", "actions", "segments")
_NUMBERS = ("step", "first", "last", "steps", "h", "silent", "active", "due", "regime")
OWN = (*TABLES, "segment", "row", *SPAN, *_NUMBERS)
_REGIMES = 4  # each of them is in the code of every stage
_PLACE = {name: index for index, name in enumerate(OWN)}


def fits(system: HybridSystem, method: Method | Rosenbrock) -> bool:
    """Whether members may go through tables of their own: no histories, few regimes, no estimate of the error."""
    plain = isinstance(method, Method) and not method.error and not method.dense
    return plain and not system.remembers and len(system.regimes) <= _REGIMES


def own(f: Function, name: str, lane: str | int = 0) -> str:
    """Address of a word of a lane."""
    base = f.at(f.word("%ctx", WORD["own"], "ptr"), _PLACE[name] * f.lanes)
    return f.at(base, lane)


def add_loose(m: Module, method: Method, flows: Sequence[Emitted]) -> None:
    """``run_each(ctx)``: all lanes from the start to the end."""
    _add_act(m)
    _add_enter(m)
    _add_rows(m)
    _Loop(m, method, flows).add()


class _Loop:
    """The loop over steps."""

    def __init__(self, m: Module, method: Method, flows: Sequence[Emitted]) -> None:
        self.m, self.method, self.flows = m, method, flows
        self.f = f = m.function("run_each", "ptr %ctx", attributes="nounwind noinline")
        self.size, lanes = m.system.states, m.lanes
        self.p, self.w, self.z = (f.word("%ctx", WORD[name], "ptr") for name in ("p", "w", "z"))
        words = self.size * lanes
        arrays = (f.slot("double", words) for _ in range(5))
        self.before, self.slope, self.slope_before, self.stage, self.found = arrays
        self.k = [self.slope, *(f.slot("double", words) for _ in method.stages)]
        self.clock = {
            (flow.name, at): f.slot("double", flow.clocked * lanes) for flow in flows for at in {0.0, 1.0, *method.c}
        }

    def read(self, name: str) -> str:
        """A number of all lanes."""
        return self.f.load(own(self.f, name), self.f.real)

    def holds(self, name: str) -> str:
        return self.f.compare("ogt", self.read(name), self.f.constant(0.0))

    def both(self, a: str, b: str) -> str:
        return self.f.let(f"and {self.f.mask} {a}, {b}")

    def exact(self, step: str) -> str:
        """When a step starts."""
        f = self.f
        inside = f.add(self.read("start"), f.mul(step, self.read("h")))
        return f.select(f.compare("oeq", step, self.read("steps")), self.read("end"), inside)

    def clocked(self, step: str) -> str:
        """The same, where functions of time are evaluated: on the segment's side of its events."""
        f = self.f
        last = f.compare("oeq", step, self.read("steps"))
        late = f.select(last, self.read("end_eval"), self.exact(step))
        return f.select(f.compare("oeq", step, f.constant(0.0)), self.read("start_eval"), late)

    def snap(self, t1: str) -> str:
        """How far from an output point a time is its own."""
        f = self.f
        start, now = f.intrinsic("fabs", self.read("start")), f.intrinsic("fabs", t1)
        largest = f.select(f.compare("ogt", start, now), start, now)
        return f.add(f.mul(self.read("h"), f.constant(1e-9)), f.mul(largest, f.constant(1e-15)))

    def due(self, t1: str) -> str:
        """Where there are output points in the steps that end at t1."""
        return self.f.compare("olt", self.read("due"), self.f.sub(t1, self.snap(t1)))

    def each(self, mask: str, *, enter: bool) -> None:
        """The output points of some lanes; those that enter their next segment do so."""
        f = self.f
        with f.when(f.any(mask)):
            step = self.read("step")
            t0, t1 = self.exact(f.sub(step, f.constant(1.0))), self.exact(step)
            ready = self.both(f.compare("one", step, self.read("first")), self.due(t1))
            lists = [f.slot("double", f.lanes) for _ in range(5)]
            flags = [f.select(of, f.constant(1.0), f.constant(0.0)) for of in (mask, ready)]
            for value, to in zip((t0, t1, self.snap(t1), *flags), lists, strict=True):
                f.store(value, to, f.real)
            with f.count(0, f.lanes) as lane:
                begin, end, snap, chosen, shown = (f.word(of, lane, "double") for of in lists)
                with f.when(f.test("ogt", chosen, hexadecimal(0.0))):
                    with f.when(f.test("ogt", shown, hexadecimal(0.0))):
                        arrays = ", ".join(f"ptr {of}" for of in (self.before, self.slope_before, self.z, self.slope))
                        times = f"double {begin}, double {end}, double {snap}"
                        f.call("rows_of", f"ptr %ctx, i64 {lane}, {times}, {arrays}")
                    if enter:
                        f.call("enter", f"ptr %ctx, i64 {lane}")

    def first_slope(self) -> None:
        """The slope at the start of the steps."""
        self.flow_at(self.clocked(self.read("step")), 0.0, self.z, self.slope)

    def flow_at(self, t: str | None, c: float, z: str, target: str) -> None:
        """z' at (t, z), c being the part of the step at which that is; None: that of the last call for this part."""
        f, m = self.f, self.m
        for number, flow in enumerate(self.flows):
            constants, tau = m.constants_of(f, flow), self.clock[flow.name, c]
            if len(self.flows) == 1:
                self.evaluate(flow, t, constants, tau, z, target)
                return
            own = f.compare("oeq", self.read("regime"), f.constant(number))
            with f.when(f.any(own)):
                self.evaluate(flow, t, constants, tau, z, self.found)
                for i in range(self.size):
                    new, place = f.load(f.at(self.found, i * f.lanes), f.real), f.at(target, i * f.lanes)
                    f.store(f.select(own, new, f.load(place, f.real)), place, f.real)

    def evaluate(self, flow: Emitted, t: str | None, constants: str, tau: str, z: str, target: str) -> None:
        """The right-hand side of one regime, in all lanes."""
        if t is not None:
            flow.clock(self.f, t, self.p, constants, tau)
        flow.main(self.f, self.p, constants, tau, z, self.w, target)

    def add(self) -> None:
        f, m = self.f, self.m
        with f.count(0, f.lanes) as lane:
            f.call("enter", f"ptr %ctx, i64 {lane}")
        with f.loop() as after:
            f.leave_if(f.let(f"xor i1 {f.any(self.holds('active'))}, true"), after)
            ended = f.compare("oeq", self.read("step"), self.read("last"))
            self.each(self.both(ended, self.holds("silent")), enter=True)
            self.first_slope()
            inner = f.compare("one", self.read("step"), self.read("first"))
            self.each(self.both(inner, self.due(self.exact(self.read("step")))), enter=False)
            ended = self.both(f.compare("oeq", self.read("step"), self.read("last")), self.holds("active"))
            with f.when(f.any(ended)):
                self.each(ended, enter=True)
                self.first_slope()
            following = f.add(self.read("step"), f.constant(1.0))
            t_end = self.exact(following)
            with f.when(f.any(self.due(t_end))):
                move(f, self.z, self.before, self.size)
                move(f, self.slope, self.slope_before, self.size)
            self.step(following)
            lost = f.label()
            guard(f, m, t_end, self.z, lost)
            f.jump(lost)  # a plant that diverges ends its own lane alone
            f.place(lost)
            f.store(f.select(self.holds("active"), following, self.read("step")), own(f, "step"), f.real)
        f.do("ret void")
        m.finish(f, "dso_local")

    def step(self, following: str) -> None:
        """From z and the slope there to z at the end of the step, in the lanes that are not at their end."""
        f, method = self.f, self.method
        t, h, late = self.exact(self.read("step")), self.read("h"), self.clocked(following)
        ticked = {0.0}
        for c, row, target in zip(method.c[1:], method.stages, self.k[1:], strict=True):
            at = late if c == 1.0 else f.add(t, f.mul(h, f.constant(c)))
            self.combine(row.weights, row.scale, self.stage)
            self.flow_at(None if c in ticked else at, c, self.stage, target)
            ticked.add(c)
        self.combine(method.result.weights, method.result.scale, self.z)

    def combine(self, weights: tuple[float, ...], scale: float, target: str) -> None:
        """target = z + h scale sum_j weights[j] k[j]; where that is z, of lanes that go on."""
        f, h, active = self.f, self.read("h"), self.holds("active")
        factor = h if scale == 1.0 else f.mul(h, f.constant(scale))
        for i in range(self.size):
            place = i * f.lanes
            old = f.load(f.at(self.z, place), f.real)
            new = f.add(old, f.mul(factor, weighted(f, weights, self.k, place)))
            f.store(f.select(active, new, old) if target == self.z else new, f.at(target, place), f.real)


_COUNTED = ("steps", "first", "last", "end_slope", "regime")


def _add_enter(m: Module) -> None:
    """``enter(ctx, lane)``: a lane goes on to its next segment that has steps, or ends."""
    f = m.function("enter", "ptr %ctx, i64 %lane", attributes="nounwind noinline")
    ready = f.label()

    def set_to(name: str, value: str) -> None:
        f.store(value, own(f, name, "%lane"))

    with f.loop() as after:
        segment = f.load(own(f, "segment", "%lane"), "i64")
        f.leave_if(f.test("sge", segment, f.load(own(f, "segments", "%lane"), "i64")), after)
        f.store(f.scalar("add", segment, "1"), own(f, "segment", "%lane"), "i64")
        n = _counts(f, segment)
        with f.when(f.test("ne", n["action_first"], n["action_last"])):
            f.call("act_of", f"ptr %ctx, i64 %lane, i64 {segment}")
        f.leave_if(f.test("ne", n["first"], n["last"]), ready)
    set_to("start", f.load(own(f, "end", "%lane")))  # no time is earlier than those that it has seen
    set_to("active", hexadecimal(0.0))
    set_to("silent", hexadecimal(0.0))
    set_to("h", hexadecimal(0.0))
    set_to("step", hexadecimal(0.0))
    set_to("first", hexadecimal(0.0))
    set_to("last", hexadecimal(1.0))
    f.do("ret void")
    f.place(ready)
    spans = _spans(f, segment)
    for name, value in spans.items():
        set_to(name, value)
    numbers = {name: f.let(f"sitofp i64 {n[name]} to double") for name in _COUNTED}
    for name in ("steps", "first", "last"):
        set_to(name, numbers[name])
    set_to("step", numbers["first"])
    set_to("regime", numbers["regime"])
    set_to("silent", f.scalar("fsub", hexadecimal(1.0), numbers["end_slope"]))
    set_to("h", f.scalar("fdiv", f.scalar("fsub", spans["end"], spans["start"]), numbers["steps"]))
    f.do("ret void")
    m.finish(f)


def _counts(f: Function, segment: str) -> dict[str, str]:
    """The integers of a segment of a lane, by name."""
    base = f.at(f.load(own(f, "counts", "%lane"), "ptr"), f.scalar("mul", segment, str(len(COUNT))))
    return {name: f.word(base, i) for i, name in enumerate(COUNT)}


def _spans(f: Function, segment: str) -> dict[str, str]:
    """Its times, by name."""
    base = f.at(f.load(own(f, "spans", "%lane"), "ptr"), f.scalar("mul", segment, str(len(SPAN))))
    return {name: f.word(base, i, "double") for i, name in enumerate(SPAN)}


def _add_act(m: Module) -> None:
    """``act_of(ctx, lane, segment)``: what happens to a lane at the event that starts a segment; see ``act``."""
    s, lanes = m.system, m.lanes
    f = m.function("act_of", "ptr %ctx, i64 %lane, i64 %segment", attributes="nounwind noinline")
    n, t = _counts(f, "%segment"), _spans(f, "%segment")["start_eval"]
    arrays = ("w", "z", "slots", "channels", "holds", "gain", "bias", "measured", "alpha")
    w, z, slots, channels, holds, gain, bias, measured, alphas = (f.word("%ctx", WORD[name], "ptr") for name in arrays)

    def of(array: str, place: str) -> str:
        """The lane's word of an array with a row for each place."""
        return f.at(array, f.scalar("add", f.scalar("mul", place, str(lanes)), "%lane"))

    def copied(source: str, first: str, target: str, to: str, count: int) -> None:
        for i in range(count):
            value = f.load(of(source, f.scalar("add", first, str(i))))
            f.store(value, of(target, f.scalar("add", to, str(i))))

    with f.count(n["action_first"], n["action_last"]) as index:
        row = f.at(f.load(own(f, "actions", "%lane"), "ptr"), f.scalar("mul", index, str(ACTION_WORDS)))
        op, output, slot, first, last = (f.word(row, i) for i in range(ACTION_WORDS))
        held, here = f.scalar("mul", output, str(s.held.width)), f.scalar("mul", slot, str(s.width))
        with f.when(f.test("eq", op, str(TAKE))):
            f.call("channels", f"ptr %ctx, double {t}")
            copied(channels, f.scalar("mul", output, str(s.width)), slots, here, s.width)
        with f.when(f.test("eq", op, str(SET))):
            f.store(f.load(of(holds, slot)), of(w, output))
        for number in range(len(s.jumps)):
            wanted = f.test("eq", output, str(number))
            with f.when(f.let(f"and i1 {f.test('eq', op, str(JUMP))}, {wanted}")):
                f.call(f"jump{number}", f"ptr %ctx, double {t}, i64 %lane, i64 {f.scalar('add', '%lane', '1')}")
        arrives, notes = f.test("eq", op, str(ARRIVE)), f.test("eq", op, str(RECORD))
        with f.when(f.let(f"or i1 {arrives}, {notes}")):
            y = f.scalar("fmul", f.load(of(gain, slot)), f.load(of(slots, here)))
            y = f.scalar("fadd", y, f.load(of(bias, slot)))
            f.store(y, of(measured, slot))
            with f.when(arrives):
                current = f.scalar("add", held, str(Held.OUTPUT))
                copied(w, current, w, f.scalar("add", held, str(Held.PREVIOUS)), 1)
                f.store(y, of(w, current))
                copied(slots, f.scalar("add", here, "1"), w, f.scalar("add", held, str(Held.S)), s.observers)
        with f.when(f.test("eq", op, str(REBASE))), f.count(0, s.observers) as j:
            alpha_at = f.at(z, f.load(of(alphas, f.scalar("add", f.scalar("mul", output, str(s.observers)), j)), "i64"))
            alpha = f.load(alpha_at)
            f.store(hexadecimal(0.0), alpha_at)
            held_s = of(w, f.scalar("add", f.scalar("add", held, str(Held.S)), j))
            f.store(f.scalar("fadd", f.load(held_s), alpha), held_s)
            with f.count(first, last) as pending:
                place = f.scalar("add", f.scalar("add", f.scalar("mul", pending, str(s.width)), "1"), j)
                pending_s = of(slots, place)
                f.store(f.scalar("fadd", f.load(pending_s), alpha), pending_s)
    f.do("ret void")
    m.finish(f)


def _add_rows(m: Module) -> None:
    """``rows_of(ctx, lane, t0, t1, snap, z0, k0, z1, k1)``: the output points of one lane in a step; see ``rows``."""
    lanes, states = m.lanes, range(m.system.states) if m.shown is None else m.shown
    arguments = "double %t0, double %t1, double %snap, ptr %z0, ptr %k0, ptr %z1, ptr %k1"
    f = m.function("rows_of", f"ptr %ctx, i64 %lane, {arguments}", attributes="nounwind noinline")
    grid, rows = f.word("%ctx", WORD["grid"], "ptr"), f.word("%ctx", WORD["rows"], "ptr")
    place, due = own(f, "row", "%lane"), own(f, "due", "%lane")
    h = f.scalar("fsub", "%t1", "%t0")
    start, stop = f.scalar("fadd", "%t0", "%snap"), f.scalar("fsub", "%t1", "%snap")
    with f.loop() as after:
        row, t = f.load(place, "i64"), f.load(due)
        f.leave_if(f.test("oge", t, stop), after)
        target = f.at(f.at(rows, f.scalar("mul", row, str(m.row_words))), "%lane")
        on_step = f.test("ole", t, start)
        with f.when(on_step):
            for k, state in enumerate(states):
                f.store(f.load(f.at(f.at("%z0", state * lanes), "%lane")), f.at(target, k * lanes))
        with f.when(f.let(f"xor i1 {on_step}, true")):
            theta = f.scalar("fdiv", f.scalar("fsub", t, "%t0"), h)
            for k, state in enumerate(states):
                values = [f.load(f.at(f.at(array, state * lanes), "%lane")) for array in ("%z0", "%k0", "%z1", "%k1")]
                with f.wide(1):
                    value = hermite(f, theta, h, *values)
                f.store(value, f.at(target, k * lanes))
        following = f.scalar("add", row, "1")
        f.store(following, place, "i64")
        f.store(f.word(grid, following, "double"), due)
    f.do("ret void")
    m.finish(f)
