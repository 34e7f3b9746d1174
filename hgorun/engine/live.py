"""A run whose events are not known before they happen."""

from __future__ import annotations

import math

import numpy as np

from hgorun.engine.layout import ACTION_WORDS, DONE
from hgorun.engine.memory import Memory, Start
from hgorun.engine.plan import Floats, Integers, Plan
from hgorun.engine.program import Program
from hgorun.errors import SimulationError

_KEPT = ("z", "w", "slots", "diverged", "innovations")  # of the memory: what a run goes on from
_ROUNDING = 1 - 1e-9


class Live:
    """A run with fixed steps that goes on from event to event, in memory of constant size.

    Parameters
    ----------
    program : Program
    start : Start
    t : float
        When it begins.
    slots : int
        Samples on their way, over all outputs.
    step : float
        No step is longer.
    """

    def __init__(self, program: Program, start: Start, t: float, slots: int, step: float) -> None:
        self._program, self._step, self.t = program, step, t
        nothing = np.zeros(0)
        plan = Plan(
            spans=np.full((1, 4), t),
            counts=np.array([[1, 0, 0, 0, 0, 0, 0]], dtype=np.int64),
            actions=np.zeros((1, ACTION_WORDS), dtype=np.int64),
            grid=nothing,
            slots=slots,
            gain=np.ones(slots),
            bias=np.zeros(slots),
            holds=nothing,
        )
        self._memory: Memory = program.memory(plan, start)
        arrays = self._memory.arrays
        self.z: Floats = arrays["z"].reshape(-1)
        self.w: Floats = arrays["w"].reshape(-1)
        self.innovations: Floats = arrays["innovations"][:, :, 0]
        self.samples: Floats = arrays["bias"].reshape(-1)
        self.diverged: Floats = arrays["diverged"].reshape(-1)
        self._spans, self._counts = arrays["spans"], arrays["counts"]

    def advance(self, t: float, regime: int) -> None:
        """Go on to a time; nothing happens but the flow.

        Parameters
        ----------
        regime : int
            The number of what the outputs are meanwhile.
        """
        gap = t - self.t
        if gap > 0:
            steps = max(math.ceil(gap / self._step * _ROUNDING), 1)
            self._spans[0] = self.t, t, self.t, t
            self._counts[0] = steps, 0, steps, regime, 0, 0, 0
            self._run()
            self.t = t

    def happen(self, actions: Integers, regime: int) -> None:
        """Something happens now: rows of the engine's action table."""
        self._spans[0] = self.t
        self._counts[0] = 1, 0, 0, regime, 0, len(actions), 0
        self._memory.set_actions(actions)
        self._run()

    def _run(self) -> None:
        self._memory["segment"] = 0
        if self._program.go_on(self._memory, 1) != DONE:
            raise SimulationError(f"the run cannot go on at t = {self.t:.6g}")

    def state(self) -> dict[str, Floats]:
        """All that the run goes on from, copied."""
        return {name: self._memory.arrays[name].copy() for name in _KEPT} | {"t": np.array([self.t])}

    def restore(self, state: dict[str, Floats]) -> None:
        """Go on from what :meth:`state` gave."""
        for name in _KEPT:
            self._memory.arrays[name][...] = state[name]
        self.t = float(state["t"][0])
