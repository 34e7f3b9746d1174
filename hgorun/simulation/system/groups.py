"""Observers of one truth, and their part of the equations of a system."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca

from hgorun.engine.layout import Held
from hgorun.measurement.signals import Signal
from hgorun.measurement.variants import CONTINUOUS, DELAYED, FROZEN, HELD, SILENT, Variant
from hgorun.observers.base import Arrival, CorrectedObserver, DecidedObserver, Sample, SampledObserver
from hgorun.observers.stepped import SteppedObserver
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.simulation.system.truth import Placed, PlantNumbers, SameTruth, Seen, Truth
from hgorun.symbolic.plant import PlantModel


@dataclass(frozen=True, eq=False, repr=False)
class Group:
    """A truth and the observers of it, with their places in z: the truth's states, then the observers'."""

    truth: Truth
    start: int
    observers: tuple[ObserverBlock, ...]

    @property
    def truth_states(self) -> slice:
        """Where in z the states of its truth are: where it has none of its own, those of the first group."""
        if isinstance(self.truth, SameTruth):
            return slice(0, self.truth.truth.size)
        return slice(self.start, self.start + self.truth.size)

    @property
    def end(self) -> int:
        """Behind the last of its states in z."""
        return self.observers[-1].end if self.observers else self.start + self.truth.size

    def placed(self, t: ca.SX, z: ca.SX, p: PlantNumbers, w: ca.SX, held: Held) -> Placed:
        """The truth's equations; where a controller drives it, it gets what the first observer estimates.

        Parameters
        ----------
        z : casadi.SX
            All states.
        """
        seen = Seen(self.observers[0], z) if self.observers else None
        return self.truth.place(t, z[self.truth_states], p, w, held, seen)


@dataclass(frozen=True, eq=False, repr=False)
class SystemSymbols:
    """What everything is written in."""

    t: ca.SX
    z: ca.SX
    w: ca.SX
    p: ca.SX
    plant: PlantNumbers
    held: Held


class Part:
    """The equations of one group, whose outputs and observers are counted from ``first`` and ``before`` on."""

    def __init__(
        self, group: Group, symbols: SystemSymbols, first: int, before: int, has_alpha: bool, recalled: Sequence[range]
    ) -> None:
        self.group, self.symbols, self.first, self.before, self.recalled = group, symbols, first, before, recalled
        s = symbols
        self.placed: Placed = group.placed(s.t, s.z, s.plant, s.w, s.held)
        q = self.placed.y.numel()
        self.outputs = range(first, first + q)
        self.guesses = [b.compared(s.t, self.placed.u, s.plant.parameters, s.z) for b in group.observers]
        self.alphas = [b.symbols(s.z).alpha if has_alpha else ca.SX.zeros(q) for b in group.observers]

    def innovation(self, j: int, variant: Variant, signals: Mapping[tuple[int, int], Signal]) -> ca.SX:
        """C xhat(t-d) - y_d(t) + alpha(t) - alpha(t-d), output by output, of observer j of the group."""
        parts = []
        w, held = self.symbols.w, self.symbols.held
        for k, i in enumerate(self.outputs):
            what, phase = variant[i]
            s, output = w[held.s(i, self.before + j)], w[held.output(i)]
            if what == SILENT:
                parts.append(ca.SX(0))
            elif what == HELD:
                parts.append(s + self.alphas[j][k] - output)
            elif what == CONTINUOUS or (what == DELAYED and self.recalled[j]):
                y = self.placed.y[k] if what == CONTINUOUS else output
                parts.append(self.guesses[j][k] - _measured(y, w[held.noise(i)], signals[i, phase]))
            else:
                parts.append(s + self.alphas[j][k] - _measured(output, w[held.noise(i)], signals[i, phase]))
        return ca.vertcat(*[self._model.wrapped(k, part) for k, part in enumerate(parts)])

    @property
    def _model(self) -> PlantModel:
        return self.group.truth.plant.model

    def _unwrapped(self, j: int, sample: Sample) -> Sample:
        """A sample as observer j is to compare it: periods away from the estimate and from the sample before."""
        if not any(self._model.periods):  # then not even the last bits may change
            return sample
        guess, q = self.guesses[j], range(len(self.outputs))
        previous = [guess[k] - self._model.wrapped(k, guess[k] - sample.previous[k]) for k in q]
        y = [previous[k] + self._model.wrapped(k, sample.y[k] - previous[k]) for k in q]
        return replace(sample, y=ca.vertcat(*y), previous=ca.vertcat(*previous))

    def flow(self, variant: Variant, signals: Mapping[tuple[int, int], Signal]) -> Iterator[ca.SX]:
        """The derivative of the group's states."""
        s = self.symbols
        if variant[self.outputs.start][0] == FROZEN:
            yield ca.SX.zeros(self.group.end - self.group.start)
            return
        yield self.placed.rate
        for j, b in enumerate(self.group.observers):
            past = ca.vertcat(ca.SX(0, 1), *[s.w[s.held.output(i)] for i in self.recalled[j]])
            e = self.innovation(j, variant, signals)
            yield b.flow(s.t, self.placed.u, s.plant.parameters, s.z, e, past)

    def decisions(self, variant: Variant, signals: Mapping[tuple[int, int], Signal]) -> dict[int, ca.SX]:
        """What the group's observers decide, by places in z."""
        s, found = self.symbols, dict[int, ca.SX]()
        if variant[self.outputs.start][0] != FROZEN:
            for j, b in enumerate(self.group.observers):
                arrives = any(variant[i][0] != CONTINUOUS for i in self.outputs)
                sampled = arrives and isinstance(b.observer, SteppedObserver)
                if isinstance(b.observer, DecidedObserver) and not sampled:
                    e = self.innovation(j, variant, signals)
                    found |= b.decisions(s.t, self.placed.u, s.plant.parameters, s.z, e)
        return found

    def channels(self, observers: int) -> Iterator[ca.SX]:
        """For each output y, and s of all the system's observers: zero for those of other groups."""
        behind = observers - self.before - len(self.guesses)
        for k in range(len(self.outputs)):
            own = [g[k] - a[k] for g, a in zip(self.guesses, self.alphas, strict=True)]
            yield ca.vertcat(self.placed.y[k], *[ca.SX(0)] * self.before, *own, *[ca.SX(0)] * behind)

    def signals(self) -> Iterator[ca.SX]:
        """What its observers look back at."""
        s = self.symbols
        for b in self.group.observers:
            yield b.signals(s.t, self.placed.u, s.plant.parameters, s.z)

    def _arrival(self, j: int) -> Arrival:
        """What arrives, as observer j is to compare it: whole periods away from its own output where there are some."""
        w, held, guess = self.symbols.w, self.symbols.held, self.guesses[j]
        y = [w[held.output(i)] for i in self.outputs]
        if any(self._model.periods):
            y = [guess[k] - self._model.wrapped(k, guess[k] - one) for k, one in enumerate(y)]
        return Arrival(ca.vertcat(*y), ca.vertcat(*[w[held.fresh(i)] for i in self.outputs]))

    def corrections(self) -> Iterator[tuple[int, int, ca.SX]]:
        """What becomes of which states when samples of any of its outputs arrive."""
        s = self.symbols
        for j, b in enumerate(self.group.observers):
            if isinstance(b.observer, CorrectedObserver):
                new = b.corrected(s.t, self.placed.u, s.plant.parameters, s.z, self._arrival(j))
                yield b.start, b.end, new

    def jumps(self) -> Iterator[tuple[int, int, ca.SX]]:
        """What becomes of which states at a sample."""
        s, held, start = self.symbols, self.symbols.held, self.group.start
        sample = Sample(
            y=ca.vertcat(*[s.w[held.output(i)] for i in self.outputs]),
            previous=ca.vertcat(*[s.w[held.previous(i)] for i in self.outputs]),
            interval=s.w[held.interval],
        )
        if self.placed.step is not None:
            yield start, start + self.group.truth.size, self.placed.step
        for j, b in enumerate(self.group.observers):
            if isinstance(b.observer, SampledObserver):
                own, u = self._unwrapped(j, sample), (self.placed.u, self.placed.u_before)
                yield b.start, b.end, b.jump(s.t, *u, s.plant.parameters, s.z, own)

    def acts(self) -> Iterator[tuple[int, int, ca.SX]]:
        """What becomes of which states when a controller acts."""
        yield from self._become(self.placed.acted)

    def keeps(self) -> Iterator[tuple[int, int, ca.SX]]:
        """What becomes of which states at a sample when all else has happened."""
        yield from self._become(self.placed.kept)

    def _become(self, of_truth: tuple[int, ca.SX] | None) -> Iterator[tuple[int, int, ca.SX]]:
        if of_truth is not None:
            first, new = of_truth
            start = self.group.start + first
            yield start, start + new.numel(), new


def _measured(y: ca.SX, held: ca.SX, signal: Signal) -> ca.SX:
    v = signal.noise + held if signal.drawn else signal.noise
    return y * (1 + v) if signal.multiplicative else y + v
