"""A run that follows events as they come: what each of them does to the observers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TypeAlias

import numpy as np

from hgorun.engine.layout import ARRIVE, JUMP, REBASE, RECORD, TAKE
from hgorun.engine.plan import Floats, Integers
from hgorun.engine.session import without
from hgorun.estimate.event import Event
from hgorun.estimate.gate import Gate
from hgorun.estimate.gated import jumps_by_several, leave_out
from hgorun.estimate.live_system import LATE, LiveSystem, slot_of

State: TypeAlias = tuple[dict[str, Floats], bytes]  # the numbers of a run, and what is known beside them

_ROWS = 1000  # of action tables that are kept


class Following:
    """A run of a system, with what is known of its outputs.

    Parameters
    ----------
    system : LiveSystem
    gates : mapping of str to float
        By output, standard deviations of the innovation beyond which a sample is not used.

    Attributes
    ----------
    system : LiveSystem
    live : Live
    gate : Gate or None
    heard : list of bool
        Which outputs have had a sample.
    newest : list of float
        When the newest sample of each output that was used had been taken.
    limited : list of bool
        Which outputs have a gate.
    offered, outliers : list of int, list of list of int
        How many samples each output with a gate has had, and how many of them each observer has left out.
    """

    def __init__(self, system: LiveSystem, gates: Mapping[str, float]) -> None:
        self.system, self.live = system, system.live()
        limits = [gates.get(name) for name in system.outputs]
        self.gate = Gate(system.experiment, limits, system.covariances) if gates else None
        self.limited = [limit is not None for limit in limits]
        self.heard = [False] * len(limits)
        self.newest = [-np.inf] * len(limits)
        self.offered = [0] * len(limits)
        self.outliers = [[0] * len(system.labels) for _ in limits]
        self._pending = [0] * len(limits)
        self._last_sample = np.nan
        self._told: dict[int, float] = {}
        self._rows: dict[object, Integers] = {}

    @property
    def regime(self) -> int:
        """What the system is between the samples, by the outputs that have been heard."""
        return self.system.regimes[tuple(self.heard)]

    def by_innovation(self, t: float) -> bool:
        """Whether late samples enter the innovation of all observers; otherwise all go back, or none takes them."""
        found = {treatment: label for label, treatment in self.system.treatments.items()}
        if len(found) > 1:
            said = ", ".join(f"{label}: {treatment}" for treatment, label in found.items())
            raise ValueError(
                f"the sample taken at {t:g} is late, and in a stream all observers treat late samples alike ({said})"
            )
        return "innovation" in found

    def next_slot(self, output: int) -> int:
        """A place for a late sample: one after the other, around."""
        self._pending[output] = self._pending[output] % LATE + 1
        return slot_of(output, self._pending[output])

    def carry_out(self, event: Event) -> None:
        """Go on to an event, and let it happen."""
        live, layout = self.live, self.system.structure.system.held
        if self.system.driven and live.t <= 0.0 and not any(self.heard):
            self._begin(event)
        live.advance(event.t, self.regime)
        for number, value in event.inputs:
            place, slope, since, _ = layout.input(number)
            live.w[place], live.w[slope], live.w[since] = value, 0.0, event.t
        if not (event.take or event.samples):
            return
        for _, slot, value, _ in event.samples:
            live.samples[slot] = value
        jumps = self._jumps(event)
        gated = self.gate is not None and any(self.limited[i] and used for i, _, _, used in event.samples)
        z, w = (live.z.copy(), live.w.copy()) if gated else (live.z, live.w)
        fresh = [layout.fresh(i) for i, _, _, used in event.samples if used and layout.flags]
        live.w[fresh] = 1.0
        actions = self._actions(event, jumps)
        live.happen(actions, self.regime)
        live.w[fresh] = 0.0
        out = dict[int, list[tuple[int, int]]]()
        for i, slot, _, used in event.samples:
            if used:
                self.heard[i] = True
                self.newest[i] = event.taken
                if self.gate is not None and self.limited[i]:
                    self.offered[i] += 1
                    for j in self.gate.outliers(i, live.innovations[slot], event.t, z, w):
                        self.outliers[i][j] += 1
                        out.setdefault(j, []).append((i, slot))
                        leave_out(self.system.structure.system, live, i, j, z, w)
        for j, samples in out.items():
            self._jump_without(event, j, samples, actions, z, w)

    def _begin(self, event: Event) -> None:
        """Let observers start with the inputs that are known by now.

        Raises
        ------
        ValueError
            Where they cannot, and something follows from their states.
        """
        system, live = self.system, self.live
        first = {number: value for number, value in event.inputs if event.t <= 0.0 or number not in self._told}
        if first:
            told = self._told | first
            live.z[...] = system.start_with(told)
            self._told = told
        if (event.samples or event.t > live.t) and np.isnan(live.z).any():
            missing = ", ".join(name for name, number in system.inputs.items() if number not in self._told)
            raise ValueError(
                f"{', '.join(system.driven)}: the derivatives of the output at the start depend on inputs, and "
                f"{missing} is not known yet: give inputs before the first sample, or with it"
            )

    def _jump_without(
        self, event: Event, j: int, samples: list[tuple[int, int]], actions: Integers, z: Floats, w: Floats
    ) -> None:
        """Let an observer jump by those of the samples of an event alone that are no outliers to it."""
        live, system = self.live, self.system.structure.system
        start, stop, _ = system.blocks[j]
        if not jumps_by_several(system, start):
            return
        kept = live.state()
        fresh = [system.held.fresh(i) for i, slot, _, used in event.samples if used and (i, slot) not in samples]
        live.z[...], live.w[...] = z, w
        live.w[fresh] = 1.0
        live.happen(without(actions, samples, ()), self.regime)
        states = live.z[start:stop].copy()
        live.restore(kept)
        live.z[start:stop] = states

    def _jumps(self, event: Event) -> tuple[int, ...]:
        """What jumps at an event: corrections whenever something arrives, steps from the second sample on."""
        if not event.uses_samples:
            return ()
        system, found = self.system, self.system.corrections
        if system.steps:
            if not np.isnan(self._last_sample):
                self.live.w[system.structure.system.held.interval] = event.t - self._last_sample
                found = system.steps + found
            else:
                system.begun(event.t, self.live.z)
            self._last_sample = event.t
        return found

    def _actions(self, event: Event, jumps: tuple[int, ...]) -> Integers:
        """Rows of the engine's action table, in their order; kept, since few of them differ."""
        key = (event.take, tuple((i, slot, used) for i, slot, _, used in event.samples), jumps)
        if key not in self._rows:
            rows = [(TAKE, i, slot, 0, 0) for i, slot in event.take]
            rows += [(ARRIVE if used else RECORD, i, slot, 0, 0) for i, slot, _, used in event.samples]
            if self.system.structure.system.has_alpha:
                late = ((i, slot_of(i, 1), slot_of(i + 1)) for i, _, _, used in event.samples if used)
                rows += [(REBASE, i, 0, first, last) for i, first, last in late]
            rows += [(JUMP, number, 0, 0, 0) for number in jumps]
            if len(self._rows) > _ROWS:
                self._rows.clear()
            self._rows[key] = np.array(rows, dtype=np.int64)
        return self._rows[key]

    def state(self) -> State:
        """All that the run goes on from, copied."""
        gate = None if self.gate is None else [[one.state() for one in row] for row in self.gate.deviations]
        known = [self.heard, self.newest, self._pending, self._last_sample, gate, self.offered, self.outliers]
        return self.live.state(), json.dumps([*known, list(self._told.items())]).encode()

    def restore(self, state: State) -> None:
        """Go on from what :meth:`state` gave."""
        numbers, notes = state
        self.heard, self.newest, self._pending, self._last_sample, gate, *counts = json.loads(notes)
        if counts:  # checkpoints of before have none
            self.offered, self.outliers, *more = counts
            self._told = {number: value for pairs in more for number, value in pairs}
        if self.gate is not None and gate is not None:
            for row, kept in zip(self.gate.deviations, gate, strict=True):
                for one, innovations in zip(row, kept, strict=True):
                    one.restore(innovations)
        self.live.restore(numbers)

    def go_back(self, state: State) -> None:
        """As :meth:`restore`, but no slot of a sample that is on its way is given to another."""
        pending = self._pending
        self.restore(state)
        self._pending = pending
