"""The engine's oracle: a system and a plan carried out in plain numpy, step by step, to be checked by eye.

Functions are CasADi's own evaluation of the same expressions; everything else (which step, which action, which
row) is read from the documentation of the plan. One lane; no delay may reach into the step that is being made.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial

import casadi as ca
import numpy as np
import numpy.typing as npt

from hgorun.engine.layout import ARRIVE, JUMP, REBASE, RECORD, SET, TAKE, HybridSystem, Regime
from hgorun.engine.memory import Tolerance
from hgorun.engine.plan import Plan

Array = npt.NDArray[np.float64]

# Kutta 1901; Dormand and Prince 1980, with Hairer, Norsett and Wanner's continuous extension
TABLEAUX: dict[str, tuple[list[list[float]], list[float]]] = {
    "euler": ([], [1.0]),
    "rk4": ([[1 / 2], [0, 1 / 2], [0, 0, 1]], [1 / 6, 1 / 3, 1 / 3, 1 / 6]),
    "dopri5": (
        [
            [1 / 5],
            [3 / 40, 9 / 40],
            [44 / 45, -56 / 15, 32 / 9],
            [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
            [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
        ],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ),
}
FOURTH = np.array([5179 / 57600, 0, 7571 / 16695, 393 / 640, -92097 / 339200, 187 / 2100, 1 / 40])
DENSE = np.array([
    -12715105075 / 11282082432, 0, 87487479700 / 32700410799, -10690763975 / 1880347072,
    701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423,
])  # fmt: skip


@dataclass
class Step:
    """One step: its ends, the states there, all slopes with the one at its end last, the error estimate."""

    t0: float
    t1: float
    z0: Array
    z1: Array
    slopes: list[Array]
    error: Array

    def at(self, t: float, method: str) -> Array:
        """The state inside the step."""
        h = self.t1 - self.t0
        value = hermite((t - self.t0) / h, h, self.z0, self.slopes[0], self.z1, self.slopes[-1])
        if method == "dopri5":
            s = (t - self.t0) / h
            value = value + s**2 * (1 - s) ** 2 * h * (DENSE @ np.array(self.slopes))
        return value


def hermite(s: float, h: float, a: Array, da: Array, b: Array, db: Array) -> Array:
    """The cubic through a and b with slopes da and db at the part s of an interval of length h."""
    p = (1 + 2 * s) * (1 - s) ** 2 * a + s**2 * (3 - 2 * s) * b
    return np.asarray(p + h * s * (1 - s) ** 2 * da - h * s**2 * (1 - s) * db)


@dataclass
class Run:
    """The result of a run; see hgorun.engine.memory.Raw."""

    rows: list[Array] = field(default_factory=list)
    measured: Array = field(default_factory=lambda: np.zeros(0))
    diverged: Array = field(default_factory=lambda: np.zeros(0))
    error: Array = field(default_factory=lambda: np.zeros(0))
    steps: int = 0


class Interpreter:
    """One run of a system from z0 with parameters p."""

    def __init__(
        self, s: HybridSystem, plan: Plan, method: str, z0: Array, p: Array, bound: tuple[float, float]
    ) -> None:
        self.s, self.plan, self.method, self.p, self.bound = s, plan, method, p, bound
        self.z, self.w = z0.copy(), np.zeros(s.held.size)
        self.controlled = False
        self.slots = np.zeros((plan.slots, s.width))
        self.run = Run(
            measured=np.full(plan.slots, np.nan), diverged=np.full(s.observers, np.inf), error=np.zeros(s.states)
        )
        self.largest = np.abs(z0[: s.plant_states]).max()
        self.start = float(plan.spans[0, 0])
        self.first_channels = self.channels(self.start)
        self.history: list[tuple[float, float, Array, Array, Array, Array]] = []

    def function(self, f: ca.Function, t: float, z: Array, w: Array) -> Array:
        return np.asarray(f(t, self.p, z, w).full()).ravel()

    def channels(self, t: float) -> Array:
        return self.function(self.s.channels, t, self.z, self.w).reshape(self.s.outputs, self.s.width)

    def flow(self, regime: Regime, t: float, z: Array) -> Array:
        w = self.w.copy()
        if regime.lags is not None:
            delays = self.function(regime.lags, t, z, w)
            for i in regime.delayed:
                first = self.s.held.output(i)
                w[first : first + self.s.width] = self.recalled(t - delays[i])[i]
        # what an earlier look brought stays in w until the next one
        self.w = w
        return self.function(regime.flow, t, z, w)

    def recalled(self, t: float) -> Array:
        """The channels at an earlier time, constant before the start."""
        if t <= self.start or not self.history:
            return self.first_channels
        t0, t1, a, da, b, db = next(piece for piece in self.history if t <= piece[1] + 1e-9)
        return hermite((t - t0) / (t1 - t0), t1 - t0, a, da, b, db)

    def trace(self, t: float, z: Array, slope: Array) -> tuple[Array, Array]:
        found = self.function(self.s.channel_slopes, t, z, slope).reshape(2, self.s.outputs, self.s.width)
        return found[0], found[1]

    def act(self, t: float, rows: npt.NDArray[np.int64]) -> None:
        s, held = self.s, self.s.held
        for op, output, slot, first, last in rows:
            if op == TAKE:
                self.slots[slot] = self.channels(t)[output]
            elif op in (ARRIVE, RECORD):
                y = self.plan.gain[slot] * self.slots[slot, 0] + self.plan.bias[slot]
                self.run.measured[slot] = y
                if op == ARRIVE:
                    self.w[held.previous(output)] = self.w[held.output(output)]
                    self.w[held.output(output)] = y
                    first_s = held.s(output, 0)
                    self.w[first_s : first_s + s.observers] = self.slots[slot, 1:]
            elif op == SET:
                self.w[output] = self.plan.holds[slot]
            elif op == REBASE:
                for j, place in enumerate(s.alpha[output]):
                    alpha, self.z[place] = self.z[place], 0.0
                    self.w[held.s(output, j)] += alpha
                    self.slots[first:last, 1 + j] += alpha
            elif op == JUMP:
                start, stop, jump = s.jumps[output]
                owner = [j for j, block in enumerate(s.blocks) if block[0] == start]
                if not owner or math.isinf(self.run.diverged[owner[0]]):
                    self.z[start:stop] = self.function(jump, t, self.z, self.w)

    def step(self, rate: Callable[[float, Array], Array], t0: float, t1: float, ends: tuple[float, float]) -> Step:
        """One Runge-Kutta step; ``ends``: where functions of time are evaluated at its ends."""
        stages, weights = TABLEAUX[self.method]
        h = t1 - t0
        slopes = [rate(ends[0], self.z)]
        for row in stages:
            c = math.fsum(row)
            z = self.z + h * sum(a * k for a, k in zip(row, slopes, strict=True))
            slopes.append(rate(ends[1] if abs(c - 1) < 1e-12 else t0 + c * h, z))
        z1 = self.z + h * sum(b * k for b, k in zip(weights, slopes, strict=True))
        error = np.zeros_like(z1)
        if not self.controlled:  # then what has diverged has no value inside the step either
            self.mask(t1, z1)
        slopes.append(rate(ends[1], z1))
        if self.method == "dopri5":
            error = h * ((np.array([*weights, 0]) - FOURTH) @ np.array(slopes))
        return Step(t0, t1, self.z.copy(), z1, slopes, error)

    def accept(self, step: Step, ends: tuple[float, float]) -> None:
        """The rows inside the step, the history, the masks."""
        s = self.s
        h = step.t1 - step.t0
        snap = 1e-9 * h
        while len(self.run.rows) < self.plan.grid.size and self.plan.grid[len(self.run.rows)] < step.t1 - snap:
            t = self.plan.grid[len(self.run.rows)]
            self.run.rows.append(step.z0.copy() if t <= step.t0 + snap else step.at(t, self.method))
        if any(regime.delayed for regime in s.regimes):
            a, da = self.trace(ends[0], step.z0, step.slopes[0])
            b, db = self.trace(ends[1], step.z1, step.slopes[-1])
            self.history.append((step.t0, step.t1, a, da, b, db))
        self.run.error = np.fmax(self.run.error, np.abs(step.error))
        self.run.steps += 1
        self.z = step.z1.copy()

    def mask(self, t: float, z: Array) -> None:
        """Give up the observers that have left the bound."""
        self.largest = max(self.largest, np.abs(z[: self.s.plant_states]).max())
        for j, (start, stop, end) in enumerate(self.s.blocks):
            if not np.all(np.abs(z[start:stop]) <= self.bound[0] + self.bound[1] * self.largest):
                self.run.diverged[j] = min(self.run.diverged[j], t)
                z[start:end] = np.nan

    def segments(self) -> Iterator[tuple[Regime, Array, npt.NDArray[np.int64]]]:
        """Regime, span and counts of each segment, after what happens at its start."""
        for span, counts in zip(self.plan.spans, self.plan.counts, strict=True):
            self.act(span[2], self.plan.actions[counts[4] : counts[5]])
            yield self.s.regimes[counts[3]], span, counts

    def finished(self) -> Run:
        self.run.rows += [self.z] * (self.plan.grid.size - len(self.run.rows))
        return self.run

    def fixed(self) -> Run:
        """With the steps of the plan."""
        for regime, (start, end, start_eval, end_eval), (count, first, last, *_) in self.segments():
            h = (end - start) / count

            def exact(i: int, start: float = start, end: float = end, h: float = h, count: int = count) -> float:
                return end if i == count else start + i * h

            for i in range(first, last):
                ends = (start_eval if i == 0 else exact(i), end_eval if i + 1 == count else exact(i + 1))
                step = self.step(partial(self.flow, regime), exact(i), exact(i + 1), ends)
                self.accept(step, ends)
        return self.finished()

    def adaptive(self, tolerance: Tolerance) -> Run:
        """With the step that the error asks for: 0.9 error^(-1/5), between a fifth and five times."""
        s, wanted, self.controlled = self.s, tolerance.first_step, True
        assert tolerance.atol is not None
        for regime, (start, end, start_eval, end_eval), _ in self.segments():
            t = start
            while t < end:
                h = min(wanted, tolerance.max_step)
                if landing := h >= (end - t) * (1 - 1e-12):
                    h = end - t
                elif h > (end - t) / 2:
                    h = (end - t) / 2
                t_new = end if landing else t + h
                ends = (start_eval if t == start else t, end_eval if landing else t_new)
                step = self.step(partial(self.flow, regime), t, t_new, ends)
                scale = tolerance.atol + tolerance.rtol * np.maximum(np.abs(step.z0), np.abs(step.z1))
                ratio = np.abs(step.error) / scale
                alive = [block for j, block in enumerate(s.blocks) if math.isinf(self.run.diverged[j])]
                parts = [ratio[: s.plant_states], *(ratio[a:c] for a, _, c in alive)]
                worst = max(float(part.max()) for part in parts)
                factor = 0.9 * worst**-0.2
                if worst > 1:
                    wanted = h * max(0.2, min(factor, 1.0))
                    continue
                self.accept(step, ends)
                self.mask(t_new, self.z)
                t = t_new
                grown = h * max(0.2, min(factor, 5.0))
                wanted = wanted if h < wanted and grown < wanted else grown
        return self.finished()
