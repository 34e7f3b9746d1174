"""Members side by side whose steps are controlled: each lane has its own time, step and tables.

All lanes try a step at once. Those whose error is too large are where they were, and try a shorter one; those that have
reached the end of a segment go on to the next one. What a lane computes is what :mod:`hgorun.engine.adaptive` computes
for it alone, operation by operation. A lane that needs more steps than allowed, or for whose plant none is small
enough, ends for itself, with ``lost`` at minus infinity: whoever wants to know more of it carries it out alone.
"""

from __future__ import annotations

from collections.abc import Sequence

from hgorun.engine.allowance import note_sizes, rounding, tolerances
from hgorun.engine.flag import guard
from hgorun.engine.lane_tables import add_act_of, add_enter, add_rows_of, own
from hgorun.engine.layout import WORD, HybridSystem
from hgorun.engine.module import Module, lent, move
from hgorun.engine.step_control import APART, GROW, block_errors, factor, fit, smallest_step
from hgorun.engine.stepper import Stepper
from hgorun.native.ir import Function, hexadecimal

_REGIMES = 8  # each of them has a step of its own that is compiled


def controllable(system: HybridSystem) -> bool:
    """Whether members with controlled steps may run side by side: no histories, few regimes."""
    return not system.remembers and not system.decides and len(system.regimes) <= _REGIMES


def add_loose_adaptive(m: Module, steppers: Sequence[Stepper], *, quintic: bool) -> None:
    """``run_each(ctx)``: all lanes from the start to the end."""
    add_act_of(m)
    add_enter(m)
    add_rows_of(m, quintic=quintic)
    for stepper in steppers:
        _Try(stepper).add()
    _add_loop(m, [stepper.f.name for stepper in steppers])


def _word(f: Function, name: str) -> str:
    """A number of every lane."""
    return f.load(own(f, name), f.real)


def _both(f: Function, a: str, b: str) -> str:
    return f.let(f"and {f.mask} {a}, {b}")


def _waiting(f: Function) -> str:
    """Which lanes are not at the end of their segment."""
    on = f.compare("ogt", _word(f, "active"), f.constant(0.0))
    return _both(f, on, f.compare("olt", _word(f, "now"), _word(f, "end")))


def _give_up(f: Function, which: str) -> None:
    """End some lanes."""
    f.store(f.select(which, f.constant(0.0), _word(f, "active")), own(f, "active"), f.real)
    lost = f.word("%ctx", WORD["lost"], "ptr")
    f.store(f.select(which, f.constant(float("-inf")), f.load(lost, f.real)), lost, f.real)


def _add_loop(m: Module, tries: Sequence[str]) -> None:
    """The loop over tries; every regime has its own."""
    f = m.function("run_each", "ptr %ctx", attributes="nounwind noinline")
    slope = f.slot("double", m.system.states * m.lanes)
    with f.count(0, m.lanes) as lane:
        _enter(f, lane)
    with f.loop() as after:
        with f.count(0, m.lanes) as lane:
            on = f.test("ogt", f.load(own(f, "active", lane)), hexadecimal(0.0))
            ended = f.test("oge", f.load(own(f, "now", lane)), f.load(own(f, "end", lane)))
            with f.when(f.let(f"and i1 {on}, {ended}")):
                _enter(f, lane)
        waiting = _waiting(f)
        budget = f.splat(f.let(f"sitofp i64 {f.word('%ctx', WORD['budget'])} to double"))
        spent = _both(f, waiting, f.compare("oge", _word(f, "tries"), budget))
        with f.when(f.any(spent)):
            _give_up(f, spent)
        f.leave_if(f.let(f"xor i1 {f.any(f.compare('ogt', _word(f, 'active'), f.constant(0.0)))}, true"), after)
        for number, name in enumerate(tries):
            here = _both(f, _waiting(f), f.compare("oeq", _word(f, "regime"), f.constant(number)))
            with f.when(f.any(here)):
                f.call(name, f"ptr %ctx, ptr {slope}")
    f.do("ret void")
    m.finish(f)


def _enter(f: Function, lane: str) -> None:
    """The next segment of a lane."""
    f.call("enter", f"ptr %ctx, i64 {lane}")
    f.store(f.load(own(f, "start", lane)), own(f, "now", lane))
    f.store(hexadecimal(1.0), own(f, "fresh", lane))


