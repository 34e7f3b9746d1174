"""A run whose events are not known before they happen."""

from __future__ import annotations

import math
from collections.abc import MutableSequence
from typing import cast

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
    at_once : int
        So many events may be carried out at once, see :meth:`go_through`.
    """

    def __init__(self, program: Program, start: Start, t: float, slots: int, step: float, at_once: int = 0) -> None:
        self._program, self._step, self.t = program, step, t
        nothing = np.zeros(0)
        plan = Plan(
            spans=np.full((2, 4), t),
            counts=np.array([[1, 0, 0, 0, 0, 0, 0]] * 2, dtype=np.int64),
            actions=np.zeros((1, ACTION_WORDS), dtype=np.int64),
            grid=nothing,
            slots=slots + at_once,
            gain=np.ones(slots + at_once),
            bias=np.zeros(slots + at_once),
            holds=nothing,
        )
        self.at_once, self.slots = at_once, slots
        self._memory: Memory = program.memory(plan, start)
        arrays = self._memory.arrays
        self.z: Floats = arrays["z"].reshape(-1)
        self.w: Floats = arrays["w"].reshape(-1)
        self.innovations: Floats = arrays["innovations"][:, :, 0]
        self.samples: Floats = arrays["bias"].reshape(-1)
        self.diverged: Floats = arrays["diverged"].reshape(-1)
        # of samples that are carried out at once nothing is left, but of those in the first slots
        own = {"slots": slots * program.system.width, "innovations": slots}
        self._kept = {name: arrays[name][: own.get(name)] for name in _KEPT}
        # of at most two segments: words are written much faster than rows of arrays
        self._span_words = cast("MutableSequence[float]", arrays["spans"].reshape(-1).data)
        self._count_words = cast("MutableSequence[int]", arrays["counts"].reshape(-1).data)
        self._actions: Integers | None = None  # those in the memory

    def advance(self, t: float, regime: int) -> None:
        """Go on to a time; nothing happens but the flow.

        Parameters
        ----------
        regime : int
            The number of what the outputs are meanwhile.
        """
        if self._flow_to(t, regime):
            self._run()
            self.t = t

    def happen_at(self, t: float, actions: Integers, regime: int) -> None:
        """Go on to a time, as :meth:`advance`; then something happens: rows of the engine's action table."""
        if actions is not self._actions:
            self._memory.put("actions", actions)
            self._actions = actions
        segments = self._flow_to(t, regime)
        spans, counts = self._span_words, self._count_words
        place, word = 4 * segments, 7 * segments
        spans[place] = spans[place + 1] = spans[place + 2] = spans[place + 3] = max(t, self.t)
        counts[word], counts[word + 2], counts[word + 3], counts[word + 5] = 1, 0, regime, len(actions)
        self._run(segments + 1)
        self.t = max(t, self.t)

    def _flow_to(self, t: float, regime: int) -> int:
        """Write the segment from here to a time: how many there are, none where the time has been reached."""
        gap = t - self.t
        if not gap > 0:
            return 0
        steps = max(math.ceil(gap / self._step * _ROUNDING), 1)
        spans, counts = self._span_words, self._count_words
        spans[0] = spans[2] = self.t
        spans[1] = spans[3] = t
        counts[0] = counts[2] = steps
        counts[3] = regime
        counts[5] = 0
        return 1

    def go_through(self, times: Floats, regime: int, actions: Integers, holds: Floats) -> Floats:
        """Go on through events, as :meth:`happen_at` would one after the other.

        Parameters
        ----------
        times : ndarray, shape (N,)
            When they happen; ascending.
        regime : int
            The same all the while.
        actions : ndarray of int, shape (N, k, 5)
            Rows of the engine's action table for each of them; they show a row of output each.
        holds : ndarray
            Numbers that they set.

        Returns
        -------
        ndarray, shape (N, states)
            The rows that are shown.
        """
        count, each = actions.shape[:2]
        spans, counts = np.empty((2 * count, 4)), np.zeros((2 * count, 7), dtype=np.int64)
        before = np.append(self.t, times[:-1])
        gaps = times - before
        steps = np.maximum(np.ceil(gaps / self._step * _ROUNDING), 1.0).astype(np.int64)
        spans[::2, ::2], spans[::2, 1::2] = before[:, None], times[:, None]
        counts[::2, 0], counts[::2, 2], counts[:, 3] = steps, steps, regime
        spans[1::2], counts[1::2, 0] = times[:, None], 1
        first = each * np.arange(count)
        counts[1::2, 4], counts[1::2, 5] = first, first + each
        happens = np.ones(2 * count, dtype=bool)
        happens[::2] = gaps > 0
        rows = np.empty((count, self.z.size))
        own = {name: self._memory.arrays[name] for name in ("spans", "counts", "holds", "rows")}
        for name, array in (("spans", spans[happens]), ("counts", counts[happens]), ("holds", holds), ("rows", rows)):
            self._memory.put(name, array)
        self._memory.put("actions", actions.reshape(-1, ACTION_WORDS))
        self._actions = None
        try:
            self._run(int(np.count_nonzero(happens)))
        finally:
            for name, array in own.items():
                self._memory.put(name, array)
        self.t = float(times[-1])
        return rows

    def _run(self, segments: int = 1) -> None:
        self._memory["segment"] = 0
        if self._program.go_on(self._memory, segments) != DONE:
            raise SimulationError(f"the run cannot go on at t = {self.t:.6g}")

    def state(self) -> dict[str, Floats]:
        """All that the run goes on from, copied."""
        return {name: values.copy() for name, values in self._kept.items()} | {"t": np.array([self.t])}

    def restore(self, state: dict[str, Floats]) -> None:
        """Go on from what :meth:`state` gave."""
        for name, values in self._kept.items():
            values[...] = state[name]
        self.t = float(state["t"][0])
