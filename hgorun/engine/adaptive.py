"""The native time loop of an embedded method with error control.

A step is accepted when no state has a larger error than :mod:`hgorun.engine.allowance` allows; steps land on events.
A jump at the value of a state is met as well as times can be told apart, by one of the smallest steps, whatever its
error: that may be large for a state that has been tiny so far. Where more such steps would follow at once, equations
are singular. An observer for which no step is small enough is masked like one that has diverged; so is the one that
asks for the smallest steps when a million of them have not brought the run on by a thousandth (``hopeless`` is then
the step that it must not ask for).
"""

from __future__ import annotations

from hgorun.engine.allowance import note_sizes, rounding, tolerances
from hgorun.engine.flag import guard
from hgorun.engine.layout import (
    DONE,
    HISTORY_TOO_SHORT,
    PAUSED,
    PLANT_DIVERGED,
    STEP_TOO_SMALL,
    WORD,
)
from hgorun.engine.module import move
from hgorun.engine.step_control import APART, GROW, block_errors, factor, fit, smallest_step
from hgorun.engine.stepper import Stepper
from hgorun.native.ir import hexadecimal


def _over_tolerance(s: Stepper, h: str, errors: list[str]) -> list[str]:
    """:func:`_block_errors`; again with rounding allowed for where a step would be rejected without."""
    f = s.f
    again, settled, look = f.label(), f.label(), f.label()
    extra, looked = s.array(), f.slot("i64")
    for i in range(s.size):
        f.store(f.constant(0.0), f.at(extra, i * f.lanes), f.real)
    own = f.test("ogt", f.word("%ctx", WORD["small"], "double"), hexadecimal(0.0))
    f.store(f.let(f"zext i1 {f.let(f'xor i1 {own}, true')} to i64"), looked, "i64")
    f.jump(again)
    f.place(again)
    allowed = [f.add(one, f.load(f.at(extra, i * f.lanes), f.real)) for i, one in enumerate(tolerances(s))]
    found = block_errors(s, errors, allowed)
    rejected = f.test("ogt", s.largest(*found), hexadecimal(1.0))
    f.branch(f.let(f"and i1 {rejected}, {f.test('eq', f.load(looked, 'i64'), '0')}"), look, settled)
    f.place(look)
    for i, more in enumerate(rounding(s, h, errors)):
        f.store(more, f.at(extra, i * f.lanes), f.real)
    f.store("1", looked, "i64")
    f.jump(again)
    f.place(settled)
    return found


