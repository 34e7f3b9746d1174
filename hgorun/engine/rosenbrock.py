"""One step of a Rosenbrock method, as native code: the matrix is factored once a step, then every stage is a solution.

With W = 1/(h gamma) - df/dz, the stages are W u_i = f(z_i) + sum_j (coupling_ij / h) u_j + h drift_i df/dt, where
z_i = z + sum_j a_ij u_j. A delayed channel is a function of time here: its slope is the one of the stored history.
"""

from __future__ import annotations

from collections.abc import Callable

from hgorun.engine.emit import Emitted
from hgorun.engine.history import History
from hgorun.engine.layout import WORD
from hgorun.engine.linearised import linearised
from hgorun.engine.methods import Rosenbrock
from hgorun.engine.module import Module, move
from hgorun.engine.stepper import Stepper
from hgorun.engine.sums import weighted
from hgorun.native.ir import hexadecimal

_TOGETHER, _UNROLLED = 4, 8  # states in a vector; vectors that are not in a loop
_AHEAD, _ROUNDING = 1e-9, 1e-15  # of a step and of t: slopes of the past are read just after the start of a step


class LinearlyImplicit(Stepper):
    """Stages that are solutions with one matrix.

    Attributes
    ----------
    u : list of str
        The stages.
    known : str
        The entries of the matrix's factors, then a right-hand side: what a solution needs.
    drift : str
        df/dt.
    begun : str
        When the step began.
    """

    roundings = 512.0  # its coefficients are large

    def __init__(
        self, m: Module, method: Rosenbrock, history: History | None, regime: int, flow: Emitted, name: str
    ) -> None:
        self.linear = linearised(m.system, m.system.regimes[regime])
        self.factor, self.solve, self.drift_of = (
            m.emit(function, f"{part}{regime}", inlined=False)
            for part, function in (
                ("factor", self.linear.factor),
                ("solve", self.linear.solve),
                ("drift", self.linear.drift),
            )
        )
        self.room = 1 + len(m.system.regimes[regime].delayed) * m.system.width  # 1/(h gamma), slopes of the past
        # where one run has many states, a vector holds several of them
        self.together = _TOGETHER if m.lanes == 1 and m.system.states > _UNROLLED else m.lanes
        super().__init__(m, (*method.c, 0.5), history, regime, flow, name)
        self.method, self.order = method, method.order
        f = self.f
        self.u = [self.array() for _ in method.c]
        self.rate, self.drift, self.first, self.last, self.quartic = (self.array() for _ in range(5))
        self.known = f.slot("double", self.linear.entries * m.lanes + self.words)
        self.begun = f.slot(m.time)
        self.right = f.at(self.known, self.linear.entries * m.lanes)
        ends = () if m.loose else (self.z, self.slope)  # there, they are what all steps have in common
        for array in (*ends, self.slope_before, self.stage, self.before, self.right):
            self._clear(array)
        for array in (*self.u, self.rate, self.drift, self.first, self.last, self.quartic):
            self._clear(array)

    @property
    def words(self) -> int:
        """Of an array: room for whole vectors."""
        return -(-self.size * self.m.lanes // self.together) * self.together

    def _clear(self, array: str) -> None:
        self.each(lambda i: self.f.store(self.f.constant(0.0), self.f.at(array, i), self.f.real))

    def each(self, body: Callable[[str | int], None]) -> None:
        """Do the same to all states: a vector of them after the other, at the place that ``body`` is told."""
        f, count = self.f, self.words // self.together
        with f.wide(self.together):
            if count <= _UNROLLED:
                for number in range(count):
                    body(number * self.together)
            else:
                with f.count(0, count) as k:
                    body(f.scalar("mul", k, str(self.together)))

    def stages(self, t: str, h: str, t_end: str) -> None:
        f, method = self.f, self.method
        f.store(t, self.begun, self.m.time)
        inverse = self.timed("fdiv", 1.0, h)
        self._linearise(t, h, inverse)
        ticked = {0.0}
        for i, c in enumerate(method.c):
            if i == 0:
                rate = self.slope_before
            else:
                t_stage = t_end if c == 1.0 else self.timed("fadd", t, self.timed("fmul", h, c))
                if c not in ticked:
                    self.tick(t_stage, self.clock[c])
                    ticked.add(c)
                self._advance(method.stages[i - 1], method.stages[i - 2] if i > 1 else None, self.stage)
                rate = self.rate
                self.flow_at(t_stage, self.clock[c], self.stage, rate)
            self._solve(i, rate, h, inverse)
        self._advance(method.result, method.stages[-1], self.z)

    def _linearise(self, t: str, h: str, inverse: str) -> None:
        """Factors of the matrix, and df/dt, at the start of the step."""
        f, lanes = self.f, self.m.lanes
        t = self._inside(t)
        shift = self.timed("fmul", inverse, 1 / self.method.gamma)
        f.store(self.spread(shift), f.at(self.before, self.size * lanes), f.real)
        if self.delayed:
            assert self.history is not None
            newest = f.word("%ctx", WORD["ring_count"])
            ahead = f.scalar("fmul", h, hexadecimal(_AHEAD))
            rounding = f.scalar("fmul", self.absolute(t), hexadecimal(_ROUNDING))
            late = f.scalar("fadd", t, f.scalar("fadd", ahead, rounding))
            slopes = f.at(self.before, (self.size + 1) * lanes)
            self.history.look_up(f, self.regime, t, newest, self.flags)
            self.history.look_up_slopes(f, self.regime, late, newest, slopes, self.flags)
        for emitted, target in ((self.factor, self.known), (self.drift_of, self.drift)):
            if emitted is self.drift_of and not self.linear.drifting:
                continue
            c, tau = self.m.constants_of(f, emitted), f.slot("double", emitted.clocked * lanes)
            emitted.clock(f, t, self.p, c, tau)
            emitted.main(f, self.p, c, tau, self.before, self.w, target)

    def _advance(self, row: tuple[float, ...], last: tuple[float, ...] | None, target: str) -> None:
        """target = z + sum_j row[j] u_j, from the stage before where only one term is new."""
        f = self.f
        if row[:-1] == last:
            base, weights, stages = self.stage, row[-1:], self.u[len(row) - 1 : len(row)]
        else:
            base, weights, stages = self.before, row, self.u

        def advance(place: str | int) -> None:
            value = f.add(f.load(f.at(base, place), f.real), weighted(f, weights, stages, place))
            f.store(value, f.at(target, place), f.real)

        self.each(advance)

    def _solve(self, i: int, rate: str, h: str, inverse: str) -> None:
        """u_i, from f at its stage."""
        f, method = self.f, self.method
        ahead = self.timed("fmul", h, method.drift[i])

        def right(place: str | int) -> None:
            value = f.load(f.at(rate, place), f.real)
            if i:
                coupling = weighted(f, method.coupling[i - 1], self.u, place)
                value = f.add(value, f.mul(self.spread(inverse), coupling))
            if method.drift[i] and self.linear.drifting:
                value = f.add(value, f.mul(self.spread(ahead), f.load(f.at(self.drift, place), f.real)))
            f.store(value, f.at(self.right, place), f.real)

        self.each(right)
        self._solve_into(self.u[i])

    def _solve_into(self, target: str) -> None:
        """W^-1 times the right-hand side."""
        c = self.m.constants_of(self.f, self.solve)
        self.solve.main(self.f, self.p, c, "null", self.known, self.w, target)

    def errors(self, h: str) -> list[str]:
        """The larger of the embedded estimate and of the interpolant's error in the middle of the step.

        Both ends of a step of a stiff method may be exact where nothing inside is: the states that follow others at
        once are right at every stage, and only the interpolant tells that a step is too long for them. Its defect
        there, f - z', is a rate; W^-1 makes an error of it.
        """
        f = self.f
        half = self.timed("fmul", h, 0.5)
        inverse = self.timed("fdiv", 1.0, h)
        d1, d2, d3 = self.method.dense
        bend = tuple(0.25 * (a + 0.5 * b + 0.25 * c) for a, b, c in zip(d1, d2, d3, strict=True))
        turn = tuple(0.25 * (b + c) for b, c in zip(d2, d3, strict=True))

        def middle_of(place: str | int) -> None:
            old, new = (f.load(f.at(array, place), f.real) for array in (self.before, self.z))
            mean = f.mul(f.constant(0.5), f.add(old, new))
            f.store(f.add(mean, weighted(f, bend, self.u, place)), f.at(self.stage, place), f.real)
            slope = f.mul(self.spread(inverse), f.add(f.sub(new, old), weighted(f, turn, self.u, place)))
            f.store(slope, f.at(self.first, place), f.real)

        def defect(place: str | int) -> None:
            rate, slope = (f.load(f.at(array, place), f.real) for array in (self.rate, self.first))
            f.store(f.sub(rate, slope), f.at(self.right, place), f.real)

        def larger(place: str | int) -> None:
            embedded = f.intrinsic("fabs", weighted(f, self.method.error, self.u, place))
            inside = f.intrinsic("fabs", f.load(f.at(self.rate, place), f.real))
            f.store(f.select(f.compare("ugt", inside, embedded), inside, embedded), f.at(self.first, place), f.real)

        self.each(middle_of)
        middle, clock = self.timed("fadd", f.load(self.begun, self.m.time), half), self.clock[0.5]
        self.tick(middle, clock)
        self.flow_at(middle, clock, self.stage, self.rate)
        self.each(defect)
        self._solve_into(self.rate)
        self.each(larger)
        return [f.load(f.at(self.first, i * f.lanes), f.real) for i in range(self.size)]

    def step_of(self, rate: str, h: str) -> list[str]:
        f = self.f
        move(f, rate, self.right, self.size)
        self._solve_into(self.rate)
        return [f.load(f.at(self.rate, i * f.lanes), f.real) for i in range(self.size)]

    def interpolant(self, h: str) -> tuple[str, str, str]:
        f = self.f
        inverse = self.timed("fdiv", 1.0, h)

        def ends(place: str | int) -> None:
            d1, d2, d3 = (weighted(f, row, self.u, place) for row in self.method.dense)
            rise = f.sub(f.load(f.at(self.z, place), f.real), f.load(f.at(self.before, place), f.real))
            total = f.add(d1, f.add(d2, d3))
            f.store(f.mul(self.spread(inverse), f.add(rise, d1)), f.at(self.first, place), f.real)
            f.store(f.mul(self.spread(inverse), f.sub(rise, total)), f.at(self.last, place), f.real)
            f.store(f.neg(d3), f.at(self.quartic, place), f.real)

        self.each(ends)
        return self.first, self.last, self.quartic

    def keep(self, t: str, t_end: str, h: str) -> None:
        """Add the step to the history, with the slopes of its interpolant.

        f would multiply the error of a stiff state by its rate: the interpolant does not.
        """
        f = self.f
        assert self.history is not None
        first, last, _ = self.interpolant(h)
        self.history.follow(f, self._inside(t), self.before, first, self.trace_before)
        self.history.follow(f, self._inside(t_end), self.z, last, self.trace)
        super().keep(t, t_end, h)

    def _inside(self, t: str) -> str:
        """Where functions of time are evaluated: on this segment's side of its events."""
        for event, inside in ((self.start, self.start_eval), (self.end, self.end_eval)):
            t = self.chosen(self.compared("oeq", t, event), inside, t)
        return t
