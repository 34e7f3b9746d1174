"""A system compiled once, and its runs."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hgorun.engine.allowance import SMALL
from hgorun.engine.emit import Emitted
from hgorun.engine.fixed import add_fixed
from hgorun.engine.history import History, piece_words
from hgorun.engine.layout import (
    CONTEXT,
    DONE,
    HISTORY_TOO_SHORT,
    PAUSED,
    PLANT_DIVERGED,
    STEP_TOO_SMALL,
    WORD,
    HybridSystem,
)
from hgorun.engine.methods import METHODS, Method, Rosenbrock
from hgorun.engine.parts import Module, add_actions, add_channels, add_flag, add_rows, counts, span
from hgorun.engine.plan import Floats, Integers, Plan
from hgorun.engine.stepper import Stepper
from hgorun.errors import PlantDiverged, SimulationError
from hgorun.native.compiler import NativeModule, address_of

_SLICE = 0.05  # seconds of native code between two checks for Ctrl-C
_FIRST = 1000  # steps in the first slice, until it is known how long one takes
_BUDGET = 20_000  # adaptive steps between two such looks
_PATIENCE, _PROGRESS = 1_000_000, 1e-3  # adaptive steps, and the part of the run that they must bring
_ADAPTIVE_HISTORY = 1 << 16  # pieces kept where the number of steps is not known before


@dataclass(frozen=True)
class Tolerance:
    """Control of an adaptive method.

    Attributes
    ----------
    rtol : float
        Of a state's size, per step.
    atol : float or None
        What is allowed besides; None: it follows from each state's own size, see :mod:`hgorun.engine.allowance`.
    max_step, first_step : float
        The longest step, and the one that is tried first.
    """

    rtol: float
    atol: float | None
    max_step: float
    first_step: float


@dataclass(frozen=True)
class Start:
    """Where a run starts, for every lane.

    Attributes
    ----------
    z : ndarray, shape (states, lanes)
    p : ndarray, shape (parameters, lanes)
    bound : (offset, factor)
        An observer has diverged when one of its states exceeds offset + factor * max |x| so far.
    """

    z: Floats
    p: Floats
    bound: tuple[float, float] = (1e6, 1e6)


@dataclass(frozen=True)
class Raw:
    """The result of a run, one lane after the other in the last axis.

    Attributes
    ----------
    rows : ndarray, shape (grid points, states, lanes)
    measured : ndarray, shape (slots, lanes)
    diverged : ndarray, shape (observers, lanes)
        Time of divergence, infinity where there was none.
    error : ndarray, shape (states, lanes)
        Largest local error estimate of an embedded method, zeros otherwise.
    held : ndarray, shape (held numbers, lanes)
        The vector w at the end.
    tries : int
        Steps made, and, where they are controlled, those that were rejected.
    """

    rows: Floats
    measured: Floats
    diverged: Floats
    error: Floats
    held: Floats
    tries: int = 0


class TooManySteps(Exception):
    """More steps than allowed; the arguments are their number, and the time that was reached."""


def generate(system: HybridSystem, method: str, *, adaptive: bool = False, lanes: int = 1) -> tuple[str, int]:
    """The IR of a system, and how many constants a lane of a run has."""
    m, chosen = Module(system, lanes), METHODS[method]
    implicit = isinstance(chosen, Rosenbrock)
    flows = [m.emit(regime.flow, f"flow{i}", inlined=not implicit) for i, regime in enumerate(system.regimes)]
    add_channels(m)
    add_actions(m)
    add_flag(m)
    add_rows(m, quintic=bool(chosen.dense))
    history = History(m, slopes=implicit) if system.remembers else None
    for i, flow in enumerate(flows):
        name = f"advance{i}"
        stepper = _stepper(m, chosen, history, i, flow, name)
        if adaptive:
            from hgorun.engine.adaptive import add_adaptive

            add_adaptive(stepper)
        else:
            add_fixed(stepper)
    _add_run(m, len(flows))
    m.setup()
    return m.text(), m.constants


def _stepper(
    m: Module, method: Method | Rosenbrock, history: History | None, regime: int, flow: Emitted, name: str
) -> Stepper:
    """What makes a step; only what is asked for is imported, for most runs are short."""
    if isinstance(method, Rosenbrock):
        from hgorun.engine.rosenbrock import LinearlyImplicit

        return LinearlyImplicit(m, method, history, regime, flow, name)
    from hgorun.engine.runge_kutta import RungeKutta

    return RungeKutta(m, method, history, regime, flow, name)


def _add_run(m: Module, regimes: int) -> None:
    """``run(ctx, stop)``: go on to segment ``stop``; ``begin(ctx)``: the channels at the start."""
    f = m.function("run", "ptr %ctx, i64 %stop", returns="i64")
    verdict, at, paused = f.slot("i64"), f.at("%ctx", WORD["segment"]), f.at("%ctx", WORD["paused"])
    leave = f.label()
    f.store(str(DONE), verdict, "i64")
    with f.loop() as after:
        segment = f.load(at, "i64")
        f.leave_if(f.test("sge", segment, "%stop"), after)
        n = counts(f, segment)
        with f.when(f.test("eq", f.load(paused, "i64"), "0")):
            f.store(span(f, segment)[0], f.at("%ctx", WORD["now"]))
            with f.when(f.test("ne", n["action_first"], n["action_last"])):
                f.call("act", f"ptr %ctx, i64 {segment}")
        f.store("0", paused, "i64")
        for i in range(regimes):
            with f.when(f.test("eq", n["regime"], str(i))):
                f.store(f.call(f"advance{i}", f"ptr %ctx, i64 {segment}", "i64"), verdict, "i64")
        f.leave_if(f.test("ne", f.load(verdict, "i64"), str(DONE)), leave)
        f.store(f.scalar("add", segment, "1"), at, "i64")
    f.jump(leave)
    f.place(leave)
    stopped = f.load(verdict, "i64")
    f.store(f.let(f"zext i1 {f.test('eq', stopped, str(PAUSED))} to i64"), paused, "i64")
    f.do(f"ret i64 {stopped}")
    m.finish(f, "dso_local")
    g = m.function("begin", "ptr %ctx")
    g.call("setup", "ptr %ctx")
    g.call("channels", f"ptr %ctx, double {g.word('%ctx', WORD['t_start'], 'double')}")
    g.do("ret void")
    m.finish(g, "dso_local")


class Program:
    """Native code for a system, ready to run with any numbers.

    Parameters
    ----------
    system : HybridSystem
    method : str
        ``euler``, ``rk4``, ``dopri5`` or ``rodas5p``.
    adaptive : bool
        Control the step by the method's embedded error estimate.
    lanes : int
        Runs side by side.
    """

    def __init__(self, system: HybridSystem, method: str, *, adaptive: bool = False, lanes: int = 1) -> None:
        self.system, self.method, self.adaptive, self.lanes = system, METHODS[method], adaptive, lanes
        ir, self._constants = generate(system, method, adaptive=adaptive, lanes=lanes)
        self._native = NativeModule(ir, ("begin", "run"))
        self._begin = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(self._native.address["begin"])
        self._run = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64)(self._native.address["run"])

    def run(
        self,
        plan: Plan,
        start: Start,
        tolerance: Tolerance | None = None,
        progress: Callable[[float], None] | None = None,
        *,
        limit: float = np.inf,
    ) -> Raw:
        """Run a plan.

        Parameters
        ----------
        plan : Plan
        start : Start
        tolerance : Tolerance, optional
            For an adaptive method.
        progress : callable, optional
            Called periodically with the completed fraction, 0 to 1.
        limit : float
            So many steps may be tried by an adaptive method.

        Raises
        ------
        SimulationError
            When the plant diverges or no step is small enough for it.
        TooManySteps
        """
        memory = _Memory(self.system, self.lanes, self._constants, plan, start, tolerance)
        self._begin(memory.address)
        memory.keep_initial()
        work = (plan.counts[:, 2] - plan.counts[:, 1] + 1).cumsum()  # a segment's steps, and what happens before
        chunk = 1 if tolerance or progress else _FIRST  # adaptive segments may be long
        stop, done, tries = 0, 0, 0
        while stop < work.size:
            before = time.perf_counter()
            stop = max(stop + 1, int(work.searchsorted(done + chunk, side="right")))
            done = int(work[stop - 1])
            granted = memory["budget"] = _granted(limit - tries)
            verdict = self._run(memory.address, stop)
            pauses, reached = 0, memory.real("now")
            while verdict == PAUSED:
                tries += granted
                if tries >= limit:
                    raise TooManySteps(tries, memory.real("now"))
                pauses += 1
                if pauses * _BUDGET >= _PATIENCE:
                    if memory.real("now") - reached < _PROGRESS * (plan.spans[-1, 1] - plan.spans[0, 0]):
                        memory.set_real("hopeless", 2 * memory.real("step"))
                    pauses, reached = 0, memory.real("now")
                granted = memory["budget"] = _granted(limit - tries)
                verdict = self._run(memory.address, stop)
            tries += granted - memory["budget"]
            if verdict != DONE:
                stiff = isinstance(self.method, Rosenbrock)
                message = _explain(verdict, plan.origin + memory.real("now"), stiff=stiff)
                if verdict == PLANT_DIVERGED:
                    raise PlantDiverged(message, memory.real("now"))
                raise SimulationError(message)
            spent = max(time.perf_counter() - before, 1e-6)
            chunk = max(1, int(chunk * min(_SLICE / spent, 8.0)))
            if progress:
                progress(done / int(work[-1]))
        return memory.result(tries if tolerance else plan.steps)


def _granted(left: float) -> int:
    """Adaptive steps until the next look at what has become of them."""
    return int(min(_BUDGET, max(left, 1)))


def _explain(verdict: int, t: float, *, stiff: bool) -> str:
    """What ended a run at time t; ``stiff`` where the method is made for stiff equations."""
    advice = "" if stiff else "; if its equations are stiff, use solver: {method: rodas5p}"
    return {
        PLANT_DIVERGED: f"the plant itself diverged at t = {t:.6g}: nothing can be said about its observers{advice}",
        STEP_TOO_SMALL: f"no step is small enough for the plant at t = {t:.6g}: its equations are singular there "
        f"or the tolerance is out of reach{advice}",
        HISTORY_TOO_SHORT: f"the delay at t = {t:.6g} reaches further back than the stored history of "
        f"{_ADAPTIVE_HISTORY} steps; use a fixed step",
    }[verdict]


def history_pieces(ends: Floats, steps: Integers | None, reach: float) -> int:
    """How many steps the history of continuous delays keeps: a power of two.

    Parameters
    ----------
    ends : ndarray, shape (segments, 2)
        Where each segment starts and ends; pieces of one segment may repeat them.
    steps : ndarray, shape (segments,)
        Steps of each of them; None for adaptive steps.
    reach : float
        The longest delay; room is left for one that is a tenth longer.
    """
    if steps is None:
        return _ADAPTIVE_HISTORY
    last = np.append(ends[1:, 1] > ends[:-1, 1], True)
    knots = np.append(ends[0, 0], ends[last, 1])
    done = np.append(0, np.cumsum(steps)[last])
    reach = 1.1 * reach
    # steps in [t - reach, t] are most where one of the two is at an event
    late = np.concatenate([knots, knots + reach])
    spanned = np.interp(late, knots, done) - np.interp(late - reach, knots, done)
    return 1 << (int(np.ceil(np.max(spanned))) + 4).bit_length()


def history_bytes(system: HybridSystem, pieces: int) -> int:
    """Memory of so many steps of history, for one lane."""
    return 8 * pieces * piece_words(system.outputs * system.width, 1)


class _Memory:
    """The arrays of one run and the context that points to them."""

    def __init__(
        self, s: HybridSystem, lanes: int, constants: int, plan: Plan, start: Start, tolerance: Tolerance | None
    ) -> None:
        channels = s.outputs * s.width
        steps = None if tolerance else plan.counts[:, 2] - plan.counts[:, 1]
        pieces = history_pieces(plan.spans[:, :2], steps, plan.reach) if s.remembers else 1
        ring = np.zeros(pieces * piece_words(channels, lanes) if s.remembers else 1)
        entries = np.array([e * lanes + lane for row in s.alpha for e in row for lane in range(lanes)], dtype=np.int64)
        self.shape = (plan.grid.size, s.states, lanes)
        self.arrays: dict[str, np.ndarray] = {
            "p": np.ascontiguousarray(start.p, dtype=float),
            "c": np.zeros(max(constants, 1) * lanes),
            "z": np.ascontiguousarray(start.z, dtype=float).copy(),
            "w": np.zeros(s.held.size * lanes),
            "channels": np.zeros(max(channels, 1) * lanes),
            "spans": np.ascontiguousarray(plan.spans),
            "counts": np.ascontiguousarray(plan.counts),
            "actions": np.ascontiguousarray(plan.actions) if plan.actions.size else np.zeros(5, dtype=np.int64),
            "grid": np.append(plan.grid, np.inf),
            "rows": np.empty(self.shape),  # every row is written, by the native code or at the end
            "slots": np.zeros(max(plan.slots, 1) * s.width * lanes),
            "gain": _spread(plan.gain, lanes),
            "bias": _spread(plan.bias, lanes),
            "measured": np.full((max(plan.slots, 1), lanes), np.nan),
            "holds": _spread(plan.holds, lanes),
            "alpha": entries if entries.size else np.zeros(1, dtype=np.int64),
            "blocks": np.array(s.blocks or [(0, 0, 0)], dtype=np.int64),
            "diverged": np.full((max(s.observers, 1), lanes), np.inf),
            "largest": np.abs(start.z[: s.plant_states]).max(axis=0, initial=0.0),
            "ring": ring,
            "initial": np.zeros(max(channels, 1) * lanes),
            "hints": np.zeros(max(s.outputs, 1), dtype=np.int64),
            "error": np.zeros((s.states, lanes)),
            "size": _sizes(start.z),
        }
        self.context = np.zeros(len(CONTEXT), dtype=np.int64)
        for name, array in self.arrays.items():
            self.context[WORD[name]] = address_of(array)
        self.context[WORD["ring_mask"]] = pieces - 1
        reals = self.context.view(float)
        reals[WORD["bound_offset"]], reals[WORD["bound_factor"]] = start.bound
        reals[WORD["t_start"]] = plan.spans[0, 0]
        if tolerance:
            for word, value in (
                ("rtol", tolerance.rtol),
                ("atol", tolerance.atol or 0.0),
                ("small", SMALL if tolerance.atol is None else 0.0),
                ("max_step", tolerance.max_step),
                ("step", tolerance.first_step),
            ):
                reals[WORD[word]] = value
        self.address = address_of(self.context)
        self.slots, self.observers = plan.slots, s.observers

    def __getitem__(self, word: str) -> int:
        return int(self.context[WORD[word]])

    def __setitem__(self, word: str, value: int) -> None:
        self.context[WORD[word]] = value

    def real(self, word: str) -> float:
        return float(self.context.view(float)[WORD[word]])

    def set_real(self, word: str, value: float) -> None:
        self.context.view(float)[WORD[word]] = value

    def keep_initial(self) -> None:
        """The channels before the start are those at the start."""
        self.arrays["initial"][:] = self.arrays["channels"]

    def result(self, tries: int) -> Raw:
        rows = self.arrays["rows"]
        done = int(self.context[WORD["row"]])
        rows[done:] = self.arrays["z"].reshape(1, *self.shape[1:])  # the points at the end of the run
        return Raw(
            rows,
            self.arrays["measured"][: self.slots],
            self.arrays["diverged"][: self.observers],
            self.arrays["error"],
            self.arrays["w"].reshape(-1, self.shape[2]),
            tries,
        )


def _sizes(z: Floats) -> Floats:
    """|z| where it is a number, zero elsewhere."""
    sizes: Floats = np.abs(np.ascontiguousarray(z, dtype=float))
    sizes[~np.isfinite(sizes)] = 0.0
    return sizes


def _spread(values: Floats, lanes: int) -> Floats:
    """One number a row for all lanes, or a row of lanes."""
    values = values if values.size else np.zeros(1)
    if values.ndim == 1:
        values = values[:, None] if lanes == 1 else np.repeat(values[:, None], lanes, axis=1)
    return np.ascontiguousarray(values, dtype=float)
