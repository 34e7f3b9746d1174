"""The native time loop of a method with fixed steps.

One function a regime makes all steps of a segment: from the event at its start to the event at its end
nothing happens but the flow. The slope at the end of a step is the first slope of the next one; it also
gives the output points in between and the history for continuous delays.
"""

from __future__ import annotations

from hgorun.engine.flag import guard
from hgorun.engine.layout import DONE, HISTORY_TOO_SHORT, PLANT_DIVERGED, WORD
from hgorun.engine.module import counts, move
from hgorun.engine.stepper import Stepper


def add_fixed(s: Stepper) -> None:
    """``advance<i>(ctx, segment)`` for the regime i of the stepper."""
    f, m = s.f, s.m
    n = counts(f, "%segment")
    gap, length = f.scalar("fsub", s.end, s.start), f.slot("double")
    f.store(gap, length)
    with f.when(f.test("ne", n["steps"], "1")):  # a division by 1 takes as long as any
        f.store(f.scalar("fdiv", gap, f.let(f"sitofp i64 {n['steps']} to double")), length)
    h = f.load(length)

    def exact(step: str) -> str:
        """When step number ``step`` starts."""
        inside = f.scalar("fadd", s.start, f.scalar("fmul", f.let(f"sitofp i64 {step} to double"), h))
        return f.let(f"select i1 {f.test('eq', step, n['steps'])}, double {s.end}, double {inside}")

    def clocked(step: str) -> str:
        """The same, where functions of time are evaluated: on this segment's side of its events."""
        late = f.let(f"select i1 {f.test('eq', step, n['steps'])}, double {s.end_eval}, double {exact(step)}")
        return f.let(f"select i1 {f.test('eq', step, '0')}, double {s.start_eval}, double {late}")

    lost, short = f.label(), f.label()
    move(f, s.home, s.z, s.size)
    at, start, start_clock, before = f.slot("i64"), f.slot("double"), f.slot("double"), f.slot("double")
    f.store(n["first"], at, "i64")
    f.store(exact(n["first"]), start)
    f.store(exact(n["first"]), before)
    f.store(clocked(n["first"]), start_clock)
    s.tick(clocked(n["first"]), s.clock[0.0])
    silent_end, near = f.test("eq", n["end_slope"], "0"), s.near(h)
    with f.loop() as after:
        step, t, t_clock, t_before = f.load(at, "i64"), f.load(start), f.load(start_clock), f.load(before)
        is_last, is_first = f.test("eq", step, n["last"]), f.test("eq", step, n["first"])
        skipped = f.let(f"and i1 {is_last}, {silent_end}")
        if s.decides:
            with f.when(is_first):
                s.decide(t_clock, s.clock[0.0])
        with f.when(f.let(f"xor i1 {skipped}, true")):
            # the last stage has looked up the same, unless that was provisional
            known = f.test("eq", f.load(s.flags, "i64"), "0") if s.delayed and s.ends_at_end else "false"
            known = f.let(f"select i1 {is_first}, i1 false, i1 {known}")
            s.slope_at_end(t_clock, s.clock[0.0], finished=f.let(f"zext i1 {is_first} to i64"), known=known)
        with f.when(f.let(f"xor i1 {is_first}, true")):
            s.rows_before(t_before, t, h)
            if s.history:
                s.keep(t_before, t, h)
            s.note_error(s.errors(h))
            if s.decides:
                s.decide(t_clock, s.clock[0.0])
        f.leave_if(is_last, after)
        following = f.scalar("add", step, "1")
        t_end, t_end_clock = exact(following), clocked(following)
        s.hold(t_end, h, near)
        s.begin(t)
        s.step(t, h, t_end_clock, t_end, near)
        move(f, s.clock[1.0], s.clock[0.0], s.flow.clocked)
        if s.delayed:
            f.leave_if(f.test("sge", f.load(s.flags, "i64"), "2"), short)
        f.store(following, at, "i64")
        for value, slot in ((t_end, start), (t_end_clock, start_clock), (t, before)):
            f.store(value, slot)
        guard(f, m, t_end, s.z, lost)
    move(f, s.z, s.home, s.size)
    f.do(f"ret i64 {DONE}")
    f.place(lost)
    move(f, s.z, s.home, s.size)
    f.store(exact(f.load(at, "i64")), f.at("%ctx", WORD["now"]))
    f.do(f"ret i64 {PLANT_DIVERGED}")
    if s.delayed:
        f.place(short)
        f.store(t, f.at("%ctx", WORD["now"]))
        f.do(f"ret i64 {HISTORY_TOO_SHORT}")
    m.finish(f)
