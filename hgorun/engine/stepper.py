"""One step of a method, as native code: what the fixed and adaptive loops share, whatever the method."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property

from hgorun.engine.emit import Emitted
from hgorun.engine.history import REFINEMENTS, History
from hgorun.engine.lane_tables import own
from hgorun.engine.layout import SPAN, WORD
from hgorun.engine.module import Module, each, lent, move, span
from hgorun.engine.moments import Moments
from hgorun.engine.rows import add_row
from hgorun.native.ir import Function

_AT_ONCE = 64  # numbers of a row that are copied one by one


class Stepper(Moments, ABC):
    """The state of a loop over steps: its arrays, and the code that advances them; a kind of method completes it.

    Attributes
    ----------
    z, before : str
        State at the end and at the start of the step.
    slope, slope_before : str
        f at the end and at the start.
    clock : dict of float to str
        Clocked values at each stage time, 0 and 1 being the ends of the step.
    trace, trace_before : str
        Channels and their slopes at the end and the start, where there is a history.
    """

    in_place = False  # whether the step overwrites the state and the slope at its start
    room = 0  # places behind the state at the start, for what a method adds to it
    order: int
    roundings: float  # of z' and of the method's own sums, in units of 2^-52

    def __init__(
        self, m: Module, c: tuple[float, ...], history: History | None, regime: int, flow: Emitted, name: str
    ) -> None:
        self.m, self.history, self.regime, self.flow = m, history, regime, flow
        self.delayed = bool(m.system.regimes[regime].delayed)
        self.size, lanes = m.system.states, m.lanes
        self.f = f = self._function(name)
        self.start, self.end, self.start_eval, self.end_eval = self._span()
        self.p, self.w, self.home = (f.word("%ctx", WORD[name], "ptr") for name in ("p", "w", "z"))
        self.c = m.constants_of(f, flow)
        self.z, self.slope = (self.home, "%slope") if m.loose else (self.array(), self.array())
        self.slope_before, self.stage = self.array(), self.array()
        self.before = f.slot("double", self.words + self.room * lanes)
        self.clock = {at: f.slot("double", flow.clocked * lanes) for at in sorted({0.0, 1.0, *c})}
        self.width = history.width if history else 0
        self.trace, self.trace_before = (f.slot("double", 2 * self.width) for _ in range(2))
        self.flags, self.passes = f.slot("i64"), f.slot("i64")
        f.store("0", self.flags, "i64")

    def _function(self, name: str) -> Function:
        """All steps of a segment, or one step of lanes that have times of their own."""
        if self.m.loose:
            return self.m.function(name, "ptr %ctx, ptr %slope", attributes="nounwind noinline")
        return self.m.function(name, "ptr %ctx, i64 %segment", returns="i64", attributes="nounwind noinline")

    def _span(self) -> tuple[str, ...]:
        """The times of the segment, or of that of every lane."""
        if self.m.loose:
            return tuple(self.f.load(own(self.f, name), self.m.time) for name in SPAN)
        return span(self.f, "%segment")

    @property
    def decides(self) -> bool:
        """Whether anything is decided at the ends of steps."""
        return self.m.system.regimes[self.regime].decision is not None

    @cached_property
    def _decided(self) -> tuple[Emitted, str, str]:
        """The decision's function, and memory for its values and for what it needs of time."""
        decision = self.m.system.regimes[self.regime].decision
        assert decision is not None
        emitted = self.m.emit(decision.function, f"decision{self.regime}")
        new, tau = (self.f.slot("double", count * self.m.lanes) for count in (len(decision.places), emitted.clocked))
        return emitted, new, tau

    def decide(self, t: str, clock: str) -> None:
        """What is decided at t, on the state there; where the flow reads what has changed, the slope is new.

        ``clock`` has the clocked values at t.
        """
        f, regime = self.f, self.m.system.regimes[self.regime]
        assert regime.decision is not None
        emitted, new, tau = self._decided
        self.look_up(t, finished="1")
        constants = self.m.constants_of(f, emitted)
        emitted.clock(f, t, self.p, constants, tau)
        emitted.main(f, self.p, constants, tau, self.z, self.w, new)
        changed = []
        for i, state in enumerate(regime.decision.places):
            value, place = f.load(f.at(new, i * f.lanes), f.real), f.at(self.z, state * f.lanes)
            if state in regime.deciding:
                changed.append(f.any(f.compare("une", value, f.load(place, f.real))))
            f.store(value, place, f.real)
        for condition in changed:
            with f.when(condition):
                self.slope_at_end(t, clock, finished="1")

    @property
    def words(self) -> int:
        """Of an array of one value a state."""
        return self.size * self.m.lanes

    def array(self) -> str:
        """Memory for a value a state."""
        return self.f.slot("double", self.words)

    @abstractmethod
    def stages(self, t: str, h: str, t_end: str) -> None:
        """The stages after f at the start, and the step: from ``before`` and ``slope_before`` to ``z``."""

    @property
    def ends_at_end(self) -> bool:
        """Whether the last thing that a step evaluates is a slope at its end."""
        return False

    @abstractmethod
    def errors(self, h: str) -> list[str]:
        """The embedded error estimate of every state; nothing where the method has none."""

    @abstractmethod
    def interpolant(self, h: str) -> tuple[str, str, str]:
        """Slopes at the start and at the end of the step, and q, that give values inside; see ``add_rows``."""

    @abstractmethod
    def step_of(self, rate: str, h: str) -> list[str]:
        """What a disturbance of z' makes of every state in a step."""

    def tick(self, t: str, tau: str) -> None:
        """What depends on time alone, at t."""
        self.flow.clock(self.f, t, self.p, self.c, tau)

    def look_up(self, t: str, *, finished: str = "0", target: str = "") -> None:
        """What is delayed at t, for w or for a ``target``.

        ``finished``: "1" where no step is being made whose provisional piece may be used.
        """
        f = self.f
        if self.delayed:
            assert self.history is not None
            newest = f.scalar("sub", f.word("%ctx", WORD["ring_count"]), finished)
            self.history.look_up(f, self.regime, t, newest, self.flags, target)

    def flow_at(self, t: str, tau: str, z: str, target: str, *, finished: str = "0", known: bool = False) -> None:
        """z' at (t, z); ``finished`` as in :meth:`look_up`, ``known`` where what is delayed at t stands in w."""
        f = self.f
        if not known:
            self.look_up(t, finished=finished)
        self.flow.main(f, self.p, self.c, tau, z, self.w, target)

    def slope_at_end(self, t: str, tau: str, *, finished: str = "0", known: str = "false") -> None:
        """The slope at the end of the step, and the channels there; arguments as of :meth:`flow_at`."""
        if self.delayed:
            with self.f.when(self.f.let(f"xor i1 {known}, true")):
                self.look_up(t, finished=finished)
        self.flow_at(t, tau, self.z, self.slope, known=True)
        if self.history:
            self.history.follow(self.f, t, self.z, self.slope, self.trace)

    def near(self, h: str) -> str:
        """Whether delays may look into a step of length h."""
        if not self.delayed:
            return "false"
        assert self.history is not None
        return self.history.near(self.f, self.regime, h)

    def step(self, t: str, h: str, t_end: str, t_end_exact: str, near: str | None = None) -> None:
        """All stages after the first, and the step; again while delays look into it, as where they are ``near``."""
        f = self.f
        near = near or self.near(h)
        if self.delayed:
            f.store("0", self.flags, "i64")
            f.store("0", self.passes, "i64")
            with f.when(near):
                self._straight_line(h)
            again, settled = f.label(), f.label()
            f.jump(again)
            f.place(again)
            with f.when(near):
                self.remember(t, t_end_exact)
        self.stages(t, h, t_end)
        if self.delayed:
            passes = f.scalar("add", f.load(self.passes, "i64"), "1")
            f.store(passes, self.passes, "i64")
            outcome = f.test("eq", f.load(self.flags, "i64"), "1")
            refine = f.label()
            f.branch(f.let(f"and i1 {outcome}, {f.test('sle', passes, str(REFINEMENTS))}"), refine, settled)
            f.place(refine)
            end_clock = f.slot("double", self.flow.clocked * self.m.lanes)
            self.tick(t_end, end_clock)
            self.flow_at(t_end, end_clock, self.z, self.slope)
            self.history.follow(f, t_end, self.z, self.slope, self.trace)  # type: ignore[union-attr]  # callers have one
            if self.in_place:
                move(f, self.before, self.z, self.size)
                move(f, self.slope_before, self.slope, self.size)
            f.store("0", self.flags, "i64")
            f.jump(again)
            f.place(settled)

    def remember(self, t: str, t_end: str) -> str:
        """Write the step as the newest piece of history; its number."""
        f = self.f
        count = f.word("%ctx", WORD["ring_count"])
        f.call("remember_start", f"ptr %ctx, i64 {count}, double {t}, ptr {self.trace_before}")
        f.call("remember_end", f"ptr %ctx, i64 {count}, double {t_end}, ptr {self.trace}")
        return count

    def keep(self, t: str, t_end: str, h: str) -> None:
        """Add the step to the history."""
        f = self.f
        if self.in_place:
            count = f.word("%ctx", WORD["ring_count"])
            f.call("remember_end", f"ptr %ctx, i64 {count}, double {t_end}, ptr {self.trace}")
        else:
            count = self.remember(t, t_end)
        f.store(f.scalar("add", count, "1"), f.at("%ctx", WORD["ring_count"]), "i64")

    def begin(self, t: str) -> None:
        """Write the start of the next piece of history, where :meth:`keep` writes its end alone."""
        if self.history and self.in_place:
            count = self.f.word("%ctx", WORD["ring_count"])
            self.f.call("remember_start", f"ptr %ctx, i64 {count}, double {t}, ptr {self.trace}")

    def _straight_line(self, h: str) -> None:
        """The provisional end of a step's piece of history: values go on at their slope."""
        f = self.f
        for i in each(f, self.width):
            j = i + self.width if isinstance(i, int) else f.scalar("add", i, str(self.width))
            value, slope = f.word(self.trace_before, i, "double"), f.word(self.trace_before, j, "double")
            f.store(f.scalar("fadd", value, f.scalar("fmul", h, slope)), f.at(self.trace, i))
            f.store(slope, f.at(self.trace, j))

    def note_error(self, errors: list[str]) -> None:
        """Keep the largest local error estimate of each state."""
        f = self.f
        base = f.word("%ctx", WORD["error"], "ptr")
        for i, error in enumerate(errors):
            place = f.at(base, i * f.lanes)
            size, old = f.intrinsic("fabs", error), f.load(place, f.real)
            f.store(f.select(f.compare("ogt", size, old), size, old), place, f.real)

    def hold(self, t1: str, h: str, near: str) -> None:
        """Keep the start of a step that ends at t1.

        Where the step overwrites it that is for output points alone, and for delays that are ``near``.
        """
        f = self.f
        if self.in_place:
            due = self._due(t1)[0]
            with f.when(f.let(f"or i1 {due}, {near}")):
                move(f, self.z, self.before, self.size)
                move(f, self.slope, self.slope_before, self.size)
                if self.delayed:
                    move(f, self.trace, self.trace_before, 2 * self.width // self.m.lanes)
            return
        move(f, self.z, self.before, self.size)
        move(f, self.slope, self.slope_before, self.size)
        move(f, self.trace, self.trace_before, 2 * self.width // self.m.lanes)

    def _due(self, t1: str) -> tuple[str, str]:
        """Whether there may be an output point in the step that ends at t1, and when the next one is."""
        f = self.f
        due = f.word(f.word("%ctx", WORD["grid"], "ptr"), f.word("%ctx", WORD["row"]), "double")
        return f.test("olt", due, t1), due

    def rows_before(self, t0: str, t1: str, h: str) -> None:
        """The output points of the step, when there are any that are not rather at its end."""
        f = self.f
        near, due = self._due(t1)
        after, shown = f.label(), f.label()
        f.branch(near, shown, after)
        f.place(shown)
        snap = self.snap(t1, h)
        stop = f.scalar("fsub", t1, snap)
        if self.words <= _AT_ONCE:  # one at the start of the step, as most are, takes no call
            full = f.word("%ctx", WORD["full"], "ptr")
            at_start = f.let(f"and i1 {f.test('ole', due, f.scalar('fadd', t0, snap))}, {f.test('olt', due, stop)}")
            with f.when(f.let(f"and i1 {at_start}, {f.let(f'icmp eq ptr {full}, null')}")):
                add_row(f, self.m, self.before)
            due = self._due(t1)[1]
        with f.when(f.test("olt", due, stop)):
            first, last, quintic = self.interpolant(h)
            known = [lent(f, array, self.size) for array in (self.before, first, self.z, last)]
            f.call(
                "rows",
                f"ptr %ctx, double {t0}, double {t1}, double {snap}, "
                + ", ".join(f"ptr {array}" for array in [*known, quintic]),
            )
        f.jump(after)
        f.place(after)
