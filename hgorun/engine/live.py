"""A run whose events are not known before they happen."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, MutableSequence, Sequence
from typing import TypeAlias, cast

import numpy as np

from hgorun.engine.again import Again
from hgorun.engine.at_once import segments, steps_of
from hgorun.engine.early import NONE, Breaks
from hgorun.engine.layout import ACTION_WORDS, COUNT, DONE, SPAN, WORD
from hgorun.engine.memory import Memory, Start
from hgorun.engine.plan import Floats, Integers, Plan
from hgorun.engine.program import Program
from hgorun.errors import SimulationError

LiveState: TypeAlias = tuple[float, bytes]
"""What a run goes on from: its time, and numbers that :meth:`Live.told` names."""

_SEGMENT = WORD["segment"]
_STEPS, _LAST, _REGIME, _ACTIONS = (COUNT.index(name) for name in ("steps", "last", "regime", "action_last"))
# The two segments of the memory: the flow, and what happens then, which takes no time.
_EVENT, _EVENT_COUNTS = len(SPAN), len(COUNT)
_ONE, _TWO = ctypes.c_int64(1), ctypes.c_int64(2)  # which a call need not make anew


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
    breaks : Breaks, optional
        At these times a step ends, too.
    again : Again, optional
        A flow that loses an observer is made again for it.
    """

    def __init__(
        self,
        program: Program,
        start: Start,
        t: float,
        slots: int,
        step: float,
        at_once: int = 0,
        breaks: Breaks = NONE,
        again: Again | None = None,
    ) -> None:
        self._program, self._step, self.t, self._again = program, step, t, again
        nothing = np.zeros(0)
        plan = Plan(
            spans=np.full((2, 4), t),
            counts=np.array([[1, 0, 0, 0, 0, 0, 0]] * 2, dtype=np.int64),
            actions=np.zeros((1, ACTION_WORDS), dtype=np.int64),
            grid=nothing,
            slots=slots + at_once,
            gain=np.ones(slots + at_once),
            bias=np.zeros(slots + at_once),
            holds=np.array([0.0, 1.0]),
        )
        self.at_once, self.slots = at_once, slots
        self._breaks, self._settled, self._clear = breaks, breaks.settled, (t, t)
        self._memory: Memory = program.memory(plan, start)
        arrays, self._kept = self._memory.arrays, dict[str, slice]()
        # Those numbers that a run goes on from lie in one piece, which is copied at once. Of samples that are carried
        # out at once nothing is left, but of those in the first slots.
        end, first = 0, {"slots": slots * program.system.width}
        for name in ("z", "w", "diverged", "largest", "slots"):
            self._kept[name] = slice(end, end + first.get(name, arrays[name].size))
            end += arrays[name].size
        block = np.empty(end)
        for name, part in self._kept.items():
            own = block[part.start : part.start + arrays[name].size].reshape(arrays[name].shape)
            own[...] = arrays[name]
            self._memory.put(name, own)
        self._numbers: Floats = block[: self._kept["slots"].stop]
        self._bytes = self._numbers.data.cast("B")
        self.z: Floats = arrays["z"].reshape(-1)
        self.w: Floats = arrays["w"].reshape(-1)
        self.innovations: Floats = arrays["innovations"][:, :, 0]
        self.samples: Floats = arrays["bias"].reshape(-1)
        self.diverged: Floats = arrays["diverged"].reshape(-1)
        self._largest: Floats = arrays["largest"]
        self._memory.put("rows", np.empty((1, *arrays["rows"].shape[1:])))
        self.before: Floats = arrays["rows"].reshape(-1)  # all states, where an action has shown them in row 0
        # words are written much faster than rows of arrays
        self._span_words = cast("MutableSequence[float]", arrays["spans"].reshape(-1).data)
        self._count_words = cast("MutableSequence[int]", arrays["counts"].reshape(-1).data)
        self.sample_words = cast("MutableSequence[float]", self.samples.data)
        self._words = cast("MutableSequence[int]", self._memory.context.data)
        self._go_on = program.caller(self._memory)
        self._actions: Integers | None = None  # those in the memory

    def advance(self, t: float, regime: int) -> None:
        """Go on to a time; nothing happens but the flow.

        Parameters
        ----------
        regime : int
            The number of what the outputs are meanwhile.
        """
        if t > self.t:
            if self._broken(self.t, t):
                self._begin(t, regime)
            self._flow_alone(t, regime)

    def happen_at(self, t: float, actions: Integers, regime: int) -> None:
        """Go on to a time, as :meth:`advance`; then something happens: rows of the engine's action table."""
        spans, counts, first, before = self._span_words, self._count_words, 1, None
        if actions is not self._actions:
            self._memory.put("actions", actions)
            self._actions = actions
            counts[_EVENT_COUNTS + _ACTIONS] = len(actions)
        if t > self.t:
            if self._broken(self.t, t):
                self._begin(t, regime)
            before, lost = self._before()
            self._flow_to(t, regime)
            first = 0
        else:
            t = self.t
        spans[_EVENT] = spans[_EVENT + 1] = spans[_EVENT + 2] = spans[_EVENT + 3] = t
        if self._broken(t, t):
            spans[_EVENT + 2] = spans[_EVENT + 3] = t + self._breaks.inward(t)
        counts[_EVENT_COUNTS + _REGIME] = regime
        self._run(first, _TWO)
        if before is not None and self.diverged.tolist() != lost:
            self._flow_again(before, t, regime)
            self._run(1, _TWO)
        self.t = t

    @property
    def free_until(self) -> float:
        """Up to when no step ends where nothing happens, so that events may be carried out at once."""
        if self.t >= self._settled:
            return math.inf
        return self.t if self._broken(self.t, self.t) else self._clear[1]

    def _broken(self, since: float, t: float) -> bool:
        """Whether a step ends at one of two times, or between them, where nothing happens."""
        if self._clear[0] < since and t < self._clear[1]:
            return False
        if since >= self._settled:
            return False
        self._clear = low, high = self._breaks.clear(since)
        return not (low < since and t < high)

    def _begin(self, end: float, regime: int) -> None:
        """Go through the steps that end early, but for the last one before a time."""
        for t in self._breaks.between(self.t, end):
            self._flow_alone(t, regime)

    def _flow_alone(self, t: float, regime: int) -> None:
        """Go on to a later time, in equal steps; nothing happens there."""
        before, lost = self._before()
        self._flow_to(t, regime)
        self._run(0, _ONE)
        if before is not None and self.diverged.tolist() != lost:
            self._flow_again(before, t, regime)
        self.t = t

    def _before(self) -> tuple[LiveState | None, list[float]]:
        """From where a flow is made again that loses an observer, and when each was lost; nothing where it is not."""
        return (None, []) if self._again is None else (self.state(), self.diverged.tolist())

    def _flow_again(self, before: LiveState, t: float, regime: int) -> None:
        """Go on to a later time where a flow may have lost an observer.

        Each that it has lost becomes what shorter steps give, if they do not lose it.
        """
        again = self._again
        assert again is not None
        self.restore(before)
        bound = again.bound(self._memory)
        there = again.lost(self.z, bound)
        self._flow_to(t, regime)
        self._run(0, _ONE)
        lost = again.lost(self.z, bound) - there
        after, found = self.state(), dict[int, tuple[Floats, float]]()
        for times in again.more(self._count_words[_STEPS]) if lost else ():
            self.restore(before)
            self._flow_to(t, regime, times)
            self._run(0, _ONE)
            for j in lost - again.lost(self.z, bound):
                start, _, end = again.blocks[j]
                found[j] = self.z[start:end].copy(), float(self.diverged[j])
            lost -= found.keys()
            if not lost:
                break
        self.restore(after)
        for j, (z, diverged) in found.items():
            start, _, end = again.blocks[j]
            self.z[start:end], self.diverged[j] = z, diverged

    def _flow_to(self, t: float, regime: int, times: int = 1) -> None:
        """Write the segment from here to a later time, with so many times the steps that it needs."""
        since, spans, counts = self.t, self._span_words, self._count_words
        steps = times * steps_of(t - since, self._step)
        spans[0] = spans[2] = since
        spans[1] = spans[3] = t
        if self._broken(since, t):
            spans[2], spans[3] = since + self._breaks.inward(since), t - self._breaks.inward(t)
        counts[_STEPS] = counts[_LAST] = steps
        counts[_REGIME] = regime

    def go_through(self, times: Floats, regime: int, actions: Integers, holds: Floats) -> Floats | None:
        """Go on through events, as :meth:`happen_at` would one after the other.

        Nothing has happened where an observer is lost for which a flow should be made again.

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
        ndarray, shape (N, states), or None
            The rows that are shown.
        """
        since, alive = self._before()
        count, each = actions.shape[:2]
        spans, counts = segments(self.t, times, self._step, regime, each)
        rows = np.empty((count, self.z.size))
        own = {name: self._memory.arrays[name] for name in ("spans", "counts", "holds", "rows")}
        for name, array in (("spans", spans), ("counts", counts), ("holds", holds), ("rows", rows)):
            self._memory.put(name, array)
        self._memory.put("actions", actions.reshape(-1, ACTION_WORDS))
        self._actions = None
        try:
            self._run(0, ctypes.c_int64(len(counts)))
        finally:
            for name, array in own.items():
                self._memory.put(name, array)
        if since is not None and self.diverged.tolist() != alive:
            self.restore(since)
            return None
        self.t = float(times[-1])
        return rows

    def _run(self, first: int, stop: ctypes.c_int64) -> None:
        self._words[_SEGMENT] = first
        if self._go_on(stop) != DONE:
            raise SimulationError(f"the run cannot go on at t = {self.t:.6g}")

    def begin_with(self, z: Floats, largest: float) -> None:
        """Begin with other states; what the bound follows from is at least that."""
        self.z[...], self._largest[...] = z, largest

    def state(self) -> LiveState:
        """All that the run goes on from, copied."""
        return self.t, self._bytes.tobytes()

    def restore(self, state: LiveState) -> None:
        """Go on from what :meth:`state` gave."""
        self.t, self._bytes[:] = state

    def told(self, states: Sequence[LiveState]) -> dict[str, Floats]:
        """The numbers of some states by their names, those of each in a row."""
        rows = np.frombuffer(b"".join(numbers for _, numbers in states)).reshape(len(states), -1)
        found = {name: rows[:, part] for name, part in self._kept.items()}
        return found | {"t": np.array([[t] for t, _ in states])}

    def states(self, told: Mapping[str, Floats]) -> list[LiveState]:
        """Those of :meth:`told` again; what older ones do not tell is as it is now.

        Raises
        ------
        ValueError
            For numbers of another system.
        """
        times = told["t"].reshape(-1).tolist()
        rows = np.empty((len(times), self._numbers.size))
        for name, part in self._kept.items():
            rows[:, part] = told[name].reshape(len(times), -1) if name in told else self._numbers[part]
        return [(t, row.tobytes()) for t, row in zip(times, rows, strict=True)]
