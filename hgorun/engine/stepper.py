"""One step of an explicit Runge-Kutta method, as native code: what the fixed and adaptive loops share."""

from __future__ import annotations

from hgorun.engine.emit import Emitted
from hgorun.engine.history import REFINEMENTS, History
from hgorun.engine.layout import WORD
from hgorun.engine.methods import Method, Row
from hgorun.engine.parts import Module, span
from hgorun.native.ir import Function, hexadecimal


def weighted(f: Function, weights: tuple[float, ...], slopes: list[str], place: int) -> str:
    """sum_j weights[j] slopes[j] of one state; weights of one cost no multiplication."""
    total = ""
    for weight, slope in zip(weights, slopes, strict=False):
        if weight != 0.0:
            term = f.load(f.at(slope, place), f.real)
            term = term if weight == 1.0 else f.mul(f.constant(weight), term)
            total = f.add(total, term) if total else term
    return total


def combine(f: Function, row: Row, h: str, z: str, slopes: list[str], target: str, size: int) -> None:
    """target = z + h scale sum_j weights[j] slopes[j], unrolled over the state."""
    factor = f.splat(h if row.scale == 1.0 else f.scalar("fmul", h, hexadecimal(row.scale)))
    for i in range(size):
        place = i * f.lanes
        step = f.mul(factor, weighted(f, row.weights, slopes, place))
        f.store(f.add(f.load(f.at(z, place), f.real), step), f.at(target, place), f.real)


def guard(f: Function, m: Module, t: str, z: str, lost: str) -> None:
    """Grow the largest |x| so far and mask what has left the bound; leave to ``lost`` with the plant."""
    s, lanes = m.system, m.lanes
    largest_at = f.word("%ctx", WORD["largest"], "ptr")
    largest = f.load(largest_at, f.real)
    sizes = [f.intrinsic("fabs", f.load(f.at(z, i * lanes), f.real)) for i in range(s.states)]
    for i in range(s.plant_states):
        largest = f.select(f.compare("ogt", sizes[i], largest), sizes[i], largest)
    f.store(largest, largest_at, f.real)
    bound = f.add(
        f.splat(f.word("%ctx", WORD["bound_offset"], "double")),
        f.mul(f.splat(f.word("%ctx", WORD["bound_factor"], "double")), largest),
    )
    limit = f.constant(1e300)
    bad = [f.compare("ugt", sizes[i], limit) for i in range(s.plant_states)]
    bad += [f.compare("ugt", sizes[i], bound) for start, stop, _ in s.blocks for i in range(start, stop)]
    while len(bad) > 1:  # a tree: short chains of dependence
        pairs = [f.let(f"or {f.mask} {a}, {b}") for a, b in zip(bad[::2], bad[1::2], strict=False)]
        bad = pairs + bad[len(bad) - len(bad) % 2 :]
    with f.when(f.any(bad[0])):
        bounds = f.slot("double", lanes)
        f.store(bound, bounds, f.real)
        verdict = f.call("flag", f"ptr %ctx, double {t}, ptr {z}, ptr {bounds}", "i64")
        f.leave_if(f.test("eq", verdict, "1"), lost)


