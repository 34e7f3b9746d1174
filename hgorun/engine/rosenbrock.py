"""One step of a Rosenbrock method, as native code: the matrix is factored once a step, then every stage is a solution.

With W = 1/(h gamma) - df/dz, the stages are W u_i = f(z_i) + sum_j (coupling_ij / h) u_j + h drift_i df/dt, where
z_i = z + sum_j a_ij u_j. A delayed channel is a function of time here: its slope is the one of the stored history.
"""

from __future__ import annotations

from hgorun.engine.emit import Emitted
from hgorun.engine.history import History
from hgorun.engine.layout import WORD
from hgorun.engine.linearised import linearised
from hgorun.engine.methods import Rosenbrock
from hgorun.engine.parts import Module, move
from hgorun.engine.stepper import Stepper, weighted
from hgorun.native.ir import hexadecimal

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
        super().__init__(m, (*method.c, 0.5), history, regime, flow, name)
        self.method, self.order = method, method.order
        f, size = self.f, self.size * m.lanes
        self.u = [f.slot("double", size) for _ in method.c]
        self.rate, self.drift, self.first, self.last, self.quartic = (f.slot("double", size) for _ in range(5))
        self.known = f.slot("double", self.linear.entries * m.lanes + size)
        self.begun = f.slot("double")
        self.right = f.at(self.known, self.linear.entries * m.lanes)

    def stages(self, t: str, h: str, t_end: str) -> None:
        f, method = self.f, self.method
        f.store(t, self.begun)
        inverse = f.scalar("fdiv", hexadecimal(1.0), h)
        self._linearise(t, h, inverse)
        ticked = {0.0}
        for i, c in enumerate(method.c):
            if i == 0:
                rate = self.slope_before
            else:
                t_stage = t_end if c == 1.0 else f.scalar("fadd", t, f.scalar("fmul", h, hexadecimal(c)))
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
        shift = f.scalar("fmul", inverse, hexadecimal(1 / self.method.gamma))
        f.store(f.splat(shift), f.at(self.before, self.size * lanes), f.real)
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
        for i in range(self.size):
            place = i * f.lanes
            value = f.add(f.load(f.at(base, place), f.real), weighted(f, weights, stages, place))
            f.store(value, f.at(target, place), f.real)

    def _solve(self, i: int, rate: str, h: str, inverse: str) -> None:
        """u_i, from f at its stage."""
        f, method = self.f, self.method
        coupled, drift = f.splat(inverse), f.splat(f.scalar("fmul", h, hexadecimal(method.drift[i])))
        for n in range(self.size):
            place = n * f.lanes
            value = f.load(f.at(rate, place), f.real)
            if i:
                coupling = weighted(f, method.coupling[i - 1], self.u, place)
                value = f.add(value, f.mul(coupled, coupling))
            if method.drift[i] and n in self.linear.drifting:
                value = f.add(value, f.mul(drift, f.load(f.at(self.drift, place), f.real)))
            f.store(value, f.at(self.right, place), f.real)
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
        f, lanes = self.f, self.m.lanes
        half = f.scalar("fmul", h, hexadecimal(0.5))
        inverse = f.splat(f.scalar("fdiv", hexadecimal(1.0), h))
        d1, d2, d3 = self.method.dense
        bend = tuple(0.25 * (a + 0.5 * b + 0.25 * c) for a, b, c in zip(d1, d2, d3, strict=True))
        turn = tuple(0.25 * (b + c) for b, c in zip(d2, d3, strict=True))
        for i in range(self.size):
            old, new = (f.load(f.at(array, i * lanes), f.real) for array in (self.before, self.z))
            mean = f.mul(f.constant(0.5), f.add(old, new))
            f.store(f.add(mean, weighted(f, bend, self.u, i * lanes)), f.at(self.stage, i * lanes), f.real)
            slope = f.mul(inverse, f.add(f.sub(new, old), weighted(f, turn, self.u, i * lanes)))
            f.store(slope, f.at(self.first, i * lanes), f.real)
        middle, clock = f.scalar("fadd", f.load(self.begun), half), self.clock[0.5]
        self.tick(middle, clock)
        self.flow_at(middle, clock, self.stage, self.rate)
        for i in range(self.size):
            rate, slope = (f.load(f.at(array, i * lanes), f.real) for array in (self.rate, self.first))
            f.store(f.sub(rate, slope), f.at(self.right, i * lanes), f.real)
        self._solve_into(self.rate)
        found = []
        for i in range(self.size):
            embedded = f.intrinsic("fabs", weighted(f, self.method.error, self.u, i * lanes))
            inside = f.intrinsic("fabs", f.load(f.at(self.rate, i * lanes), f.real))
            found.append(f.select(f.compare("ugt", inside, embedded), inside, embedded))
        return found

    def step_of(self, rate: str, h: str) -> list[str]:
        f = self.f
        move(f, rate, self.right, self.size)
        self._solve_into(self.rate)
        return [f.load(f.at(self.rate, i * f.lanes), f.real) for i in range(self.size)]

    def interpolant(self, h: str) -> tuple[str, str, str]:
        f = self.f
        inverse = f.splat(f.scalar("fdiv", hexadecimal(1.0), h))
        for i in range(self.size):
            place = i * f.lanes
            d1, d2, d3 = (weighted(f, row, self.u, place) for row in self.method.dense)
            rise = f.sub(f.load(f.at(self.z, place), f.real), f.load(f.at(self.before, place), f.real))
            total = f.add(d1, f.add(d2, d3))
            f.store(f.mul(inverse, f.add(rise, d1)), f.at(self.first, place), f.real)
            f.store(f.mul(inverse, f.sub(rise, total)), f.at(self.last, place), f.real)
            f.store(f.neg(d3), f.at(self.quartic, place), f.real)
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
        f = self.f
        for event, inside in ((self.start, self.start_eval), (self.end, self.end_eval)):
            t = f.let(f"select i1 {f.test('oeq', t, event)}, double {inside}, double {t}")
        return t
