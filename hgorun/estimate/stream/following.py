"""A run that follows events as they come: what each of them does to the observers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from hgorun.engine.live import LiveState
from hgorun.engine.plan import Floats, Integers
from hgorun.engine.turns import without
from hgorun.estimate.gate.gate import Gate
from hgorun.estimate.gate.leaving_out import jumps_by_several, leave_out
from hgorun.estimate.gate.own_steps import OwnSteps, stepping
from hgorun.estimate.stream import notes
from hgorun.estimate.stream.action_rows import ActionRows
from hgorun.estimate.stream.event import Event
from hgorun.estimate.stream.first_told import begin
from hgorun.estimate.stream.gaps import Gaps
from hgorun.estimate.stream.lateness import why_refused
from hgorun.estimate.stream.live_system import LATE, LiveSystem, slot_of
from hgorun.estimate.stream.notes import InARow, Notes, gone_on, increased
from hgorun.estimate.stream.stepping import keep_inputs, require_times, require_whole

State: TypeAlias = tuple[LiveState, Notes]


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
    heard : tuple of bool
        Which outputs have had a sample.
    newest : list of tuple of float
        When the newest sample of each output that each observer has used had been taken.
    limited : list of bool
        Which outputs have a gate.
    unchecked : bool
        Whether time has not gone on yet, so that the start may still depend on inputs that come with samples.
    offered, outliers : list of tuple of int
        How many samples of each output with a gate each observer has judged, and how many of them it has left out.
    in_a_row : sequence of tuple of (int, int)
        How many of them it has left out one after the other, now and at most.
    """

    def __init__(self, system: LiveSystem, gates: Mapping[str, float]) -> None:
        self.system, self.live = system, system.live()
        limits = [gates.get(name) for name in system.outputs]
        self.gate = Gate(system.experiment, limits, system.covariances) if gates else None
        self._stepping = stepping(system.experiment, system.labels) if gates else frozenset()
        self._own = OwnSteps(system.structure.system, range(len(limits)))
        self.limited = [limit is not None for limit in limits]
        self._different = why_refused(system.experiment)
        self._every, self._count = range(len(system.labels)), len(system.labels)
        self.heard = (False,) * len(limits)
        self.newest = [(-math.inf,) * self._count] * len(limits)
        self.offered = [(0,) * self._count] * len(limits)
        self.outliers = [(0,) * self._count] * len(limits)
        self.in_a_row: InARow = [((0, 0),) * self._count] * len(limits)
        self._pending = [0] * len(limits)
        self._last_sample = math.nan
        self._told: dict[int, float] = {}
        self.unchecked = bool(system.inputs)
        self._gaps, self._instants = Gaps(system.experiment), 0
        self._rows = ActionRows(system)
        self._held = system.structure.system.held
        self._regime = system.regimes[self.heard]
        self._taken = (-math.inf,) * len(limits)  # when the newest sample of each output was, whoever has used it
        self._decides = self.gate is not None or bool(system.steps or system.timed)

    @property
    def regime(self) -> int:
        """What the system is between the samples, by the outputs that have been heard."""
        return self._regime

    def by_innovation(self, t: float) -> bool:
        """Whether late samples enter the innovation of all observers; otherwise all go back, or none takes them."""
        if self._different is not None:
            raise ValueError(f"the sample taken at {t:.12g} is late, and {self._different.message}")
        treatments = set(self.system.treatments.values())
        if self.system.steps and treatments != {"drop"}:
            raise ValueError(
                f"the sample taken at {t:.12g} is late, and {self.system.stepping} takes samples without delay: leave "
                "late ones out (late: drop, of all observers of the stream), or take one that uses them, such as shgo"
            )
        return "innovation" in treatments

    def next_slot(self, output: int) -> int:
        """A place for a late sample: one after the other, around."""
        self._pending[output] = self._pending[output] % LATE + 1
        return slot_of(output, self._pending[output])

    def carry_out(self, event: Event) -> None:
        """Go on to an event, and let it happen."""
        samples, t = event.samples, event.t
        if self._decides or event.inputs or event.taken != t or not len(event.take) == len(samples) > 0:
            self._carry_out(event)
            return
        if self.unchecked or event.take[0] != samples[0][:2]:  # kept for others that come later
            self._carry_out(event)
            return
        live = self.live
        for _, slot, value in samples:
            live.sample_words[slot] = value
        live.happen_at(t, self._rows.on_time(event), self._regime)
        for i, _, _ in samples:
            self.newest[i] = (t,) * self._count
            if not self.heard[i]:
                self._hear(i)

    def _carry_out(self, event: Event) -> None:
        """As :meth:`carry_out`, of whatever it may be."""
        live, system = self.live, self.system
        if system.steps and event.samples:
            self._instants = require_whole(system, event, self.newest, self._gaps, self._instants)
        if system.timed and event.samples:
            self._taken = require_times(system, event, self._taken)
        if self.unchecked:
            self._told = begin(system, live, event, self._told, heard=any(self.heard))
            self.unchecked = event.t <= 0.0
        if system.steps or event.inputs or not (event.take or event.samples):
            live.advance(event.t, self._regime)
            for number, value in event.inputs:
                place, slope, since, _ = self._held.input(number)
                live.w[place], live.w[slope], live.w[since] = value, 0.0, event.t
            if event.t == self._last_sample:
                keep_inputs(system, live.w)
            if not (event.take or event.samples):
                return
        for _, slot, value in event.samples:
            live.sample_words[slot] = value
        taking = {i: self._taking(i, event) for i, _, _ in event.samples}
        used = tuple([bool(taking[i]) for i, _, _ in event.samples])
        before = self._last_sample
        jumps = self._jumps(event) if True in used else ()
        gated = self.gate is not None and any([self.limited[i] and taking[i] for i in taking])
        w, judged = (live.w.copy(), (self.offered.copy(), self.outliers.copy())) if gated else (live.w, None)
        actions = self._rows.of(event, used, jumps, gated=gated)
        live.happen_at(event.t, actions, self._regime)
        z = live.before if gated else live.z
        out: dict[int, list[tuple[int, int]]] = {}
        for i, slot, _ in event.samples:
            if taking[i]:
                if not self.heard[i]:
                    self._hear(i)
                for j in self._left_out(i, slot, event, taking[i], z, w):
                    out.setdefault(j, []).append((i, slot))
                    leave_out(system.structure.system, live, i, j, z, w)
        for j, samples in out.items():
            self._jump_without(event, j, samples, actions, z, w)
        if jumps and self._stepping and len(event.samples) == len(self.heard):
            self._step_apart(event, out, before, actions, z, w)
        if judged is not None:
            self.in_a_row = gone_on(self.in_a_row, judged, (self.offered, self.outliers))
        if system.steps:
            keep_inputs(system, live.w)

    def _hear(self, output: int) -> None:
        """An output has had its first sample."""
        self.heard = (*self.heard[:output], True, *self.heard[output + 1 :])
        self._regime = self.system.regimes[self.heard]

    def _taking(self, output: int, event: Event) -> Sequence[int]:
        """The observers that have used no newer sample of an output."""
        newest = self.newest[output]
        if event.taken == event.t:
            return self._every
        return [j for j, taken in enumerate(newest) if event.taken >= taken]

    def _left_out(self, i: int, slot: int, event: Event, taking: Sequence[int], z: Floats, w: Floats) -> list[int]:
        """The observers to which a sample that has arrived is an outlier, and those that have used a newer one."""
        outliers: list[int] = []
        if self.gate is not None and self.limited[i]:
            outliers = self.gate.outliers(i, self.live.innovations[slot], event.t, z, w, taking)
            self.offered[i] = increased(self.offered[i], taking)
            if outliers:
                self.outliers[i] = increased(self.outliers[i], outliers)
        if self.system.steps or (not outliers and taking is self._every):  # to what steps nothing comes late
            self.newest[i] = (event.taken,) * self._count
            return outliers
        out = [j for j in self._every if j in outliers or j not in taking]
        self.newest[i] = tuple([old if j in out else event.taken for j, old in enumerate(self.newest[i])])
        return out

    def _jump_without(
        self, event: Event, j: int, samples: list[tuple[int, int]], actions: Integers, z: Floats, w: Floats
    ) -> None:
        """Let an observer jump by those of the samples of an event alone that are no outliers to it."""
        system = self.system.structure.system
        if jumps_by_several(system, system.blocks[j][0]):
            flags = [system.held.fresh(i) for i, _ in samples]
            self._jump_as(event, j, without(actions, samples, flags), z, w)

    def _jump_as(self, event: Event, j: int, actions: Integers, z: Floats, w: Floats) -> None:
        """Let an observer become what it does if other actions happen, from states and what is held before."""
        live, (start, stop, _) = self.live, self.system.structure.system.blocks[j]
        kept = live.state()
        live.z[...], live.w[...] = z, w
        live.happen_at(event.t, actions, self._regime)
        states = live.z[start:stop].copy()
        live.restore(kept)
        live.z[start:stop] = states

    def _step_apart(
        self,
        event: Event,
        out: Mapping[int, Sequence[tuple[int, int]]],
        before: float,
        actions: Integers,
        z: Floats,
        w: Floats,
    ) -> None:
        """Let observers that step from sample to sample do so without those that they have left out.

        A step takes the samples of all outputs: where one of them is an outlier, all are left out.

        Parameters
        ----------
        out : mapping
            By the numbers of observers the samples that are outliers to them, (output, slot) each.
        before : float
            When the samples before had been taken.
        """
        live, system = self.live, self.system.structure.system
        for j in self._stepping:
            if j in out:
                self._own.leave_out(j, live.w, before)
                for i, slot, _ in event.samples:
                    if (i, slot) not in out[j]:
                        leave_out(system, live, i, j, z, w)
                        self.outliers[i] = increased(self.outliers[i], [j] if self.limited[i] else [])
            elif j in self._own.last:
                happening, held = self._own.take(j, actions, w, event.t)
                self._jump_as(event, j, happening, z, held)

    def _jumps(self, event: Event) -> tuple[int, ...]:
        """What jumps when something arrives: corrections, and steps from the second sample on."""
        system, found = self.system, self.system.corrections
        if system.steps and len(event.samples) == len(self.heard):  # until then, others of this time may come
            if not np.isnan(self._last_sample):
                self.live.w[system.structure.system.held.interval] = event.t - self._last_sample
                found = system.steps + found
            else:
                system.begun(event.t, self.live.z)
            self._last_sample = event.t
        return found

    def state(self) -> State:
        """All that the run goes on from: what is kept does not change, so that next to nothing is copied."""
        gate = None if self.gate is None else self.gate.state()
        known = self.heard, (*self.newest,), (*self._pending,), self._last_sample, gate
        own = tuple(self._own.last.items())
        counts = (*self.offered,), (*self.outliers,)
        return self.live.state(), (*known, *counts, self._told, own, self._taken, self.in_a_row, self._instants)

    def restore(self, state: State) -> None:
        """Go on from what :meth:`state` gave."""
        numbers, (*known, self._told, own, self._taken, self.in_a_row, self._instants) = state
        self.heard, newest, pending, self._last_sample, gate, offered, outliers = known
        self._own.last = dict(own)
        self.newest, self._pending, self.offered, self.outliers = map(list, (newest, pending, offered, outliers))
        self._regime = self.system.regimes[self.heard]
        if self.gate is not None and gate is not None:
            self.gate.restore(gate)
        self.live.restore(numbers)
        self.unchecked = bool(self.system.inputs) and self.live.t <= 0.0

    def told(self, states: Sequence[State]) -> tuple[dict[str, Floats], list[list[Any]]]:
        """Some states for a checkpoint: numbers by name, those of each state in a row, and notes as JSON has them."""
        return self.live.told([numbers for numbers, _ in states]), [notes.told(known) for _, known in states]

    def states(self, numbers: Mapping[str, Floats], said: Sequence[Sequence[Any]]) -> list[State]:
        """Those of :meth:`told` again, also from older checkpoints."""
        known = [notes.read(one, self._count, self.offered, self.outliers) for one in said]
        return list(zip(self.live.states(numbers), known, strict=True))

    def go_back(self, state: State) -> None:
        """As :meth:`restore`, but no slot of a sample that is on its way is given to another."""
        pending = self._pending
        self.restore(state)
        self._pending = pending