class Stepper:
    """The state of a loop over steps: its arrays, and the code that advances them.

    Attributes
    ----------
    z, before : str
        State at the end and at the start of the step.
    k : list of str
        Slopes of the stages; ``slope`` is the one at the end of the step.
    clock : dict of float to str
        Clocked values at each stage time, 0 and 1 being the ends of the step.
    trace, trace_before : str
        Channels and their slopes at the end and the start, where there is a history.
    """

    def __init__(
        self, m: Module, method: Method, history: History | None, regime: int, flow: Emitted, name: str
    ) -> None:
        self.m, self.method, self.history, self.regime, self.flow = m, method, history, regime, flow
        self.delayed = bool(m.system.regimes[regime].delayed)
        self.size, lanes = m.system.states, m.lanes
        self.f = f = m.function(name, "ptr %ctx, i64 %segment", returns="i64", attributes="nounwind noinline")
        self.start, self.end, self.start_eval, self.end_eval = span(f, "%segment")
        self.p, self.w, self.home = (f.word("%ctx", WORD[name], "ptr") for name in ("p", "w", "z"))
        self.c = m.constants_of(f, flow)
        self.z, self.before, self.slope, self.stage = (f.slot("double", self.size * lanes) for _ in range(4))
        self.k = [f.slot("double", self.size * lanes) for _ in range(len(method.stages) + 1)]
        self.clock = {c: f.slot("double", flow.clocked * lanes) for c in sorted({0.0, 1.0, *method.c})}
        self.width = history.width if history else 0
        self.trace, self.trace_before = (f.slot("double", 2 * self.width) for _ in range(2))
        self.flags, self.passes = f.slot("i64"), f.slot("i64")
        f.store("0", self.flags, "i64")

    def absolute(self, scalar: str) -> str:
        """|x| of a scalar."""
        self.m.declarations.add("declare double @llvm.fabs.f64(double)")
        return self.f.let(f"call double @llvm.fabs.f64(double {scalar})")

    def tick(self, t: str, tau: str) -> None:
        """What depends on time alone, at t."""
        self.flow.clock(self.f, t, self.p, self.c, tau)

    def flow_at(self, t: str, tau: str, z: str, target: str, *, finished: str = "0") -> None:
        """z' at (t, z); ``finished``: "1" where no step is being made whose provisional piece may be used."""
        f = self.f
        if self.delayed:
            assert self.history is not None
            newest = f.scalar("sub", f.word("%ctx", WORD["ring_count"]), finished)
            self.history.look_up(f, self.regime, t, newest, self.flags)
        self.flow.main(f, self.p, self.c, tau, z, self.w, target)

    def slope_at_end(self, t: str, tau: str, *, finished: str = "0") -> None:
        """The slope at the end of the step, and the channels there; ``finished`` as in :meth:`flow_at`."""
        self.flow_at(t, tau, self.z, self.slope, finished=finished)
        if self.history:
            self.history.follow(self.f, t, self.z, self.slope, self.trace)

    def step(self, t: str, h: str, t_end: str, t_end_exact: str) -> None:
        """All stages after the first, and the step; again while delays look into the step itself."""
        f = self.f
        if self.delayed:
            assert self.history is not None
            f.store("0", self.flags, "i64")
            f.store("0", self.passes, "i64")
            self._straight_line(h)
            again, settled = f.label(), f.label()
            f.jump(again)
            f.place(again)
            self.remember(t, t_end_exact)
        self._stages(t, h, t_end)
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
            self.history.follow(f, t_end, self.z, self.slope, self.trace)  # type: ignore[union-attr]
            f.store("0", self.flags, "i64")
            f.jump(again)
            f.place(settled)

    def _stages(self, t: str, h: str, t_end: str) -> None:
        f, method = self.f, self.method
        ticked = {0.0}
        for c, row, target in zip(method.c[1:], method.stages, self.k[1:], strict=True):
            t_stage = t_end if c == 1.0 else f.scalar("fadd", t, f.scalar("fmul", h, hexadecimal(c)))
            if c not in ticked:
                self.tick(t_stage, self.clock[c])
                ticked.add(c)
            combine(f, row, h, self.before, self.k, self.stage, self.size)
            self.flow_at(t_stage, self.clock[c], self.stage, target)
        combine(f, method.result, h, self.before, self.k, self.z, self.size)
        if 1.0 not in ticked:
            self.tick(t_end, self.clock[1.0])

    def remember(self, t: str, t_end: str) -> str:
        """Write the step as the newest piece of history; its number."""
        f = self.f
        count = f.word("%ctx", WORD["ring_count"])
        f.call(
            "remember",
            f"ptr %ctx, i64 {count}, double {t}, double {t_end}, ptr {self.trace_before}, ptr {self.trace}",
        )
        return count

    def _straight_line(self, h: str) -> None:
        """The provisional end of a step's piece of history: values go on at their slope."""
        f = self.f
        with f.count(0, self.width) as i:
            j = f.scalar("add", i, str(self.width))
            value, slope = f.word(self.trace_before, i, "double"), f.word(self.trace_before, j, "double")
            f.store(f.scalar("fadd", value, f.scalar("fmul", h, slope)), f.at(self.trace, i))
            f.store(slope, f.at(self.trace, j))

    def embedded(self, weights: tuple[float, ...], h: str, i: int) -> str:
        """h sum_j weights[j] k_j of state i, the last k being the slope at the end of the step."""
        f = self.f
        return f.mul(f.splat(h), weighted(f, weights, [*self.k, self.slope], i * f.lanes))

    def note_error(self, errors: list[str]) -> None:
        """Keep the largest local error estimate of each state."""
        f = self.f
        base = f.word("%ctx", WORD["error"], "ptr")
        for i, error in enumerate(errors):
            place = f.at(base, i * f.lanes)
            size, old = f.intrinsic("fabs", error), f.load(place, f.real)
            f.store(f.select(f.compare("ogt", size, old), size, old), place, f.real)

    def rows_before(self, t0: str, t1: str, h: str) -> None:
        """The output points of the step, when there are any."""
        f = self.f
        size_of = self.absolute(self.end)
        snap = f.scalar("fadd", f.scalar("fmul", h, hexadecimal(1e-9)), f.scalar("fmul", size_of, hexadecimal(1e-15)))
        due = f.word(f.word("%ctx", WORD["grid"], "ptr"), f.word("%ctx", WORD["row"]), "double")
        with f.when(f.test("olt", due, f.scalar("fsub", t1, snap))):
            quintic = "null"
            if self.method.dense:
                quintic = f.slot("double", self.size * f.lanes)
                for i in range(self.size):
                    f.store(self.embedded(self.method.dense, h, i), f.at(quintic, i * f.lanes), f.real)
            f.call(
                "rows",
                f"ptr %ctx, double {t0}, double {t1}, double {snap}, ptr {self.before}, ptr {self.k[0]}, "
                f"ptr {self.z}, ptr {self.slope}, ptr {quintic}",
            )
