"""One step of an explicit Runge-Kutta method, as native code."""

from __future__ import annotations

from hgorun.engine.emit import Emitted
from hgorun.engine.history import History
from hgorun.engine.methods import Method, Row
from hgorun.engine.module import Module
from hgorun.engine.stepper import Stepper
from hgorun.engine.sums import advanced, weighted


class RungeKutta(Stepper):
    """Stages one after the other, each of them a slope.

    Attributes
    ----------
    k : list of str
        The slopes of the stages.
    """

    roundings = 4.0

    def __init__(
        self, m: Module, method: Method, history: History | None, regime: int, flow: Emitted, name: str
    ) -> None:
        super().__init__(m, method.c, history, regime, flow, name)
        self.method, self.order = method, method.order
        # where nothing but output points asks for the start of a step, it costs a tenth of the time to copy it
        self.in_place = not method.error
        self.base, first = (self.z, self.slope) if self.in_place else (self.before, self.slope_before)
        self.k = [first, *(self.f.slot("double", self.size * m.lanes) for _ in method.stages)]

    def stages(self, t: str, h: str, t_end: str) -> None:
        f, method = self.f, self.method
        times = {c: t_end if c == 1.0 else self.timed("fadd", t, self.timed("fmul", h, c)) for c in method.c}
        history, past = self.history if self.delayed else None, dict[float, str]()
        if history:  # before all stages: what is looked up for one of them need not wait for another
            for c in dict.fromkeys(method.c[1:]):
                past[c] = history.buffer(f, self.regime)
                self.look_up(times[c], target=past[c])
        ticked, before = {0.0}, -1.0
        for c, row, target in zip(method.c[1:], method.stages, self.k[1:], strict=True):
            if c not in ticked:
                self.tick(times[c], self.clock[c])
                ticked.add(c)
            self._combine(row, h, self.stage)
            if history and c != before:
                history.hand_over(f, self.regime, past[c])
            self.flow_at(times[c], self.clock[c], self.stage, target, known=True)
            before = c
        self._combine(method.result, h, self.z)
        if 1.0 not in ticked:
            self.tick(t_end, self.clock[1.0])

    def _combine(self, row: Row, h: str, target: str) -> None:
        """target = z + h scale sum_j weights[j] k[j], unrolled over the state."""
        f = self.f
        factor = self.spread(h if row.scale == 1.0 else self.timed("fmul", h, row.scale))
        for i in range(self.size):
            place = i * f.lanes
            f.store(advanced(f, factor, row.weights, self.k, self.base, place), f.at(target, place), f.real)

    @property
    def ends_at_end(self) -> bool:
        return self.method.c[-1] == 1.0

    def _embedded(self, weights: tuple[float, ...], h: str, i: int) -> str:
        """h sum_j weights[j] k_j of state i, the last k being the slope at the end of the step."""
        slopes = [self.slope_before, *self.k[1:], self.slope]
        return self.f.mul(self.spread(h), weighted(self.f, weights, slopes, i * self.f.lanes))

    def errors(self, h: str) -> list[str]:
        if not self.method.error:
            return []
        return [self._embedded(self.method.error, h, i) for i in range(self.size)]

    def step_of(self, rate: str, h: str) -> list[str]:
        f = self.f
        return [f.mul(self.spread(h), f.load(f.at(rate, i * f.lanes), f.real)) for i in range(self.size)]

    def interpolant(self, h: str) -> tuple[str, str, str]:
        f, quintic = self.f, "null"
        if self.method.dense:
            quintic = f.slot("double", self.size * f.lanes)
            for i in range(self.size):
                f.store(self._embedded(self.method.dense, h, i), f.at(quintic, i * f.lanes), f.real)
        return self.slope_before, self.slope, quintic
