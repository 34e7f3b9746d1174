"""Memory for continuous delays: one ring of steps, each a cubic Hermite piece of every channel.

A piece is (t0, t1, s(t0), s'(t0+), s(t1), s'(t1-)): the slopes are one-sided, since s' jumps at events.
Before the start of the run everything is constant. A delay shorter than the step looks into the step that
is being made: that piece is provisional, a straight line at first, then what the step itself gave, in at most
REFINEMENTS passes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import casadi as ca

from hgorun.engine.layout import WORD, Regime
from hgorun.engine.module import Module, copy, each
from hgorun.engine.rows import hermite, hermite_slope
from hgorun.native.ir import Function, hexadecimal

_FEW = 4  # delayed outputs, over all regimes, for each of which the code of looking up stands wherever it is needed
_TOGETHER = 16  # channels of an output that are looked up in vectors
_FAR = 1 + 1e-9  # steps: a delay as long as that looks into finished ones only, in spite of rounding
REFINEMENTS = 4  # passes of a step whose delays reach into it; each one gains an order


def piece_words(channels: int, lanes: int) -> int:
    """Words of one piece of history."""
    return 2 + 4 * channels * lanes


def _powers(count: int) -> Iterator[tuple[int, int]]:
    """So many numbers in parts of powers of two: the first of each, and how many it has."""
    first = 0
    while first < count:
        size = 1 << ((count - first).bit_length() - 1)
        yield first, size
        first += size


def _passing(regime: Regime) -> ca.Function:
    """1 - d'(t): how fast the past of each output passes by."""
    assert regime.lags is not None
    t, *others = (ca.SX.sym(regime.lags.name_in(i), *regime.lags.size_in(i)) for i in range(4))
    return ca.Function("passing", [t, *others], [ca.densify(1 - ca.jacobian(regime.lags(t, *others), t))])


