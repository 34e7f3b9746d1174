"""Members that differ in numbers alone: their numbers, for many of them at once.

What a member differs in goes to known places: an initial value into the state, a parameter and a gain into the
parameters, a seed and a size of noise into what is drawn. So that nothing is taken for granted, members at the ends of
every axis and some in between are prepared in full as well; where one differs in a single bit, all of them are.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hgorun.ensemble.axes import Axes, distinct_rows
from hgorun.ensemble.found import Floats, Integers
from hgorun.ensemble.lot import Lot, Numbers, times_of
from hgorun.ensemble.members import Members
from hgorun.errors import HgorunError, Problem
from hgorun.measurement.schedule import Channel
from hgorun.simulation.checks import check_run
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.observer_block import Design
from hgorun.simulation.preparation import (
    check_limits,
    numbers_of,
    plant_rates,
    prepare,
    rate_of,
    schedule_of,
    step_for,
)
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.structure import structure_of

_BETWEEN = 3  # members that are prepared in full, beside those at the ends of the axes


class Differs(Exception):
    """The numbers of a member do not follow from those of the base as they should."""


@dataclass(frozen=True, eq=False)
class _Gains:
    """The numbers of one observer: of each kind of its block, and the kind of every member.

    Attributes
    ----------
    p, z0 : ndarray, shapes (kinds, own parameters) and (kinds, own states)
    rate : ndarray, shape (kinds,)
        The fastest rate of its error dynamics, where the step depends on it.
    sound : ndarray of bool, shape (kinds,)
        False where the block is refused.
    kind : ndarray of int64, shape (N,)
    """

    p: Floats
    z0: Floats
    rate: Floats
    sound: np.ndarray
    kind: Integers


@dataclass(frozen=True, eq=False)
class Family:
    """Members of one base whose equations and events are the same.

    Attributes
    ----------
    base : Experiment
        With all that is not a number as the members have it.
    members : Members
    axes : Axes
        Of paths that are numbers only.
    run : PreparedRun
        The base.
    """

    base: Experiment
    members: Members
    axes: Axes
    run: PreparedRun

    def checked(self) -> Family:
        """The same.

        Raises
        ------
        Differs
            Where a member that has been prepared in full has other numbers.
        """
        steps = self.steps
        for i in self._samples():
            try:
                full = prepare(self.base.varied(self.members.changes(i)))
            except HgorunError as error:
                raise Differs from error
            one = np.array([i])
            run = self.at_step(float(steps[i]))
            if full.structure is not run.structure or times_of(full) != times_of(run):
                raise Differs
            own, expected = self.numbers(run, one).at(0), Numbers.of([full]).at(0)
            if any(a.tobytes() != b.tobytes() for a, b in zip(own, expected, strict=True)):
                raise Differs
        return self

    def _samples(self) -> list[int]:
        """The members at the ends of every axis, and some in between."""
        sound = np.flatnonzero(self.sound)
        if not sound.size:
            return []
        found = list(sound[np.linspace(0, sound.size - 1, _BETWEEN).astype(int)])
        for column in self.members.columns.values():
            if column.dtype.kind in "fi":
                found += [sound[np.argmin(column[sound])], sound[np.argmax(column[sound])]]
        return sorted({int(i) for i in found})

    @cached_property
    def sound(self) -> np.ndarray:
        """Which members have values that are nothing special; the others are carried out alone."""
        good = np.ones(len(self.members), dtype=bool)
        columns = self.members.columns
        with np.errstate(invalid="ignore"):
            for path in self.axes.of_plant:  # zero may hide a state
                good &= np.isfinite(columns[path]) & (columns[path] != 0)
            for path in self.axes.deviations:
                good &= np.isfinite(columns[path]) & (columns[path] >= 0)
        if self.axes.seed:
            good &= columns["seed"] >= 0
        for gains in self._gains.values():
            good &= gains.sound[gains.kind]
        return good

    @cached_property
    def _gains(self) -> Mapping[str, _Gains]:
        return {label: self._gains_of(label, paths) for label, paths in self.axes.observers.items()}

    def _gains_of(self, label: str, paths: tuple[str, ...]) -> _Gains:
        """The numbers of an observer, from every kind of its block once."""
        first, kind = distinct_rows([self.members.columns[path] for path in paths])
        own, run = self.members[first], self.run
        (place,) = (j for j, b in enumerate(run.observers) if b.label == label)
        p, z0 = run.numbers.p[self._parameters(place)], run.numbers.z0[self._states(place)]
        found = _Gains(
            np.tile(p, (first.size, 1)),
            np.tile(z0, (first.size, 1)),
            np.zeros(first.size),
            np.zeros(first.size, dtype=bool),
            kind,
        )
        for d in range(first.size):
            changes = {path: value for path, value in own.changes(d).items() if path in paths}
            try:
                experiment = self.base.varied(changes)
                check_limits(experiment)
                design = experiment.designs[label]
                designs = [*experiment.designs.values()]
                found.p[d] = design.numbers
                found.z0[d] = design.initial(run.plant.parameters, has_alpha=run.structure.system.has_alpha)
                if run.experiment.given_step is None:
                    found.rate[d] = rate_of(label, design.observer, design.form)
                if run.structure.system.jumps:
                    numbers = numbers_of(run.structure, run.plant, experiment, designs)
                    check_run(replace(run, experiment=experiment, numbers=numbers))
                found.sound[d] = self._has_the_equations(place, designs)
            except (HgorunError, ValueError):  # Problem is a ValueError
                continue
        return found

    def _has_the_equations(self, place: int, designs: list[Design]) -> bool:
        """Whether a run with another design of one observer has the equations of the base."""
        run = self.run
        if designs[place].structure != [*run.experiment.designs.values()][place].structure:
            return False
        truth, stretches, variants = run.structure.groups[0].truth, run.experiment.stretches, run.schedule.variants
        return structure_of([truth], [designs], stretches, variants, run.plant.everything) is run.structure

    def _parameters(self, place: int) -> slice:
        """Where an observer's numbers are among the parameters: they are last, one observer after the other."""
        sizes = [design.numbers.size for design in self.run.experiment.designs.values()]
        start = self.run.numbers.p.size - sum(sizes[place:])
        return slice(start, start + sizes[place])

    def _states(self, place: int) -> slice:
        block = self.run.observers[place]
        return slice(block.start, block.end)

    @cached_property
    def steps(self) -> Floats:
        """The nominal step of every member."""
        run = self.run
        if run.experiment.given_step is not None:
            return np.full(len(self.members), run.step)
        rates = [self._plant_rates()]
        for label, observer in run.experiment.observers.items():
            gains = self._gains.get(label)
            known = rate_of(label, observer, run.forms[label]) if gains is None else gains.rate[gains.kind]
            rates.append(np.broadcast_to(known, rates[0].shape))
        fastest = np.max([np.where(np.isfinite(rate), rate, 0.0) for rate in rates], axis=0)
        each, which = np.unique(fastest, return_inverse=True)
        return np.array([step_for(run.experiment, float(rate)) for rate in each])[which.ravel()]

    def _plant_rates(self) -> Floats:
        plant, count = self.run.plant, len(self.members)
        if not self.axes.of_plant:
            return np.full(count, plant_rates(plant, self.run.time, plant.initial, plant.everything)[0])
        z0, p = self._state(np.arange(count)), self._values(np.arange(count))
        everything = p[: plant.everything.size].T
        return np.array(plant_rates(plant, self.run.time, z0[: plant.model.n].T, everything))

    def at_step(self, step: float) -> PreparedRun:
        """The base with another nominal step.

        Raises
        ------
        Problem
            Where that cannot be carried out.
        """
        if step == self.run.step:
            return self.run
        if step not in self._runs:
            run = replace(self.run, step=step, schedule=schedule_of(self.run.experiment, self.run.channels, step))
            check_run(run)
            self._runs[step] = run
        return self._runs[step]

    @cached_property
    def _runs(self) -> dict[float, PreparedRun]:
        return {}

    def lots(self, size: int) -> Iterator[Lot]:
        """The sound members in lots of one step, so many at most."""
        members = np.flatnonzero(self.sound)
        steps = self.steps[members]
        for step in np.unique(steps):
            try:
                run = self.at_step(float(step))
            except Problem:
                continue
            own = members[steps == step]
            for start in range(0, own.size, size):
                which = own[start : start + size]
                yield Lot(run, which, self.numbers(run, which))

    def numbers(self, run: PreparedRun, which: Integers) -> Numbers:
        """The numbers of some members."""
        return Numbers.with_noise(self._state(which), self._values(which), self._noise(run, which))

    def _state(self, which: Integers) -> Floats:
        """z at the start, shape (states, len(which))."""
        z0 = np.repeat(self.run.numbers.z0[:, None], which.size, axis=1)
        for path, place in self.axes.start.items():
            z0[place] = self.members.columns[path][which]
        for label, gains in self._gains.items():
            z0[self._states(self._place(label))] = gains.z0[gains.kind[which]].T
        return z0

    def _values(self, which: Integers) -> Floats:
        """p, shape (parameters, len(which))."""
        p = np.repeat(self.run.numbers.p[:, None], which.size, axis=1)
        for path, place in self.axes.parameters.items():
            p[place] = self.members.columns[path][which]
        for label, gains in self._gains.items():
            p[self._parameters(self._place(label))] = gains.p[gains.kind[which]].T
        return p

    def _place(self, label: str) -> int:
        return next(j for j, b in enumerate(self.run.observers) if b.label == label)

    def _noise(self, run: PreparedRun, which: Integers) -> list[Channel]:
        """The channels, with the noise of each member where they differ in it."""
        axes, columns = self.axes, self.members.columns
        if not axes.of_noise:
            return run.channels
        seeds = columns["seed"][which] if axes.seed else np.array([run.experiment.blocks.seed])
        given = {place: columns[path][which] for path, places in axes.deviations.items() for place in places}
        found = []
        for i, channel in enumerate(run.channels):
            own = {(k, j): values.astype(float) for (output, k, j), values in given.items() if output == i}
            found.append(channel.of_many(which.size, seeds, own))
        return found
