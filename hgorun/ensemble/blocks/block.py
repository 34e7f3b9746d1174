"""The members of an ensemble carried out: side by side where that can be, alone where it has to be."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from hgorun.config.nearest import listed, nearest
from hgorun.ensemble.found import Block, Integers
from hgorun.ensemble.members.members import Members
from hgorun.ensemble.preparation.axes import Axes
from hgorun.ensemble.preparation.family import Differs, Family
from hgorun.ensemble.preparation.lot import Lot, settings_of, times_of
from hgorun.ensemble.preparation.reseeded import reseeded_members, retimed_lots
from hgorun.ensemble.side_by_side.groups import Group, able, families, lots_of, parts, size_of_lots, with_others
from hgorun.ensemble.side_by_side.ladder import found_steps
from hgorun.ensemble.side_by_side.lanes import given_steps
from hgorun.ensemble.side_by_side.suspects import Suspects, together
from hgorun.errors import ConfigError, HgorunError, Problem, SimulationError
from hgorun.memo import Memo, same
from hgorun.result.metrics.base import all_metrics
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.preparation import prepare
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import finished, located, simulate_prepared

__all__ = ["Block", "compute"]

Watch = Callable[[Block, int, Result], None]

_FEW = 24  # members of a family that are prepared one by one
_SIDE_BY_SIDE = 3  # members of one structure, for which code for several at once is compiled
_PREPARED = 512  # runs that are kept prepared at once


def compute(
    base: Experiment,
    members: Members,
    *,
    metrics: Sequence[str] = (),
    threads: int = 1,
    progress: Callable[[int], None] | None = None,
    quantities: int = 0,
    watch: Watch | None = None,
) -> Block:
    """Carry out members of an ensemble and keep their metrics, each with the bits of the member alone.

    Parameters
    ----------
    base : Experiment
    members : Members
        What each of them changes.
    metrics : sequence of str
        The names of those that are kept; all that are known where none is given.
    threads : int
        How many carry members out side by side.
    progress : callable, optional
        Called with the number of members that are finished.
    quantities : int
        For how many further numbers of every member the block has room.
    watch : callable, optional
        Called with the block, the place of a member in it and its result, for every member that can be carried out.
        They are then carried out one by one.

    Returns
    -------
    Block
        A member that cannot be carried out is recorded with its message, and does not stop the others.

    Raises
    ------
    ConfigError
        For an unknown metric, and for a path ``observers.*`` that no observer has.
    """
    block = Block.empty(base, len(members), _known(metrics, closed=base.closed), quantities)
    _Work(base, members.of_observers(base), block, threads, progress, watch).carry_out()
    return block


@dataclass(eq=False)
class _Work:
    """An ensemble that is being carried out.

    Attributes
    ----------
    done : int
        Members that are finished.
    """

    base: Experiment
    members: Members
    block: Block
    threads: int
    progress: Callable[[int], None] | None
    watch: Watch | None = None
    done: int = 0

    def carry_out(self) -> None:
        """All members."""
        if self.watch is not None:
            self._watched()
            return
        left: list[Integers] = []
        for which in families(self.base, self.members):
            own = self._side_by_side(which)
            if own is None:
                left.append(which)
            else:
                self._alone(own)
        if left:
            self._prepared(np.concatenate(left))

    def _watched(self) -> None:
        """All members, one by one."""
        for start in range(0, len(self.members), self.threads):
            self._singles(list(self._runs(range(start, min(start + self.threads, len(self.members))))))

    def _side_by_side(self, which: Integers) -> Integers | None:
        """Members that differ in numbers alone; those to be carried out alone, or None where numbers are not all."""
        if which.size < _FEW:
            return None
        members = self.members[which]
        try:
            family = _family(self.base, members)
        except (Differs, HgorunError, Problem):
            return None
        if not able(family.run):
            return which
        rest = [which[~family.sound]]
        taken = np.zeros(which.size, dtype=bool)
        taken[~family.sound] = True
        for lot in family.lots(size_of_lots(family.run)):
            taken[lot.which] = True
            rest.append(self._lot(Lot(lot.run, which[lot.which], lot.numbers)))
        return np.concatenate([*rest, which[~taken]])

    def _lot(self, lot: Lot) -> Integers:
        """Carry a lot out; the members that have to be carried out alone."""
        starts = lot.starts()
        rest = [lot.which[~starts]]
        if starts.any():
            steps = found_steps if lot.run.solver.controlled else given_steps
            rest.append(steps(lot.some(starts), self.block, threads=self.threads))
        alone = np.concatenate(rest)
        self._finished(lot.which.size - alone.size)
        return alone

    def _prepared(self, which: Integers) -> None:
        """Members that are prepared one by one, and carried out side by side; all suspects are looked at together."""
        suspects = [np.zeros(0, dtype=np.int64)]
        for start in range(0, which.size, _PREPARED):
            some = which[start : start + _PREPARED]
            for lot in retimed_lots(self.base, self.members, some):
                if able(lot.run):
                    suspects.append(self._lot(lot))
                    some = some[~np.isin(some, lot.which)]
            groups, rest = self._groups(self._runs_by_seed(some))
            self._alone(np.array([i for i, _ in rest], dtype=np.int64))
            suspects += [self._lot(lot) for lot in lots_of(list(groups.values()))]
        self._alone(np.concatenate(suspects))

    def _alone(self, which: Integers) -> None:
        """Members that are looked at one by one, their passes side by side."""
        for start in range(0, which.size, _PREPARED):
            groups, rest = self._groups(self._runs(which[start : start + _PREPARED].tolist()))
            for group in with_others(groups.values()):
                if group[0][1].solver.controlled:
                    rest += group
                    continue
                for part in parts(group, together(group[0][1])):
                    self._looked_at(part)
            self._singles(rest)

    def _groups(self, runs: Iterable[tuple[int, PreparedRun]]) -> tuple[dict[object, Group], Group]:
        """Members that are prepared by what they have in common; and those that are better carried out alone."""
        groups: dict[object, Group] = {}
        rest: Group = []
        of_structure: Counter[int] = Counter()
        for i, run in runs:
            own = groups.setdefault((settings_of(run), times_of(run)), []) if able(run) else rest
            own.append((i, run))
            of_structure[id(run.structure)] += 1
        for key, group in list(groups.items()):  # code for a single run is made and loaded sooner
            if of_structure[id(group[0][1].structure)] < _SIDE_BY_SIDE:
                rest += groups.pop(key)
        return groups, rest

    def _runs_by_seed(self, which: Integers) -> Iterator[tuple[int, PreparedRun]]:
        """As :meth:`_runs`, for carrying them out side by side: most may have the experiment of another member."""
        known = reseeded_members(self.base, self.members, which)
        for i in which.tolist():
            if i in known:
                yield i, known[i]
            else:
                yield from self._runs([i])

    def _runs(self, which: Iterable[int]) -> Iterator[tuple[int, PreparedRun]]:
        """The members that can be prepared, each with its run."""
        for i in which:
            try:
                run = prepare(self.base.varied(self.members.changes(i)))
            except Exception as error:  # whatever it is, the others go on
                self.block.fail(i, error)
                self._finished(1)
            else:
                yield i, run

    def _looked_at(self, group: Group) -> None:
        """Members whose steps or tolerances are given, with one plan or each with its own."""
        suspects = Suspects([run for _, run in group], self.threads)
        self._each(lambda k: self._look_at(suspects, k, *group[k]), range(len(group)))

    def _look_at(self, suspects: Suspects, k: int, i: int, run: PreparedRun) -> None:
        """Member i, which is number k of the suspects."""
        try:
            with located(run):
                self.block.record(i, finished(run, suspects.raw(k), suspects.again(k)))
        except SimulationError:  # the plant diverges
            self._one(i, run)
        except Exception as error:  # whatever it is, the others go on
            self.block.fail(i, error)

    def _singles(self, group: Group) -> None:
        """Members that are carried out alone."""
        self._each(lambda k: self._one(*group[k]), range(len(group)))

    def _each(self, body: Callable[[int], None], places: Sequence[int]) -> None:
        """Do something with some members, on threads where there are some."""
        if self.threads == 1 or len(places) < 2:
            for place in places:
                body(place)
                self._finished(1)
            return
        pool = ThreadPoolExecutor(self.threads)
        try:
            for _ in pool.map(body, places):
                self._finished(1)
        finally:
            pool.shutdown(cancel_futures=True)  # where the user has had enough

    def _one(self, i: int, run: PreparedRun) -> None:
        try:
            result = simulate_prepared(run)
            self.block.record(i, result)
            if self.watch is not None:
                self.watch(self.block, i, result)
        except Exception as error:  # whatever it is, the others go on
            self.block.fail(i, error)

    def _finished(self, count: int) -> None:
        self.done += count
        if self.progress is not None and count:
            self.progress(self.done)


def _known(metrics: Sequence[str], *, closed: bool) -> tuple[str, ...]:
    known = all_metrics(closed=closed)
    for name in metrics:
        if name not in known:
            raise ConfigError(
                f"no metric is called {name!r}.{nearest(name, known)} Known: {listed(known, name)}", key="metrics"
            )
    return tuple(metrics) or tuple(known)


def _family(base: Experiment, members: Members) -> Family:
    """Members of one family, with what they agree in as their base.

    Raises
    ------
    Differs
        Where numbers are not all that they differ in.
    HgorunError, Problem
        Where the base cannot be prepared.
    """
    others = Axes.of(base, members).others
    common = {path: value for path, value in members.changes(0).items() if path in others}
    own, run = _BASES.get((same(base), repr(common)), lambda: _prepared_base(base, common))
    if own.coordinates != base.coordinates:  # members take those of the base where they can
        raise Differs
    rest = Members({path: column for path, column in members.columns.items() if path not in others}, len(members))
    axes = Axes.of(own, rest)
    if axes.others:
        raise Differs
    return Family(own, rest, axes, run).checked()


_BASES: Memo[tuple[Experiment, PreparedRun]] = Memo(8)


def _prepared_base(base: Experiment, common: Mapping[str, Any]) -> tuple[Experiment, PreparedRun]:
    own = base.varied(common) if common else base
    return own, prepare(own)