class _Try:
    """One step of the lanes that are in a regime."""

    def __init__(self, s: Stepper) -> None:
        self.s, self.f, self.size = s, s.f, s.size
        f = self.f
        here = f.compare("oeq", _word(f, "regime"), f.constant(s.regime))
        self.own = _both(f, _waiting(f), here)

    def each(self, array: str, value: str, where: str) -> None:
        """Put another value into an array's first place in some lanes."""
        f = self.f
        f.store(f.select(where, value, f.load(array, f.real)), array, f.real)

    def note(self, name: str, value: str, where: str) -> None:
        """The same of a lane's word."""
        self.each(own(self.f, name), value, where)

    def add(self) -> None:
        s, f = self.s, self.f
        self._first_slope()
        t, wanted = _word(f, "now"), _word(f, "wanted")
        longest = f.splat(f.word("%ctx", WORD["max_step"], "double"))
        h, landing = fit(s, wanted, longest, f.sub(s.end, t))
        t_new = f.select(landing, s.end, f.add(t, h))
        t_clock = f.select(landing, s.end_eval, t_new)
        move(f, s.z, s.before, s.size)
        move(f, s.slope, s.slope_before, s.size)
        s.step(t, h, t_clock, t_new)
        s.slope_at_end(t_clock, s.clock[1.0])
        errors = s.errors(h)
        blocks = self._over_tolerance(h, errors)
        worst = s.largest(*blocks)
        smallest, met = smallest_step(s, t), f.compare("ole", worst, f.constant(1.0))
        missed = _both(f, self.own, f.compare("ugt", worst, f.constant(1.0)))
        shortest = _both(f, missed, f.compare("ole", h, smallest))
        finite = f.compare("olt", worst, f.constant(float("inf")))
        leap = _both(f, _both(f, shortest, finite), f.compare("oge", t, _word(f, "leapt")))
        accepted = f.let(f"or {f.mask} {_both(f, self.own, met)}, {leap}")
        stuck = _both(f, shortest, f.let(f"xor {f.mask} {leap}, {self._all}"))
        self.note("leapt", f.add(t, f.mul(smallest, f.constant(APART))), leap)
        self.note("tries", f.add(_word(f, "tries"), f.constant(1.0)), self.own)
        self._rows(accepted, t, t_new, h)
        self._sizes(errors, accepted)
        self._next_step(h, wanted, worst, accepted)
        self.note("now", t_new, accepted)
        self._settle(t_new, accepted)
        with f.when(f.any(stuck)):
            self._mask_failing(stuck, blocks, t_new, wanted)
        f.do("ret void")
        s.m.finish(f)

    @property
    def _all(self) -> str:
        """A mask that holds everywhere."""
        return "true" if self.f.lanes == 1 else f"<{', '.join(['i1 true'] * self.f.lanes)}>"

    def _first_slope(self) -> None:
        """z' at the start of a segment."""
        s, f = self.s, self.f
        fresh = _both(f, self.own, f.compare("ogt", _word(f, "fresh"), f.constant(0.0)))
        with f.when(f.any(fresh)):
            s.tick(s.start_eval, s.clock[0.0])
            s.flow_at(s.start_eval, s.clock[0.0], s.z, s.stage)
            for i in range(self.size):
                place = i * f.lanes
                self.each(f.at(s.slope, place), f.load(f.at(s.stage, place), f.real), fresh)
            self.note("fresh", f.constant(0.0), fresh)

    def _over_tolerance(self, h: str, errors: list[str]) -> list[str]:
        """Errors over their tolerances; with rounding allowed for in lanes that would be rejected without."""
        s, f = self.s, self.f
        allowed = tolerances(s)
        first = block_errors(s, errors, allowed)
        found = [f.slot("double", f.lanes) for _ in first]
        for value, place in zip(first, found, strict=True):
            f.store(value, place, f.real)
        rejected = _both(f, self.own, f.compare("ogt", s.largest(*first), f.constant(1.0)))
        unlimited = f.test("ogt", f.word("%ctx", WORD["small"], "double"), hexadecimal(0.0))
        with f.when(f.let(f"and i1 {unlimited}, {f.any(rejected)}")):
            more = [f.add(one, extra) for one, extra in zip(allowed, rounding(s, h, errors), strict=True)]
            for value, place in zip(block_errors(s, errors, more), found, strict=True):
                self.each(place, value, rejected)
        return [f.load(place, f.real) for place in found]

    def _rows(self, accepted: str, t: str, t_new: str, h: str) -> None:
        """The output points of the step."""
        s, f = self.s, self.f
        snap = s.snap(t_new, h)
        due = _both(f, accepted, f.compare("olt", _word(f, "due"), f.sub(t_new, snap)))
        with f.when(f.any(due)):
            first, last, quintic = s.interpolant(h)
            lists = [f.slot("double", f.lanes) for _ in range(4)]
            shown = f.select(due, f.constant(1.0), f.constant(0.0))
            for value, to in zip((t, t_new, snap, shown), lists, strict=True):
                f.store(value, to, f.real)
            arrays = [lent(f, array, self.size) for array in (s.before, first, s.z, last)]
            known = ", ".join(f"ptr {array}" for array in [*arrays, quintic])
            with f.count(0, f.lanes) as lane:
                begin, end, near, asked = (f.word(of, lane, "double") for of in lists)
                with f.when(f.test("ogt", asked, hexadecimal(0.0))):
                    times = f"double {begin}, double {end}, double {near}"
                    f.call("rows_of", f"ptr %ctx, i64 {lane}, {times}, {known}")

    def _sizes(self, errors: list[str], accepted: str) -> None:
        """The largest errors and states so far."""
        s, f = self.s, self.f
        zero = f.constant(0.0)
        s.note_error([f.select(accepted, error, zero) for error in errors])
        note_sizes(s, accepted)

    def _next_step(self, h: str, wanted: str, worst: str, accepted: str) -> None:
        s, f = self.s, self.f
        changed = f.mul(h, factor(s, worst, f.select(accepted, f.constant(GROW), f.constant(1.0))))
        truncated = _both(f, accepted, f.compare("olt", h, wanted))
        kept = _both(f, truncated, f.compare("olt", changed, wanted))
        self.note("wanted", f.select(kept, wanted, changed), self.own)

    def _settle(self, t_new: str, accepted: str) -> None:
        """Where the lanes are now: at the end of the step or where they were, without what has diverged."""
        s, f = self.s, self.f
        gone, zero = s.stage, f.constant(0.0)
        for i in range(self.size):
            place = i * f.lanes
            f.store(f.select(accepted, f.load(f.at(s.z, place), f.real), zero), f.at(gone, place), f.real)
        on = f.label()
        guard(f, s.m, t_new, gone, on)
        f.jump(on)  # a plant that diverges ends its own lane alone
        f.place(on)
        for i in range(self.size):
            place = i * f.lanes
            for array, new, old in ((s.z, gone, s.before), (s.slope, s.slope, s.slope_before)):
                values = [f.load(f.at(of, place), f.real) for of in (new, old)]
                f.store(f.select(accepted, *values), f.at(array, place), f.real)
        lost = f.compare("olt", f.load(f.word("%ctx", WORD["lost"], "ptr"), f.real), f.constant(float("inf")))
        self.note("active", zero, lost)

    def _mask_failing(self, stuck: str, blocks: list[str], t_new: str, wanted: str) -> None:
        """Give up the observers for which no step is small enough; with the plant, the lane."""
        s, f = self.s, self.f
        of_plant = f.compare("ugt", blocks[0], f.constant(1.0))
        _give_up(f, _both(f, stuck, of_plant))
        others = _both(f, stuck, f.let(f"xor {f.mask} {of_plant}, {self._all}"))
        self.note("wanted", wanted, others)
        diverged = f.word("%ctx", WORD["diverged"], "ptr")
        for j, ((start, _, end), error) in enumerate(zip(s.m.system.blocks, blocks[1:], strict=True)):
            failing = _both(f, others, f.compare("ugt", error, f.constant(1.0)))
            self.each(f.at(diverged, j * f.lanes), t_new, failing)
            for i in range(start, end):
                for array in (s.z, s.slope):
                    self.each(f.at(array, i * f.lanes), f.constant(float("nan")), failing)
