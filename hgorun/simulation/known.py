"""What runs before have come to, so that of the next one only the observers are integrated that differ.

With given steps the numbers of an observer do not depend on which others run with it, to the last bit.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hgorun.engine.memory import Raw
from hgorun.memo import Memo, same
from hgorun.simulation.passes.passes import Pass, as_given, integrate
from hgorun.simulation.preparation.preparation import numbers_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.structure import structure_of

_OBSERVERS = 16  # that are kept, with the arrays of the runs that they were in


Apart = dict[str, tuple[Hashable, PreparedRun]]  # by observer, which is alone in its run


@dataclass(frozen=True, eq=False, repr=False)
class _Carried:
    """An observer in the arrays of a run."""

    raw: Raw
    number: int
    states: slice

    @classmethod
    def of(cls, run: PreparedRun, raw: Raw, label: str) -> _Carried:
        number = [block.label for block in run.observers].index(label)
        start, _, end = run.structure.system.blocks[number]
        return cls(raw, number, slice(start, end))


@dataclass(frozen=True, eq=False, repr=False)
class Known:
    """Truths and estimates of runs before, every observer's for itself."""

    _kept: Memo[_Carried] = field(default_factory=lambda: Memo(_OBSERVERS))
    _parts: Memo[Apart] = field(default_factory=lambda: Memo(1))  # of a run that is looked at first, then carried out

    def integrate(self, run: PreparedRun, how: Pass) -> Raw:
        """As :func:`hgorun.simulation.passes.passes.integrate`, to the last bit.

        Raises
        ------
        SimulationError
            Where the plant cannot be followed.
        """
        if not _separable(run, how):
            return integrate(run, how)
        apart = self._apart(run, how)
        if any(key in self._kept for key, _ in apart.values()):
            return _joined(run, [self._carried(key, own, how, label) for label, (key, own) in apart.items()])
        raw = integrate(run, how)
        for label, (key, _) in apart.items():
            self._kept.put(key, _Carried.of(run, raw, label))
        return raw

    def compiled(self, run: PreparedRun) -> bool:
        """Whether a run can be integrated without new code."""
        how = as_given(run)
        if not _separable(run, how):
            return run.structure.compiled
        apart = self._apart(run, how).values()
        missing = [own for key, own in apart if key not in self._kept]
        if len(missing) == len(apart):
            return run.structure.compiled
        return all(own.structure.compiled for own in missing)

    def compile_next(self, run: PreparedRun) -> bool:
        """Compile what an observer of a run needs to be integrated alone; whether there was one that lacked it."""
        how = as_given(run)
        if not _separable(run, how):
            return False
        missing = next((own for _, own in self._apart(run, how).values() if not own.structure.compiled), None)
        if missing is not None:
            missing.structure.program(how.method)
        return missing is not None

    def _apart(self, run: PreparedRun, how: Pass) -> Apart:
        return self._parts.get((same(run), *_steps(how)), lambda: _apart(run, how))

    def _carried(self, key: Hashable, own: PreparedRun, how: Pass, label: str) -> _Carried:
        return self._kept.get(key, lambda: _Carried.of(own, integrate(own, how), label))


def _separable(run: PreparedRun, how: Pass) -> bool:
    """Whether observers can be integrated apart: none changes the steps, the plant or the times of another."""
    return how.tolerance is None and not run.closed and not run.treatments and bool(run.observers)


def _apart(run: PreparedRun, how: Pass) -> Apart:
    """Every observer alone with the plant, and the key of its numbers."""
    alone = {block.label: _alone(run, block.label) for block in run.observers}
    return {label: (_key(own, how), own) for label, own in alone.items()}


def _alone(run: PreparedRun, label: str) -> PreparedRun:
    """A run's plant with one of its observers."""
    experiment, plant = run.experiment, run.plant
    truth, designs = run.structure.groups[0].truth, [experiment.designs[label]]
    structure = structure_of([truth], [designs], experiment.stretches, run.schedule.variants, plant.everything)
    return replace(run, structure=structure, numbers=numbers_of(structure, plant, experiment, designs))


def _key(own: PreparedRun, how: Pass) -> Hashable:
    """All that the numbers of an observer follow from, which is alone with its plant: code, numbers and events."""
    numbers = own.numbers.p.tobytes(), own.numbers.z0.tobytes()
    events = same(own.schedule), same(own.channels), same(own.grid), own.smallest_delay, own.reach, own.origin
    return same(own.structure), numbers, events, *_steps(how), own.solver.divergence


def _steps(how: Pass) -> tuple[Hashable, ...]:
    return how.method, how.step, how.uneven, how.bounded


def _joined(run: PreparedRun, parts: Sequence[_Carried]) -> Raw:
    """The arrays of a run from those of its observers."""
    system, first = run.structure.system, parts[0].raw
    truth = slice(0, run.structure.groups[0].truth.size)
    rows = np.empty((first.rows.shape[0], system.states, 1))
    error, diverged = np.zeros((system.states, 1)), np.empty((len(parts), 1))
    rows[:, truth], error[truth] = first.rows[:, truth], first.error[truth]
    for number, ((start, _, end), part) in enumerate(zip(system.blocks, parts, strict=True)):
        rows[:, start:end] = part.raw.rows[:, part.states]
        error[start:end] = part.raw.error[part.states]
        diverged[number] = part.raw.diverged[part.number]
    return replace(first, rows=rows, error=error, diverged=diverged, held=np.zeros((0, 1)))
