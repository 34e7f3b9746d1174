"""A system compiled once, and its runs."""

from __future__ import annotations

import ctypes
import time
from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from hgorun.engine.generate import generate
from hgorun.engine.history_room import ADAPTIVE_HISTORY
from hgorun.engine.layout import DONE, HISTORY_TOO_SHORT, PAUSED, PLANT_DIVERGED, STEP_TOO_SMALL, WORD, HybridSystem
from hgorun.engine.memory import Memory, Raw, Start, Tolerance
from hgorun.engine.methods import METHODS, Rosenbrock
from hgorun.engine.plan import Plan
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
        passed, tries, all_work = 0, 0, plan.work
        for part, segments in enumerate(plan.parts()):
            if part:  # it has the first
                memory.take(segments)
            stop, done, count = 0, 0, segments.size
            work = segments.work if chunk < all_work or progress else None
            while stop < count:
                before = time.perf_counter()
                if work is None:  # the whole plan takes less than a slice
                    stop = count
                else:
                    stop = max(stop + 1, bisect_right(work, done + chunk))
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
                            memory.context.view(float)[WORD["hopeless"]] = 2 * memory.real("step")
                        pauses, reached = 0, memory.real("now")
                    granted = memory["budget"] = _granted(limit - tries)
                    verdict = self._run(memory.address, stop)
                tries += granted - memory["budget"]
                if window:
                    window.check()
                if memory["stopped"]:
                    return memory.result(tries if tolerance else plan.steps)
                if verdict != DONE:
                    raise self._failed(verdict, plan, memory.real("now"), controlled=tolerance is not None)
                spent = max(time.perf_counter() - before, 1e-6)
                chunk = min(max(1, int(chunk * min(_SLICE / spent, 8.0))), _LARGEST)
                if progress:
                    progress(min((passed + done) / plan.work, 1.0))
            passed += done
        lost = float(memory.arrays["lost"].min())
        if lost < np.inf:
            raise self._failed(PLANT_DIVERGED, plan, lost, controlled=tolerance is not None)
        return memory.result(tries if tolerance else plan.steps)

    def _failed(self, verdict: int, plan: Plan, t: float, *, controlled: bool) -> SimulationError:
        """What ended a run at time t, counted from its start."""
        message = _explain(verdict, plan.origin + t, stiff=isinstance(self.method, Rosenbrock))
        if verdict == PLANT_DIVERGED:
            return PlantDiverged(message, t)
        if verdict == STEP_TOO_SMALL:
            return NoStep(message, t)
        if verdict == HISTORY_TOO_SHORT and controlled:
            return ShortHistory(message, t)
        return SimulationError(message)


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
