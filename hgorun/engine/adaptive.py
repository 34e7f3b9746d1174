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
from hgorun.engine.layout import (
    DONE,
    HISTORY_TOO_SHORT,
    PAUSED,
    PLANT_DIVERGED,
    STEP_TOO_SMALL,
    WORD,
)
from hgorun.engine.module import move
from hgorun.engine.stepper import Stepper, guard
from hgorun.native import functions
from hgorun.native.ir import Function, hexadecimal

_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 5.0
_SMALLEST, _SMALLEST_PART = 1e-13, 1e-30  # of |t|: below it a step changes t no more; of a segment, where t is zero
_APART = 1e4  # such steps from one jump that is stepped over to the next


def _maximum(f: Function, values: list[str]) -> str:
    """The largest of all values and lanes, as a scalar; NaN counts as infinite."""
    worst = hexadecimal(0.0)
    for value in values:
        for lane in range(f.lanes):
            one = value if f.lanes == 1 else f.let(f"extractelement {f.real} {value}, i64 {lane}")
            missing = f.let(f"fcmp uno double {one}, {one}")
            one = f.let(f"select i1 {missing}, double {hexadecimal(float('inf'))}, double {one}")
            worst = f.let(f"select i1 {f.test('ogt', one, worst)}, double {one}, double {worst}")
    return worst


def _block_errors(s: Stepper, errors: list[str], allowed: list[str]) -> list[str]:
    """The largest error over its tolerance of the plant and of each observer that has not diverged."""
    f = s.f
    ratios = []
    for error, tolerance in zip(errors, allowed, strict=True):
        size, zero = f.intrinsic("fabs", error), f.constant(0.0)
        ratios.append(f.select(f.compare("oeq", size, zero), zero, f.div(size, tolerance)))
    system = s.m.system
    worst = [_maximum(f, ratios[: system.plant_states])]
    diverged = f.word("%ctx", WORD["diverged"], "ptr")
    for j, (start, _, end) in enumerate(system.blocks):
        alive = f.compare("oeq", f.load(f.at(diverged, j * f.lanes), f.real), f.constant(float("inf")))
        worst.append(_maximum(f, [f.select(alive, r, f.constant(0.0)) for r in ratios[start:end]]))
    return worst


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
    found = _block_errors(s, errors, allowed)
    rejected = f.test("ogt", _maximum_scalar(f, found), hexadecimal(1.0))
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
        h, landing = _fit(f, wanted, f.load(real["max_step"]), f.scalar("fsub", s.end, t))
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
        worst = _maximum_scalar(f, blocks)
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
        grown = f.scalar("fmul", h, _factor(s, worst, hexadecimal(_GROW)))
        truncated = f.test("olt", h, wanted)
        f.store(
            _pick(f, f.let(f"and i1 {truncated}, {f.test('olt', grown, wanted)}"), wanted, grown),
            real["step"],
        )
        guard(f, m, t_new, s.z, lost)
        if s.decides:
            s.decide(t_clock, s.clock[1.0])
        f.jump(next_step)

        f.place(reject)
        smallest = _smallest(s, t)
        finite = f.test("olt", worst, hexadecimal(float("inf")))
        alone = f.let(f"and i1 {finite}, {f.test('oge', t, f.load(f.at('%ctx', WORD['leapt'])))}")
        shortest = f.let(f"and i1 {f.test('ole', h, smallest)}, {f.let(f'xor i1 {hopeless}, true')}")
        f.branch(f.let(f"and i1 {shortest}, {alone}"), leap, retry)
        f.place(leap)
        f.store(f.scalar("fadd", t, f.scalar("fmul", smallest, hexadecimal(_APART))), f.at("%ctx", WORD["leapt"]))
        f.jump(accept)

        f.place(retry)
        move(f, s.before, s.z, s.size)
        move(f, s.slope_before, s.slope, s.size)
        move(f, s.trace_before, s.trace, 2 * s.width // m.lanes)
        f.store(f.scalar("fmul", h, _factor(s, worst, hexadecimal(1.0))), real["step"])
        with f.when(f.let(f"or i1 {hopeless}, {f.test('ole', h, smallest)}")):
            # what fails: everything beyond its tolerance, or, of steps that are met but hopeless, the worst
            hardest = _maximum_scalar(f, blocks[1:]) if blocks[1:] else hexadecimal(0.0)
            limit = f.scalar("fmul", hardest, hexadecimal(1 - 1e-9))
            limit = _pick(f, f.test("olt", limit, hexadecimal(1.0)), limit, hexadecimal(1.0))
            f.leave_if(f.test("ugt", blocks[0], _pick(f, hopeless, hardest, hexadecimal(1.0))), small)
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


def _smallest(s: Stepper, t: str) -> str:
    """The step from t that is too short."""
    f = s.f
    limits = [
        f.scalar("fmul", s.absolute(t), hexadecimal(_SMALLEST)),
        f.scalar("fmul", f.scalar("fsub", s.end, s.start), hexadecimal(_SMALLEST_PART)),
    ]
    return _maximum_scalar(f, limits)


def _fit(f: Function, wanted: str, longest: str, left: str) -> tuple[str, str]:
    """The step to make, and whether it lands on the end: the last two steps share what is left."""
    h = _pick(f, f.test("olt", longest, wanted), longest, wanted)
    landing = f.test("oge", h, f.scalar("fmul", left, hexadecimal(1 - 1e-12)))
    half = f.scalar("fmul", left, hexadecimal(0.5))
    h = _pick(f, f.test("ogt", h, half), half, h)
    return _pick(f, landing, left, h), landing


def _pick(f: Function, condition: str, yes: str, no: str) -> str:
    return f.let(f"select i1 {condition}, double {yes}, double {no}")


def _maximum_scalar(f: Function, values: list[str]) -> str:
    worst = values[0]
    for value in values[1:]:
        worst = _pick(f, f.test("ogt", value, worst), value, worst)
    return worst


def _factor(s: Stepper, error: str, largest: str) -> str:
    """How the step changes: 0.9 error^(-1/5) between 0.2 and ``largest``."""
    f = s.f
    with f.on_lanes(1) as scalar:
        power = functions.call("pow", scalar, error, hexadecimal(-1 / s.order))
    factor = f.scalar("fmul", hexadecimal(_SAFETY), power)
    factor = _pick(f, f.test("olt", factor, largest), factor, largest)
    return _pick(f, f.test("ogt", factor, hexadecimal(_SHRINK)), factor, hexadecimal(_SHRINK))


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
