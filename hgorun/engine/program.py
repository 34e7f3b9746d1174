"""A system compiled once, and its runs."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from hgorun.engine.emit import Emitted
from hgorun.engine.events import add_actions, add_channels, add_jumps
from hgorun.engine.fixed import add_fixed
from hgorun.engine.flag import add_flag
from hgorun.engine.history import History
from hgorun.engine.layout import (
    DONE,
    HISTORY_TOO_SHORT,
    PAUSED,
    PLANT_DIVERGED,
    STEP_TOO_SMALL,
    WORD,
    HybridSystem,
)
from hgorun.engine.memory import ADAPTIVE_HISTORY, Memory, Raw, Start, Tolerance
from hgorun.engine.methods import METHODS, Method, Rosenbrock
from hgorun.engine.module import Module, counts, span
from hgorun.engine.plan import Plan
from hgorun.engine.rows import add_rows
from hgorun.engine.stepper import Stepper
from hgorun.engine.window import Take, Window
from hgorun.errors import NoStep, PlantDiverged, ShortHistory, SimulationError
from hgorun.native.compiler import NativeModule

_SLICE = 0.05  # seconds of native code between two checks for Ctrl-C
_FIRST = 1000  # steps in the first slice, until it is known how long one takes
_LARGEST = 1 << 40  # steps in a slice: parts of a run may be shorter than any slice
_BUDGET = 20_000  # adaptive steps between two such looks
PATIENCE, _PROGRESS = 1_000_000, 1e-3  # adaptive steps, and the part of the run that they must bring


class TooManySteps(Exception):
    """More steps than allowed; the arguments are their number, and the time that was reached."""


def generate(
    system: HybridSystem,
    method: str,
    *,
    adaptive: bool = False,
    lanes: int = 1,
    many: bool = False,
    shown: Sequence[int] | None = None,
    estimates: bool = True,
) -> tuple[str, int]:
    """The IR of a system, and how many constants a lane of a run has.

    With the loop over ``many`` members of :mod:`hgorun.engine.members`, and the states that are ``shown`` in rows.
    Embedded error estimates are kept where ``estimates`` says so.
    """
    m, chosen = Module(system, lanes, shown), METHODS[method]
    if not estimates and isinstance(chosen, Method):
        chosen = replace(chosen, error=())
    implicit = isinstance(chosen, Rosenbrock)
    flows = [m.emit(regime.flow, f"flow{i}", inlined=not implicit) for i, regime in enumerate(system.regimes)]
    add_channels(m)
    add_jumps(m)
    add_actions(m)
    add_flag(m, alone=adaptive or (lanes == 1 and not many))
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
    if many:
        from hgorun.engine.members import add_members

        add_members(m)
    return m.text(), m.constants


def generate_loose(
    system: HybridSystem, method: str, lanes: int, shown: Sequence[int] | None, *, adaptive: bool = False
) -> tuple[str, int]:
    """As :func:`generate`, for many members that have tables of their own.

    See :mod:`hgorun.engine.loose`, and :mod:`hgorun.engine.loose_adaptive` where their steps are controlled.
    """
    from hgorun.engine.loose import add_loose
    from hgorun.engine.loose_adaptive import add_loose_adaptive
    from hgorun.engine.members import add_members

    m, chosen = Module(system, lanes, shown, loose=True), METHODS[method]
    implicit = isinstance(chosen, Rosenbrock)
    flows = [m.emit(regime.flow, f"flow{i}", inlined=not implicit) for i, regime in enumerate(system.regimes)]
    add_channels(m)
    add_jumps(m)
    add_flag(m, alone=False)
    if adaptive:
        steppers = [_stepper(m, chosen, None, i, flow, f"try{i}") for i, flow in enumerate(flows)]
        add_loose_adaptive(m, steppers, quintic=bool(chosen.dense))
    else:
        assert isinstance(chosen, Method)
        add_loose(m, chosen, flows)
    add_begin(m)
    m.setup()
    add_members(m)
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
    """``run(ctx, stop)``: go on to segment ``stop``."""
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
    add_begin(m)


def add_begin(m: Module) -> None:
    """``begin(ctx)``: what depends on parameters alone, and the channels at the start."""
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

    def memory(
        self, plan: Plan, start: Start, tolerance: Tolerance | None = None, window: Window | None = None
    ) -> Memory:
        """The memory of a run that is about to begin."""
        memory = Memory(self.system, self.lanes, self._constants, plan, start, tolerance, window=window)
        self._begin(memory.address)
        memory.keep_initial()
        return memory

    def go_on(self, memory: Memory, stop: int) -> int:
        """Carry a run out up to the start of a segment; what the native loop says."""
        return int(self._run(memory.address, stop))

    def caller(self, memory: Memory) -> Callable[[ctypes.c_int64], int]:
        """As :meth:`go_on`, for many short calls with one memory: what they are given has been made before."""
        return partial(self._run, ctypes.c_void_p(memory.address))

    def run(
        self,
        plan: Plan,
        start: Start,
        tolerance: Tolerance | None = None,
        progress: Callable[[float], None] | None = None,
        *,
        limit: float = np.inf,
        take: Take | None = None,
        room: int | None = None,
        until: Sequence[int] = (),
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
        take : callable, optional
            Gets all rows, some of them at a time, in place of an array of all.
        room : int, optional
            So many of them at a time.
        until : sequence of int
            Observers without which the run need not go on: it may end when nothing is left of them any more, and then
            the rows behind that tell nothing of all else. With fixed steps.

        Raises
        ------
        SimulationError
            When the plant diverges or no step is small enough for it.
        TooManySteps
        """
        window = None if take is None else Window(plan.grid, self.system.states, take, room)
        memory = self.memory(plan, start, tolerance, window)
        memory.stop_without(until)
        chunk = 1 if tolerance or progress else _FIRST  # adaptive segments may be long
        passed, tries = 0, 0
        for part, segments in enumerate(plan.parts()):
            if part:  # it has the first
                memory.take(segments)
            work = (segments.counts[:, 2] - segments.counts[:, 1] + 1).cumsum()  # steps, and what happens before
            stop, done = 0, 0
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
                    if pauses * _BUDGET >= PATIENCE:
                        if memory.real("now") - reached < _PROGRESS * plan.span:
                            memory.set_real("hopeless", 2 * memory.real("step"))
                        pauses, reached = 0, memory.real("now")
                    granted = memory["budget"] = _granted(limit - tries)
                    verdict = self._run(memory.address, stop)
                tries += granted - memory["budget"]
                if window:
                    window.check()
                if memory["stopped"]:
                    return memory.result(tries if tolerance else plan.steps)
                if verdict != DONE:
                    stiff = isinstance(self.method, Rosenbrock)
                    message = _explain(verdict, plan.origin + memory.real("now"), stiff=stiff)
                    if verdict == PLANT_DIVERGED:
                        raise PlantDiverged(message, memory.real("now"))
                    if verdict == STEP_TOO_SMALL:
                        raise NoStep(message, memory.real("now"))
                    if verdict == HISTORY_TOO_SHORT and tolerance:
                        raise ShortHistory(message, memory.real("now"))
                    raise SimulationError(message)
                spent = max(time.perf_counter() - before, 1e-6)
                chunk = min(max(1, int(chunk * min(_SLICE / spent, 8.0))), _LARGEST)
                if progress:
                    progress(min((passed + done) / plan.work, 1.0))
            passed += done
        lost = float(memory.arrays["lost"].min())
        if lost < np.inf:
            raise PlantDiverged(
                _explain(PLANT_DIVERGED, plan.origin + lost, stiff=isinstance(self.method, Rosenbrock)), lost
            )
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
        f"{ADAPTIVE_HISTORY} steps; use a fixed step",
    }[verdict]