class History:
    """Emits the native functions of the history and the calls to them."""

    def __init__(self, m: Module, *, slopes: bool = False) -> None:
        self.m = m
        self.width = m.system.outputs * m.system.width * m.lanes
        self.trace = m.emit(m.system.channel_slopes, "trace")
        late = [(number, regime) for number, regime in enumerate(m.system.regimes) if regime.delayed]
        self.lags = {number: m.emit(regime.lags, f"lags{i}") for i, (number, regime) in enumerate(late)}
        self._add_write()
        self._add_recall("recall", hermite, early=self._initial)
        if slopes:
            self.gains = {
                number: m.emit(_passing(m.system.regimes[number]), f"passing{number}") for number in self.lags
            }
            self._add_recall("recall_slope", hermite_slope, early=self._nothing)

    def _add_write(self) -> None:
        """``remember_start(ctx, index, t, trace)`` and ``remember_end``: a trace holds values, then slopes."""
        values = 2 * self.width // self.m.lanes
        for number, part in enumerate(("start", "end")):
            f = self.m.function(
                f"remember_{part}",
                "ptr %ctx, i64 %index, double %t, ptr %trace",
                attributes=f"nounwind {self._inlined}",
            )
            piece = self._piece(f, "%index", self._ring(f))
            f.store("%t", f.at(piece, number))
            copy(f, "%trace", f.at(piece, 2 + 2 * number * self.width), values)
            f.do("ret void")
            self.m.finish(f)

    @property
    def _inlined(self) -> str:
        """Whether the code that reads and writes pieces stands wherever it is needed."""
        places = sum(len(regime.delayed) for regime in self.m.system.regimes)
        few = self.m.lanes == 1 and places <= _FEW
        return "alwaysinline" if few else "noinline"

    def _ring(self, f: Function) -> tuple[str, str]:
        """Where the pieces are, and what makes a place of a number: read once, since stores in between hide that."""
        return f.word("%ctx", WORD["ring"], "ptr"), f.word("%ctx", WORD["ring_mask"])

    def _piece(self, f: Function, index: str, ring: tuple[str, str]) -> str:
        first, mask = ring
        words = piece_words(self.m.system.outputs * self.m.system.width, self.m.lanes)
        return f.at(first, f.scalar("mul", f.scalar("and", index, mask), str(words)))

    def _initial(self, f: Function, first: str, count: int) -> None:
        copy(f, f.at(f.word("%ctx", WORD["initial"], "ptr"), first), "%target", count)

    def _nothing(self, f: Function, first: str, count: int) -> None:
        with f.count(0, count) as i:
            f.store(f.constant(0.0), f.at("%target", f.scalar("mul", i, str(f.lanes))), f.real)

    def _add_recall(self, name: str, value: Callable[..., str], early: Callable[[Function, str, int], None]) -> None:
        """``recall(ctx, output, t, newest, hint, target)``: an output's channels at t, no piece after ``newest``.

        ``hint`` is where the last piece is kept that was looked up.

        ``recall_slope`` does the same for their time derivatives; ``value`` makes them of a piece, ``early`` is what
        they are before the start.

        Returns 0, or 1 when the provisional piece was used, or 2 when the history is too short.
        """
        f = self.m.function(
            name,
            "ptr %ctx, i64 %output, double %t, i64 %newest, ptr %hint, ptr %target",
            returns="i64",
            attributes=f"nounwind {self._inlined}",
        )
        own = self.m.system.width * self.m.lanes
        first = f.scalar("mul", "%output", str(own))
        before = f.label()
        search = f.label()
        unknown = f.test("ole", "%t", f.word("%ctx", WORD["t_start"], "double"))
        f.branch(f.let(f"or i1 {unknown}, {f.test('slt', '%newest', '0')}"), before, search)
        f.place(before)
        early(f, first, self.m.system.width)
        f.do("ret i64 0")
        f.place(search)
        count, ring = f.word("%ctx", WORD["ring_count"]), self._ring(f)
        oldest = f.let(f"call i64 @llvm.smax.i64(i64 0, i64 {f.scalar('sub', count, ring[1])})")
        self.m.declarations.add("declare i64 @llvm.smax.i64(i64, i64)")
        self.m.declarations.add("declare i64 @llvm.smin.i64(i64, i64)")
        start = f.let(f"call i64 @llvm.smax.i64(i64 {oldest}, i64 {f.load('%hint', 'i64')})")
        at = f.slot("i64")
        f.store(f.let(f"call i64 @llvm.smin.i64(i64 {start}, i64 %newest)"), at, "i64")
        with f.loop() as after:
            i = f.load(at, "i64")
            f.leave_if(f.test("sge", i, "%newest"), after)
            f.leave_if(f.test("ole", "%t", f.word(self._piece(f, i, ring), 1, "double")), after)
            f.store(f.scalar("add", i, "1"), at, "i64")
        with f.loop() as after:
            i = f.load(at, "i64")
            f.leave_if(f.test("ole", f.word(self._piece(f, i, ring), 0, "double"), "%t"), after)
            short, enough = f.label(), f.label()
            f.branch(f.test("sle", i, oldest), short, enough)
            f.place(short)
            f.do("ret i64 2")
            f.place(enough)
            f.store(f.scalar("sub", i, "1"), at, "i64")
        i = f.load(at, "i64")
        f.store(i, "%hint", "i64")
        piece = self._piece(f, i, ring)
        t0, t1 = f.load(piece), f.word(piece, 1, "double")
        h = f.scalar("fsub", t1, t0)
        theta, data = f.scalar("fdiv", f.scalar("fsub", "%t", t0), h), f.at(f.at(piece, 2), first)

        def recalled(place: str) -> None:
            parts = [f.load(f.at(data, f.scalar("add", place, str(part * self.width))), f.real) for part in range(4)]
            f.store(value(f, f.splat(theta), f.splat(h), *parts), f.at("%target", place), f.real)

        if f.lanes == 1 and self.m.system.width <= _TOGETHER:
            for channel, together in _powers(self.m.system.width):
                with f.wide(together):
                    recalled(str(channel))
        else:
            for each_channel in each(f, self.m.system.width):
                recalled(f.scalar("mul", str(each_channel), str(f.lanes)))
        provisional = f.test("eq", i, count)
        f.do(f"ret i64 {f.let(f'zext i1 {provisional} to i64')}")
        self.m.finish(f)

    def look_up(self, f: Function, regime: int, t: str, newest: str, flags: str, target: str = "") -> None:
        """Fill w with the delayed channels at time t; or the outcome into the slot ``flags``.

        With a ``target`` they are left there, one output after the other, until :meth:`hand_over` needs them.
        """
        lag = self.lags[regime]
        s, lanes = self.m.system, self.m.lanes
        p, z, w = (f.word("%ctx", WORD[name], "ptr") for name in ("p", "z", "w"))
        c = self.m.constants_of(f, lag)
        tau, delays = f.slot("double", lag.clocked * lanes), f.slot("double", s.outputs * lanes)
        lag.clock(f, t, p, c, tau)
        lag.main(f, p, c, tau, z, w, delays)
        for number, i in enumerate(s.regimes[regime].delayed):
            place = f.at(target, number * s.width * lanes) if target else f.at(w, s.held.output(i) * lanes)
            self._look_up(f, "recall", i, t, f.at(delays, i * lanes), newest, place, flags)

    def buffer(self, f: Function, regime: int) -> str:
        """Memory for what :meth:`look_up` finds at one time."""
        return f.slot("double", len(self.m.system.regimes[regime].delayed) * self.m.system.width * self.m.lanes)

    def hand_over(self, f: Function, regime: int, source: str) -> None:
        """Fill w with what has been looked up before."""
        s, w = self.m.system, f.word("%ctx", WORD["w"], "ptr")
        for number, i in enumerate(s.regimes[regime].delayed):
            copy(f, f.at(source, number * s.width * f.lanes), f.at(w, s.held.output(i) * f.lanes), s.width)

    def near(self, f: Function, regime: int, h: str) -> str:
        """Whether a delay may look into a step of length h; of delays that are not constant that is not known."""
        lag = self.lags[regime]
        if lag.clocked:
            return "true"
        lanes, z = self.m.lanes, f.word("%ctx", WORD["z"], "ptr")
        p, w = f.word("%ctx", WORD["p"], "ptr"), f.word("%ctx", WORD["w"], "ptr")
        delays = f.slot("double", self.m.system.outputs * lanes)
        lag.main(f, p, self.m.constants_of(f, lag), f.slot("double", 1), z, w, delays)
        far, near = f.splat(f.scalar("fmul", h, hexadecimal(_FAR))), "false"
        for i in self.m.system.regimes[regime].delayed:
            one = f.any(f.compare("olt", f.load(f.at(delays, i * lanes), f.real), far))
            near = f.let(f"or i1 {near}, {one}")
        return near

    def look_up_slopes(self, f: Function, regime: int, t: str, newest: str, target: str, flags: str) -> None:
        """The time derivatives of the delayed channels at t, one output after the other, as :meth:`look_up`."""
        lag, gain = self.lags[regime], self.gains[regime]
        s, lanes = self.m.system, self.m.lanes
        p, z, w = (f.word("%ctx", WORD[name], "ptr") for name in ("p", "z", "w"))
        found = []
        for emitted in (lag, gain):
            c, d = self.m.constants_of(f, emitted), f.slot("double", s.outputs * lanes)
            tau = f.slot("double", emitted.clocked * lanes)
            emitted.clock(f, t, p, c, tau)
            emitted.main(f, p, c, tau, z, w, d)
            found.append(d)
        delays, passing = found
        own = s.width * lanes
        for number, i in enumerate(s.regimes[regime].delayed):
            place = f.at(target, number * own)
            self._look_up(f, "recall_slope", i, t, f.at(delays, i * lanes), newest, place, flags)
            with f.count(0, s.width) as k:
                here = f.at(place, f.scalar("mul", k, str(lanes)))
                f.store(f.mul(f.load(here, f.real), f.load(f.at(passing, i * lanes), f.real)), here, f.real)

    def _look_up(
        self, f: Function, recall: str, output: int, t: str, delays: str, newest: str, target: str, flags: str
    ) -> None:
        """An output's channels at t minus the delay of each lane: at once where all lanes have the same."""
        lanes, width = f.lanes, self.m.system.width
        hints = f.at(f.word("%ctx", WORD["hints"], "ptr"), output * lanes)

        def found(lane: int, place: str) -> None:
            then = f.scalar("fsub", t, f.word(delays, lane, "double"))
            arguments = f"ptr %ctx, i64 {output}, double {then}, i64 {newest}, ptr {f.at(hints, lane)}, ptr {place}"
            f.store(f.scalar("or", f.load(flags, "i64"), f.call(recall, arguments, "i64")), flags, "i64")

        if lanes == 1:
            found(0, target)
            return
        differ = f.any(f.compare("une", f.load(delays, f.real), f.splat(f.word(delays, 0, "double"))))
        with f.when(f.let(f"xor i1 {differ}, true")):
            found(0, target)
            for lane in range(1, lanes):
                f.store(f.word(hints, 0), f.at(hints, lane), "i64")
        with f.when(differ):
            own = f.slot("double", width * lanes)
            for lane in range(lanes):
                found(lane, own)
                with f.count(0, width) as k:
                    place = f.scalar("add", f.scalar("mul", k, str(lanes)), str(lane))
                    f.store(f.word(own, place, "double"), f.at(target, place))

    def follow(self, f: Function, t: str, z: str, slope: str, target: str) -> None:
        """Channels and their slopes at a state and its derivative."""
        p, c = f.word("%ctx", WORD["p"], "ptr"), self.m.constants_of(f, self.trace)
        tau = f.slot("double", self.trace.clocked * self.m.lanes)
        self.trace.clock(f, t, p, c, tau)
        self.trace.main(f, p, c, tau, z, slope, target)
