"""Rows of the engine's action table of what happens at an event of a stream, kept since few of them differ."""

from __future__ import annotations

import numpy as np

from hgorun.engine.layout import ARRIVE, JUMP, REBASE, RECORD, SET, SHOW, TAKE
from hgorun.engine.plan import Integers
from hgorun.estimate.stream.event import Event
from hgorun.estimate.stream.live_system import LiveSystem, slot_of

_KEPT = 1000  # action tables
_ZERO, _ONE = 0, 1  # the numbers that are set, as a live run has them


class ActionRows:
    """The actions of events.

    Parameters
    ----------
    system : LiveSystem
    """

    def __init__(self, system: LiveSystem) -> None:
        self._system = system
        self._rows: dict[object, Integers] = {}

    def on_time(self, event: Event) -> Integers:
        """As :meth:`of`, of samples that all observers take as they come."""
        actions = self._rows.get(event.take)
        if actions is None:
            actions = self.of(event, (True,) * len(event.samples), self._system.corrections, gated=False)
            self._rows[event.take] = actions
        return actions

    def of(self, event: Event, used: tuple[bool, ...], jumps: tuple[int, ...], *, gated: bool) -> Integers:
        """The rows of an event, in their order.

        Parameters
        ----------
        used : tuple of bool
            Whether any observer takes each of its samples.
        jumps : tuple of int
            What jumps.
        gated : bool
            Whether the state before the event is looked at.
        """
        key = (event.take, tuple([(i, slot) for i, slot, _ in event.samples]), used, jumps, gated)
        if key not in self._rows:
            system, arriving = self._system.structure.system, list(zip(event.samples, used, strict=True))
            fresh = [system.held.fresh(i) for (i, _, _), heard in arriving if heard and system.held.flags]
            rows = [(SHOW, 0, 0, 0, 0)] if gated else []
            rows += [(SET, place, _ONE, 0, 0) for place in fresh]
            rows += [(TAKE, i, slot, 0, 0) for i, slot in event.take]
            rows += [(ARRIVE if heard else RECORD, i, slot, 0, 0) for (i, slot, _), heard in arriving]
            if system.has_alpha:
                rows += [(REBASE, i, slot, slot_of(i), slot_of(i + 1)) for (i, slot, _), heard in arriving if heard]
            rows += [(JUMP, number, 0, 0, 0) for number in jumps]
            rows += [(SET, place, _ZERO, 0, 0) for place in fresh]
            if len(self._rows) > _KEPT:
                self._rows.clear()
            self._rows[key] = np.array(rows, dtype=np.int64)
        return self._rows[key]
