"""A session whose flows are made again with shorter steps, where those of the plan lose an observer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hgorun.engine.again import Again
from hgorun.engine.memory import Raw, Start
from hgorun.engine.plan import Floats, Plan
from hgorun.engine.program import Program
from hgorun.engine.session import Session

_AT_ONCE = 1024  # segments that are gone through again where an observer is lost in them


class CarefulSession(Session):
    """A run that goes through a flow again for each observer that is lost in it.

    Parameters
    ----------
    program, plan, start, late
        As of :class:`~hgorun.engine.session.Session`.
    again : Again
        Which observers are lost, and how often a flow is made again.
    """

    def __init__(self, program: Program, plan: Plan, start: Start, again: Again, *, late: bool = False) -> None:
        super().__init__(program, plan, start, late=late)
        self._again, self._more = again, 0

    def advance(self, stop: int) -> None:
        """Go on to the start of segment ``stop``, before what happens there."""
        while self._at < stop:
            self._go_on_together(self._end_of_flow(min(stop, self._at + _AT_ONCE), stop))

    def _end_of_flow(self, end: int, stop: int) -> int:
        """The first segment from ``end`` on that begins with the first step of a flow, or ``stop``."""
        begins = np.flatnonzero(self._plan.counts[end:stop, 1] == 0)
        return end + int(begins[0]) if begins.size else stop

    def _go_on_together(self, stop: int) -> None:
        """Go on to the start of a segment; what loses an observer is gone through again, flow by flow."""
        before, mark = self._lost(), self.mark(stop)
        snapshots = self._memory.arrays["snapshots"].copy()
        self._go_on(stop)
        if self._lost() <= before:
            return
        self._memory.arrays["snapshots"][...] = snapshots
        self.go_back(mark)
        while self._at < stop:
            self._flow(self._end_of_flow(self._at + 1, stop))

    def _flow(self, stop: int) -> None:
        """Go on by one flow; each observer that it loses becomes what shorter steps give, if they do not lose it."""
        again, memory = self._again, self._memory
        before, mark, row = self._lost(), self.mark(stop), memory["row"]
        self._go_on(stop)
        lost = self._lost() - before
        if not lost:
            return
        after, rows, diverged = self.mark(stop), memory.arrays["rows"][row : memory["row"]], memory.arrays["diverged"]
        shown, found = rows.copy(), dict[int, tuple[Floats, Floats, Floats]]()
        steps = self._plan.counts[mark.at : stop, :3]
        kept = steps.copy()
        try:
            for times in again.more(int(kept[0, 0])):
                self.go_back(mark)
                steps[...] = times * kept
                self._go_on(stop)
                self._more += int(np.sum(steps[:, 2] - steps[:, 1]))
                for j in lost - self._lost():
                    start, _, end = again.blocks[j]
                    found[j] = self.z[start:end].copy(), rows[:, start:end].copy(), diverged[j].copy()
                lost -= found.keys()
                if not lost:
                    break
        finally:
            steps[...] = kept  # the tables may be those of another run, too
        self.go_back(after)
        rows[...] = shown
        for j, (z, seen, when) in found.items():
            start, _, end = again.blocks[j]
            self.z[start:end], rows[:, start:end], diverged[j] = z, seen, when

    def _lost(self) -> frozenset[int]:
        return self._again.lost(self.z, self._again.bound(self._memory))

    def finish(self) -> Raw:
        """The rest of the run, and what it has given."""
        found = super().finish()
        return replace(found, tries=found.tries + self._more)
