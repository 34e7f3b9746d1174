"""The numbers of one observer in all members of an ensemble.

Many keys stand among the numbers as they are, such as theta or an initial value: their columns are written there. That
it is so is seen from the numbers of several of the values, the smallest and the largest among them. From other keys,
such as poles, numbers follow by a design, which is carried out once for each kind of block.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from hgorun.ensemble.found import Floats, Integers
from hgorun.ensemble.members.members import Column, Members
from hgorun.ensemble.preparation.axes import distinct_rows
from hgorun.errors import HgorunError
from hgorun.memo import Memo, same
from hgorun.simulation.checks.checks import check_run
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.first_step import rate_of
from hgorun.simulation.preparation.preparation import check_limit
from hgorun.simulation.prepared import Numbers, PreparedRun
from hgorun.simulation.system.observer_block import ObserverBlock

_KINDS = 64  # of blocks that are all designed
_LOOKED_AT = 9  # values of a column that is written: among them the smallest and the largest


@dataclass(frozen=True, eq=False)
class Gains:
    """The numbers of one observer.

    Attributes
    ----------
    parameters, states : slice
        Where they are in p and z0.
    p, z0 : ndarray, shapes (kinds, own parameters) and (kinds, own states)
        Of every kind of block.
    rate : ndarray, shape (kinds,)
        The fastest rate of its error dynamics, where the step depends on it.
    sound : ndarray of bool, shape (N,)
        False for members whose block is refused, or may be something special.
    kind : ndarray of int64, shape (N,)
        The kind of every member.
    written : mapping of str to (ndarray, ndarray)
        The paths whose values are numbers as they are: where in p, and where in z0.
    """

    parameters: slice
    states: slice
    p: Floats
    z0: Floats
    rate: Floats
    sound: np.ndarray
    kind: Integers
    written: Mapping[str, tuple[Integers, Integers]]

    @classmethod
    def of(cls, base: Experiment, run: PreparedRun, label: str, members: Members, paths: tuple[str, ...]) -> Gains:
        """Of some members.

        Parameters
        ----------
        base, run
            What they vary, and the same prepared.
        paths : tuple of str
            Those inside the observer's block.
        """
        block, columns = _Block(base, run, label), members.columns
        written = {} if run.solver.controlled else _written(block, {path: columns[path] for path in paths})
        rest = [path for path in paths if path not in written]
        first, kind = distinct_rows([columns[path] for path in rest]) if rest else _one_kind(len(members))
        found = [block.numbers({path: columns[path][i] for path in rest}) for i in first.tolist()]
        known = [block.own if one is None else one for one in found]
        sound = np.array([one is not None for one in found])[kind]
        for path in written:  # zero may hide a state
            sound &= np.isfinite(columns[path]) & (columns[path] != 0)
        return cls(
            block.parameters,
            block.states,
            np.stack([one.p for one in known]),
            np.stack([one.z0 for one in known]),
            np.array([one.rate for one in known]),
            sound,
            kind,
            written,
        )

    def write(self, p: Floats, z0: Floats, columns: Mapping[str, Column], which: Integers) -> None:
        """Write the numbers of some members, arrays of shapes (parameters, N) and (states, N)."""
        p[self.parameters], z0[self.states] = self.p[self.kind[which]].T, self.z0[self.kind[which]].T
        for path, (in_p, in_z0) in self.written.items():
            p[self.parameters.start + in_p] = columns[path][which]
            z0[self.states.start + in_z0] = columns[path][which]


@dataclass(frozen=True, eq=False)
class _Own:
    """The numbers that one block of an observer gives."""

    p: Floats
    z0: Floats
    rate: float = 0.0


_DESIGNED: Memo[_Own | None] = Memo(1024)


@dataclass(frozen=True, eq=False)
class _Block:
    """An observer's block, in a base experiment and its run."""

    base: Experiment
    run: PreparedRun
    label: str

    @cached_property
    def _place(self) -> int:
        return next(j for j, b in enumerate(self.run.observers) if b.label == self.label)

    @cached_property
    def parameters(self) -> slice:
        """Where its numbers are in p: they are last, one observer after the other."""
        designs = self.run.experiment.designs
        sizes = [designs[b.label].numbers.size for b in self.run.observers]
        start = self.run.numbers.p.size - sum(sizes[self._place :])
        return slice(start, start + sizes[self._place])

    @cached_property
    def states(self) -> slice:
        """Where its states are in z."""
        block = self.run.observers[self._place]
        return slice(block.start, block.end)

    @cached_property
    def own(self) -> _Own:
        """The numbers of the base."""
        return _Own(self.run.numbers.p[self.parameters], self.run.numbers.z0[self.states])

    @cached_property
    def _structure(self) -> object:
        return self.run.experiment.designs[self.label].structure

    def numbers(self, changes: Mapping[str, Any]) -> _Own | None:
        """The numbers of a block with other values; None where it is refused, or its equations are others."""
        return _DESIGNED.get((same(self.run), self.label, repr(changes)), lambda: self._numbers(changes))

    def _numbers(self, changes: Mapping[str, Any]) -> _Own | None:
        run = self.run
        try:
            design = self.base.design_with(self.label, changes)
            check_limit(self.base, self.label, design.observer)
            if design.structure != self._structure or not run.structure.holds_for(self._place, design.observer):
                return None
            z0 = design.initial(run.plant, has_alpha=run.structure.system.has_alpha, recorded=run.recorded)
            rate = 0.0
            if run.experiment.given_step is None:
                rate = rate_of(self.label, design.observer, design.form)
            found = _Own(design.numbers, z0, rate)
            if run.structure.system.jumps:
                self._check(found, run.observers[self._place].of(design))
        except (HgorunError, ValueError):  # Problem is a ValueError
            return None
        return found

    def _check(self, own: _Own, block: ObserverBlock) -> None:
        """What an observer that jumps asks of the samples."""
        p, z0, observers = self.run.numbers.p.copy(), self.run.numbers.z0.copy(), list(self.run.observers)
        p[self.parameters], z0[self.states], observers[self._place] = own.p, own.z0, block
        check_run(replace(self.run, numbers=Numbers(p=p, z0=z0, observers=tuple(observers))))


def _one_kind(count: int) -> tuple[Integers, Integers]:
    return np.zeros(1, dtype=np.int64), np.zeros(count, dtype=np.int64)


def _written(block: _Block, columns: Mapping[str, Column]) -> dict[str, tuple[Integers, Integers]]:
    """The columns of many values that are numbers as they are, with their places."""
    found: dict[str, tuple[Integers, Integers]] = {}
    for path, column in columns.items():
        if column.dtype.kind != "f" or block.run.structure.system.jumps:
            continue
        values = np.unique(column[np.isfinite(column) & (column != 0)])
        if values.size <= _KINDS:
            continue
        looked_at = values[np.linspace(0, values.size - 1, _LOOKED_AT).astype(int)]
        places = _places(block, path, looked_at)
        if places is not None:
            found[path] = places
    return found


def _places(block: _Block, path: str, values: Floats) -> tuple[Integers, Integers] | None:
    """Where the values of a path are among the numbers; None where they are not there as they are."""
    found = [block.numbers({path: value}) for value in values]
    known = [one for one in found if one is not None]
    if len(known) < len(found):
        return None
    places = []
    for numbers in ([one.p for one in known], [one.z0 for one in known]):
        rows = np.stack(numbers)
        moving = np.flatnonzero(np.any(rows != rows[0], axis=0))
        if not np.array_equal(rows[:, moving], np.repeat(values[:, None], moving.size, axis=1)):
            return None
        places.append(moving)
    return places[0], places[1]
