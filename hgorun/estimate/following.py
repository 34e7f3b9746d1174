"""A run that follows events as they come: what each of them does to the observers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from hgorun.engine.layout import ARRIVE, JUMP, REBASE, RECORD, TAKE
from hgorun.engine.plan import Floats, Integers
from hgorun.engine.session import without
from hgorun.estimate.event import Event
from hgorun.estimate.gate import Gate
from hgorun.estimate.gated import jumps_by_several, leave_out
from hgorun.estimate.lateness import disagreement
from hgorun.estimate.live_system import LATE, LiveSystem, slot_of

Notes: TypeAlias = list[Any]  # of numbers, and lists of them: as JSON has them
State: TypeAlias = tuple[dict[str, Floats], Notes]  # the numbers of a run, and what is known beside them

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
    newest : list of list of float
        When the newest sample of each output that each observer has used had been taken.
    limited : list of bool
        Which outputs have a gate.
    offered, outliers : list of list of int
        How many samples of each output with a gate each observer has judged, and how many of them it has left out.
    """

    def __init__(self, system: LiveSystem, gates: Mapping[str, float]) -> None:
        self.system, self.live = system, system.live()
        limits = [gates.get(name) for name in system.outputs]
        self.gate = Gate(system.experiment, limits, system.covariances) if gates else None
        self.limited = [limit is not None for limit in limits]
        self._different = disagreement(system.experiment)
        self.heard = [False] * len(limits)
        self._every, count = range(len(system.labels)), len(system.labels)
        self.newest = [[-np.inf] * count for _ in limits]
        self.offered = [[0] * count for _ in limits]
        self.outliers = [[0] * count for _ in limits]
        self._pending = [0] * len(limits)
        self._last_sample = np.nan
        self._told: dict[int, float] = {}
        self._rows: dict[object, Integers] = {}
        self._held = system.structure.system.held
        self._regime = system.regimes[tuple(self.heard)]
        self._looks_before = self.gate is not None or bool(system.steps)  # at the states before a sample arrives

    @property
    def regime(self) -> int:
        """What the system is between the samples, by the outputs that have been heard."""
        return self._regime

    def by_innovation(self, t: float) -> bool:
        """Whether late samples enter the innovation of all observers; otherwise all go back, or none takes them."""
        if self._different is not None:
            raise ValueError(f"the sample taken at {t:g} is late, and {self._different.message}")
        return "innovation" in self.system.treatments.values()

    def next_slot(self, output: int) -> int:
        """A place for a late sample: one after the other, around."""
        self._pending[output] = self._pending[output] % LATE + 1
        return slot_of(output, self._pending[output])

    def carry_out(self, event: Event) -> None:
        """Go on to an event, and let it happen."""
        live = self.live
        if self.system.driven and live.t <= 0.0 and not any(self.heard):
            self._begin(event)
        if self._looks_before or event.inputs or not (event.take or event.samples):
            live.advance(event.t, self._regime)
            for number, value in event.inputs:
                place, slope, since, _ = self._held.input(number)
                live.w[place], live.w[slope], live.w[since] = value, 0.0, event.t
            if not (event.take or event.samples):
                return
        for _, slot, value in event.samples:
            live.samples[slot] = value
        taking = {i: self._taking(i, event) for i, _, _ in event.samples}
        used = tuple([bool(taking[i]) for i, _, _ in event.samples])
        jumps = self._jumps(event) if True in used else ()
        gated = self.gate is not None and any(self.limited[i] and taking[i] for i in taking)
        z, w = (live.z.copy(), live.w.copy()) if gated else (live.z, live.w)
        fresh = [self._held.fresh(i) for i, members in taking.items() if members] if self._held.flags else []
        for place in fresh:
            live.w[place] = 1.0
        actions = self._actions(event, used, jumps)
        live.happen_at(event.t, actions, self._regime)
        for place in fresh:
            live.w[place] = 0.0
        out = dict[int, list[tuple[int, int]]]()
        for i, slot, _ in event.samples:
            if taking[i]:
                if not self.heard[i]:
                    self.heard[i] = True
                    self._regime = self.system.regimes[tuple(self.heard)]
                for j in self._left_out(i, slot, event, taking[i], z, w):
                    out.setdefault(j, []).append((i, slot))
                    leave_out(self.system.structure.system, live, i, j, z, w)
        for j, samples in out.items():
            self._jump_without(event, j, samples, fresh, actions, z, w)

    def _taking(self, output: int, event: Event) -> Sequence[int]:
        """The observers that have used no newer sample of an output."""
        newest = self.newest[output]
        if event.taken == event.t:
            return self._every
        return [j for j, taken in enumerate(newest) if event.taken >= taken]

    def _left_out(self, i: int, slot: int, event: Event, taking: Sequence[int], z: Floats, w: Floats) -> list[int]:
        """The observers to which a sample that has arrived is an outlier, and those that have used a newer one."""
        newest, outliers = self.newest[i], list[int]()
        if self.gate is not None and self.limited[i]:
            outliers = self.gate.outliers(i, self.live.innovations[slot], event.t, z, w, taking)
            for j in taking:
                self.offered[i][j] += 1
                self.outliers[i][j] += j in outliers
        for j in taking:
            if j not in outliers:
                newest[j] = event.taken
        return [j for j in self._every if j in outliers or j not in taking]

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
        self,
        event: Event,
        j: int,
        samples: list[tuple[int, int]],
        fresh: list[int],
        actions: Integers,
        z: Floats,
        w: Floats,
    ) -> None:
        """Let an observer jump by those of the samples of an event alone that are no outliers to it."""
        live, system = self.live, self.system.structure.system
        start, stop, _ = system.blocks[j]
        if not jumps_by_several(system, start):
            return
        kept, out = live.state(), {system.held.fresh(i) for i, _ in samples}
        live.z[...], live.w[...] = z, w
        live.w[[place for place in fresh if place not in out]] = 1.0
        live.happen_at(event.t, without(actions, samples, ()), self._regime)
        states = live.z[start:stop].copy()
        live.restore(kept)
        live.z[start:stop] = states

    def _jumps(self, event: Event) -> tuple[int, ...]:
        """What jumps when something arrives: corrections, and steps from the second sample on."""
        system, found = self.system, self.system.corrections
        if system.steps:
            if not np.isnan(self._last_sample):
                self.live.w[system.structure.system.held.interval] = event.t - self._last_sample
                found = system.steps + found
            else:
                system.begun(event.t, self.live.z)
            self._last_sample = event.t
        return found

    def _actions(self, event: Event, used: tuple[bool, ...], jumps: tuple[int, ...]) -> Integers:
        """Rows of the engine's action table, in their order; kept, since few of them differ."""
        key = (event.take, tuple([(i, slot) for i, slot, _ in event.samples]), used, jumps)
        if key not in self._rows:
            rows = [(TAKE, i, slot, 0, 0) for i, slot in event.take]
            arriving = list(zip(event.samples, used, strict=True))
            rows += [(ARRIVE if heard else RECORD, i, slot, 0, 0) for (i, slot, _), heard in arriving]
            if self.system.structure.system.has_alpha:
                late = ((i, slot_of(i, 1), slot_of(i + 1)) for (i, _, _), heard in arriving if heard)
                rows += [(REBASE, i, 0, first, last) for i, first, last in late]
            rows += [(JUMP, number, 0, 0, 0) for number in jumps]
            if len(self._rows) > _ROWS:
                self._rows.clear()
            self._rows[key] = np.array(rows, dtype=np.int64)
        return self._rows[key]

    def state(self) -> State:
        """All that the run goes on from, copied."""
        gate = None if self.gate is None else [[one.state() for one in row] for row in self.gate.deviations]
        counts = _copied(self.offered), _copied(self.outliers)
        known = self.heard.copy(), _copied(self.newest), self._pending.copy(), self._last_sample, gate
        return self.live.state(), [*known, *counts, list(self._told.items())]

    def restore(self, state: State) -> None:
        """Go on from what :meth:`state` gave."""
        numbers, notes = state
        heard, newest, pending, self._last_sample, gate, *counts = notes
        self.heard, self._pending, self.newest = heard.copy(), pending.copy(), self._of_each(newest)
        self._regime = self.system.regimes[tuple(self.heard)]
        if counts:  # older checkpoints have none
            self.offered, self.outliers = self._of_each(counts[0]), _copied(counts[1])
            self._told = {number: value for pairs in counts[2:] for number, value in pairs}
        if self.gate is not None and gate is not None:
            for row, kept in zip(self.gate.deviations, gate, strict=True):
                for one, innovations in zip(row, kept, strict=True):
                    one.restore(innovations)
        self.live.restore(numbers)

    def _of_each(self, numbers: Sequence[Any]) -> list[list[Any]]:
        """Of every output those of each observer, copied; older checkpoints have one for all of them."""
        return [one.copy() if isinstance(one, list) else [one] * len(self._every) for one in numbers]

    def go_back(self, state: State) -> None:
        """As :meth:`restore`, but no slot of a sample that is on its way is given to another."""
        pending = self._pending
        self.restore(state)
        self._pending = pending


def _copied(rows: Sequence[list[Any]]) -> list[list[Any]]:
    return [row.copy() for row in rows]