def add_adaptive(s: Stepper) -> None:
    """``advance<i>(ctx, segment)`` for the regime i of the stepper."""
    f, m = s.f, s.m
    real = {name: f.at("%ctx", WORD[name]) for name in ("now", "step", "max_step")}
    lost, short, small, pause = (f.label() for _ in range(4))
    move(f, s.home, s.z, s.size)
    t = f.load(real["now"])
    at_start = f.test("oeq", t, s.start)
    s.tick(f.let(f"select i1 {at_start}, double {s.start_eval}, double {t}"), s.clock[0.0])
    if s.decides:
        s.decide(f.let(f"select i1 {at_start}, double {s.start_eval}, double {t}"), s.clock[0.0])
    s.slope_at_end(f.let(f"select i1 {at_start}, double {s.start_eval}, double {t}"), s.clock[0.0], finished="1")
    with f.loop() as after:
        t = f.load(real["now"])
        f.leave_if(f.test("oge", t, s.end), after)
        budget = f.scalar("sub", f.word("%ctx", WORD["budget"]), "1")
        f.store(budget, f.at("%ctx", WORD["budget"]), "i64")
        f.leave_if(f.test("slt", budget, "0"), pause)
        wanted = f.load(real["step"])
        h, landing = fit(s, wanted, f.load(real["max_step"]), f.scalar("fsub", s.end, t))
        t_new = f.let(f"select i1 {landing}, double {s.end}, double {f.scalar('fadd', t, h)}")
        t_clock = f.let(f"select i1 {landing}, double {s.end_eval}, double {t_new}")
        move(f, s.z, s.before, s.size)
        move(f, s.slope, s.slope_before, s.size)
        move(f, s.trace, s.trace_before, 2 * s.width // m.lanes)
        s.step(t, h, t_clock, t_new)
        s.slope_at_end(t_clock, s.clock[1.0])
        if s.delayed:
            f.leave_if(f.test("sge", f.load(s.flags, "i64"), "2"), short)
        errors = s.errors(h)
        blocks = _over_tolerance(s, h, errors)
        worst = s.largest(*blocks)
        accept, reject, leap, retry, next_step = (f.label() for _ in range(5))
        hopeless = f.test("olt", wanted, f.word("%ctx", WORD["hopeless"], "double"))
        met = f.test("ole", worst, hexadecimal(1.0))
        f.branch(f.let(f"and i1 {met}, {f.let(f'xor i1 {hopeless}, true')}"), accept, reject)

        f.place(accept)
        s.rows_before(t, t_new, h)
        if s.history:
            s.keep(t, t_new, h)
        s.note_error(errors)
        note_sizes(s)
        f.store(t_new, real["now"])
        grown = f.scalar("fmul", h, factor(s, worst, GROW))
        truncated = f.test("olt", h, wanted)
        f.store(
            s.chosen(s.both(truncated, f.test("olt", grown, wanted)), wanted, grown),
            real["step"],
        )
        guard(f, m, t_new, s.z, lost)
        if s.decides:
            s.decide(t_clock, s.clock[1.0])
        f.jump(next_step)

        f.place(reject)
        smallest = smallest_step(s, t)
        finite = f.test("olt", worst, hexadecimal(float("inf")))
        alone = f.let(f"and i1 {finite}, {f.test('oge', t, f.load(f.at('%ctx', WORD['leapt'])))}")
        shortest = f.let(f"and i1 {f.test('ole', h, smallest)}, {f.let(f'xor i1 {hopeless}, true')}")
        f.branch(f.let(f"and i1 {shortest}, {alone}"), leap, retry)
        f.place(leap)
        f.store(f.scalar("fadd", t, f.scalar("fmul", smallest, hexadecimal(APART))), f.at("%ctx", WORD["leapt"]))
        f.jump(accept)

        f.place(retry)
        move(f, s.before, s.z, s.size)
        move(f, s.slope_before, s.slope, s.size)
        move(f, s.trace_before, s.trace, 2 * s.width // m.lanes)
        f.store(f.scalar("fmul", h, factor(s, worst, 1.0)), real["step"])
        with f.when(f.let(f"or i1 {hopeless}, {f.test('ole', h, smallest)}")):
            # what fails: everything beyond its tolerance, or, of steps that are met but hopeless, the worst
            hardest = s.largest(*blocks[1:]) if blocks[1:] else hexadecimal(0.0)
            limit = f.scalar("fmul", hardest, hexadecimal(1 - 1e-9))
            limit = s.chosen(f.test("olt", limit, hexadecimal(1.0)), limit, 1.0)
            f.leave_if(f.test("ugt", blocks[0], s.chosen(hopeless, hardest, 1.0)), small)
            _mask_failing(s, blocks[1:], t_new, limit)
            f.store(wanted, real["step"])
            f.store(hexadecimal(0.0), f.at("%ctx", WORD["hopeless"]))
        f.jump(next_step)
        f.place(next_step)
    move(f, s.z, s.home, s.size)
    f.do(f"ret i64 {DONE}")
    for label, verdict in ((lost, PLANT_DIVERGED), (small, STEP_TOO_SMALL), (short, HISTORY_TOO_SHORT)):
        if label != short or s.delayed:
            f.place(label)
            f.do(f"ret i64 {verdict}")
    f.place(pause)
    move(f, s.z, s.home, s.size)
    f.do(f"ret i64 {PAUSED}")
    m.finish(f)


def _mask_failing(s: Stepper, blocks: list[str], t: str, limit: str) -> None:
    """Give up the observers whose error is beyond the limit; with several lanes the whole observer."""
    f = s.f
    diverged = f.word("%ctx", WORD["diverged"], "ptr")
    for j, ((start, _, end), error) in enumerate(zip(s.m.system.blocks, blocks, strict=True)):
        with f.when(f.test("ugt", error, limit)):
            for lane in range(f.lanes):
                f.store(t, f.at(diverged, j * f.lanes + lane))
            for i in range(start, end):
                for array in (s.z, s.slope):
                    f.store(f.constant(float("nan")), f.at(array, i * f.lanes), f.real)
