"""Lanes that go through tables of their own: what each has, how it enters a segment, what happens to it, its rows.

These are functions of one lane, on scalars; :mod:`hgorun.engine.loose` has the loop over steps of all lanes.
"""

from __future__ import annotations

from hgorun.engine.layout import ACTION_WORDS, ARRIVE, COUNT, JUMP, REBASE, RECORD, SET, SPAN, TAKE, WORD, Held
from hgorun.engine.module import Module
from hgorun.engine.rows import hermite
from hgorun.native.ir import Function, hexadecimal

# What each lane has of its own, one word a lane each: its tables, and where it is in them.
TABLES = ("spans", "counts", "actions", "segments")
_NUMBERS = ("step", "first", "last", "steps", "h", "silent", "active", "due", "regime")
_CONTROL = ("now", "wanted", "leapt", "tries", "fresh")  # of steps that are controlled
OWN = (*TABLES, "segment", "row", *SPAN, *_NUMBERS, *_CONTROL)
_PLACE = {name: index for index, name in enumerate(OWN)}


def own(f: Function, name: str, lane: str | int = 0) -> str:
    """Address of a word of a lane."""
    base = f.at(f.word("%ctx", WORD["own"], "ptr"), _PLACE[name] * f.lanes)
    return f.at(base, lane)


_COUNTED = ("steps", "first", "last", "end_slope", "regime")


def add_enter(m: Module) -> None:
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
    end = f.load(own(f, "end", "%lane"))
    for name in ("start", "start_eval", "end_eval"):  # no time is earlier than those that it has seen
        set_to(name, end)
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


def add_act_of(m: Module) -> None:
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


def add_rows_of(m: Module, *, quintic: bool = False) -> None:
    """``rows_of(ctx, lane, t0, t1, snap, z0, k0, z1, k1, q)``: output points of one lane in a step; see ``rows``."""
    lanes, states = m.lanes, range(m.system.states) if m.shown is None else m.shown
    arguments = "double %t0, double %t1, double %snap, ptr %z0, ptr %k0, ptr %z1, ptr %k1, ptr %q"
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
                    if quintic:
                        bump = f.mul(theta, f.sub(f.constant(1.0), theta))
                        bump = f.mul(bump, bump)
                        value = f.add(value, f.mul(bump, f.load(f.at(f.at("%q", state * lanes), "%lane"))))
                f.store(value, f.at(target, k * lanes))
        following = f.scalar("add", row, "1")
        f.store(following, place, "i64")
        f.store(f.word(grid, following, "double"), due)
    f.do("ret void")
    m.finish(f)
