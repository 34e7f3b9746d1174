"""Members side by side whose events are at other times: each lane goes through tables of its own.

All lanes make a step at once, each with its own time and length of step. A lane that has reached the end of a segment
goes on to the next one, with what happens at the event between them, while the others wait. What a lane computes is
what :mod:`hgorun.engine.fixed` computes for it alone, operation by operation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hgorun.engine.emit import Emitted
from hgorun.engine.flag import guard
from hgorun.engine.lane_tables import add_act_of, add_enter, add_rows_of, own
from hgorun.engine.layout import WORD, HybridSystem
from hgorun.engine.methods import Method, Rosenbrock
from hgorun.engine.module import Module, move
from hgorun.engine.moments import ROUNDING, SNAP
from hgorun.engine.sums import advanced
from hgorun.native.ir import hexadecimal

_REGIMES = 4  # each of them is in the code of every stage


def fits(system: HybridSystem, method: Method | Rosenbrock) -> bool:
    """Whether members may go through tables of their own: no histories, few regimes, no estimate of the error."""
    plain = isinstance(method, Method) and not method.error and not method.dense
    return plain and not system.remembers and not system.decides and len(system.regimes) <= _REGIMES


def add_loose(m: Module, method: Method, flows: Sequence[Emitted]) -> None:
    """``run_each(ctx)``: all lanes from the start to the end."""
    add_act_of(m)
    add_enter(m)
    add_rows_of(m)
    _Loop(m, method, flows).add()


def _part(c: float) -> float:
    """The part of a step with whose clocked values those at another are kept: its start is the end of the last one."""
    return 1.0 if c == 0.0 else c


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
        parts = {_part(c) for c in method.c}
        self.clock = {(flow.name, c): f.slot("double", flow.clocked * lanes) for flow in flows for c in parts}
        self.ticked = {key: f.slot("double", lanes) for key in self.clock}  # the times that these values are of
        for at in self.ticked.values():
            f.store(f.constant(float("nan")), at, f.real)

    def read(self, name: str) -> str:
        """A number of all lanes."""
        return self.f.load(own(self.f, name), self.f.real)

    def holds(self, name: str) -> str:
        return self.f.compare("ogt", self.read(name), self.f.constant(0.0))

    def differ(self, a: str, b: str) -> str:
        """Where numbers are not the same to the last bit."""
        return self.f.let(f"icmp ne {self.f.integer} {self.f.bits(a)}, {self.f.bits(b)}")

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
        return f.add(f.mul(self.read("h"), f.constant(SNAP)), f.mul(largest, f.constant(ROUNDING)))

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
                        f.call("rows_of", f"ptr %ctx, i64 {lane}, {times}, {arrays}, ptr null")
                    if enter:
                        f.call("enter", f"ptr %ctx, i64 {lane}")

    def first_slope(self) -> None:
        """The slope at the start of the steps."""
        self.tick({0.0: self.clocked(self.read("step"))})
        self.flow_at(0.0, self.z, self.slope)

    def tick(self, times: Mapping[float, str]) -> None:
        """What depends on time alone, at some parts of a step one after the other: none of them waits for another."""
        f, m = self.f, self.m
        for number, flow in enumerate(self.flows):
            if not flow.clocked:
                continue
            constants = m.constants_of(f, flow)
            with f.when(f.any(self.in_regime(number))):
                for c, t in times.items():
                    tau, at = self.clock[flow.name, _part(c)], self.ticked[flow.name, _part(c)]
                    # where a step begins, no lane needs it anew but those that come from an event
                    with f.when(f.any(self.differ(t, f.load(at, f.real)))):
                        flow.clock(f, t, self.p, constants, tau)
                        f.store(t, at, f.real)

    def in_regime(self, number: int) -> str:
        """Which lanes are in a regime."""
        return self.f.compare("oeq", self.read("regime"), self.f.constant(number))

    def flow_at(self, c: float, z: str, target: str) -> None:
        """z' at z in all lanes, c being the part of the step at which that is, with the clocked values of there."""
        f, m = self.f, self.m
        last = len(self.flows) - 1
        for number, flow in reversed(list(enumerate(self.flows))):
            constants, tau = m.constants_of(f, flow), self.clock[flow.name, _part(c)]
            if number == last == 0:
                flow.main(f, self.p, constants, tau, z, self.w, target)
                return
            own = self.in_regime(number)
            with f.when(f.any(own)):
                if number == last:  # most lanes are in it most of the time: the others are put in afterwards
                    flow.main(f, self.p, constants, tau, z, self.w, target)
                    continue
                flow.main(f, self.p, constants, tau, z, self.w, self.found)
                for i in range(self.size):
                    new, place = f.load(f.at(self.found, i * f.lanes), f.real), f.at(target, i * f.lanes)
                    f.store(f.select(own, new, f.load(place, f.real)), place, f.real)

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
            guard(f, m, t_end, self.z, after)  # a plant that diverges ends its own lane alone, and not the loop
            f.store(f.select(self.holds("active"), following, self.read("step")), own(f, "step"), f.real)
        f.do("ret void")
        m.finish(f, "dso_local")

    def step(self, following: str) -> None:
        """From z and the slope there to z at the end of the step, in the lanes that are not at their end."""
        f, method = self.f, self.method
        t, h, late = self.exact(self.read("step")), self.read("h"), self.clocked(following)
        self.tick({c: late if c == 1.0 else f.add(t, f.mul(h, f.constant(c))) for c in dict.fromkeys(method.c[1:])})
        for c, row, target in zip(method.c[1:], method.stages, self.k[1:], strict=True):
            self.combine(row.weights, row.scale, self.stage)
            self.flow_at(c, self.stage, target)
        self.combine(method.result.weights, method.result.scale, self.z)

    def combine(self, weights: tuple[float, ...], scale: float, target: str) -> None:
        """target = z + h scale sum_j weights[j] k[j]; where that is z, of lanes that go on."""
        f, h, active = self.f, self.read("h"), self.holds("active")
        factor = h if scale == 1.0 else f.mul(h, f.constant(scale))
        for i in range(self.size):
            place = i * f.lanes
            new = advanced(f, factor, weights, self.k, self.z, place)
            if target == self.z:
                new = f.select(active, new, f.load(f.at(self.z, place), f.real))
            f.store(new, f.at(target, place), f.real)
