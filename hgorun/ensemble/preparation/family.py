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

from hgorun.ensemble.found import Floats, Integers
from hgorun.ensemble.members.members import Members
from hgorun.ensemble.preparation.axes import Axes
from hgorun.ensemble.preparation.gains import Gains
from hgorun.ensemble.preparation.lot import Lot, Numbers, times_of
from hgorun.errors import HgorunError, Problem
from hgorun.measurement.channels import Channel
from hgorun.measurement.late import heard
from hgorun.measurement.long import AnySchedule
from hgorun.memo import Memo, same
from hgorun.simulation.checks.checks import check_run
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.first_step import plant_rates, rate_of, step_for
from hgorun.simulation.preparation.preparation import prepare
from hgorun.simulation.preparation.scheduling import schedule_of
from hgorun.simulation.prepared import PreparedRun

_BETWEEN = 3  # members that are prepared in full, beside those at the ends of the axes


_CHECKED: Memo[dict[str, tuple[float, float]]] = Memo(16)  # between what values members of a base were as expected


class Differs(Exception):
    """The numbers of a member do not follow from those of the base as they should."""


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
        known = _CHECKED.get((same(self.run), tuple(self.members.columns)), dict)
        for i in self._samples(known):
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
        for path, (low, high) in self._ends().items():
            before = known.get(path, (low, high))
            known[path] = min(low, before[0]), max(high, before[1])
        return self

    def _ends(self) -> dict[str, tuple[float, float]]:
        """The smallest and the largest value on every axis of numbers."""
        columns = {path: column[self.sound] for path, column in self.members.columns.items()}
        numbers = {path: column for path, column in columns.items() if column.size and column.dtype.kind in "fi"}
        return {path: (column.min(), column.max()) for path, column in numbers.items()}

    def _samples(self, known: Mapping[str, tuple[float, float]]) -> list[int]:
        """The members at the ends of every axis, and some in between; none between ends that are known."""
        sound = np.flatnonzero(self.sound)
        if not sound.size:
            return []
        found = [] if known else list(sound[np.linspace(0, sound.size - 1, _BETWEEN).astype(int)])
        for path, (low, high) in self._ends().items():
            column = self.members.columns[path][sound]
            if path not in known or low < known[path][0]:
                found.append(sound[np.argmin(column)])
            if path not in known or high > known[path][1]:
                found.append(sound[np.argmax(column)])
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
            good &= gains.sound
        return good

    @cached_property
    def _gains(self) -> Mapping[str, Gains]:
        """Of the observers that members differ in."""
        given = self.axes.observers
        return {label: Gains.of(self.base, self.run, label, self.members, paths) for label, paths in given.items()}

    @cached_property
    def steps(self) -> Floats:
        """The nominal step of every member."""
        run = self.run
        if run.experiment.given_step is not None:
            return np.full(len(self.members), run.step)
        rates = [self._plant_rates()]
        for label, design in run.experiment.designs.items():
            gains = self._gains.get(label)
            known = rate_of(label, design.observer, design.form) if gains is None else gains.rate[gains.kind]
            rates.append(np.broadcast_to(known, rates[0].shape))
        fastest = np.max([np.where(np.isfinite(rate), rate, 0.0) for rate in rates], axis=0)
        each, which = np.unique(fastest, return_inverse=True)
        return np.array([step_for(run.experiment, float(rate)) for rate in each])[which.ravel()]

    def _plant_rates(self) -> Floats:
        plant, count = self.run.plant, len(self.members)
        if not self.axes.of_plant:
            return np.full(count, plant_rates(plant, self.run.time, plant.initial, plant.everything)[0])
        z0, p = self._vectors(np.arange(count))
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
            run = replace(self.run, step=step, schedule=self._schedule(step))
            check_run(run)
            self._runs[step] = run
        return self._runs[step]

    def _schedule(self, step: float) -> AnySchedule:
        run = self.run
        return schedule_of(run.experiment, run.channels, step, treatments=run.treatments)

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
        return Numbers.with_noise(*self._vectors(which), heard(self._noise(run, which), run.treatments))

    def _vectors(self, which: Integers) -> tuple[Floats, Floats]:
        """z at the start and p, shapes (states, len(which)) and (parameters, len(which))."""
        columns = self.members.columns
        z0, p = (np.repeat(one[:, None], which.size, axis=1) for one in (self.run.numbers.z0, self.run.numbers.p))
        for path, state in self.axes.start.items():
            for place in {state, *(truth[state] for truth in self.run.structure.truths)}:
                z0[place] = columns[path][which]
        for path, place in self.axes.parameters.items():
            p[place] = columns[path][which]
        for gains in self._gains.values():
            gains.write(p, z0, columns, which)
        return z0, p

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
