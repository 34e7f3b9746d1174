"""How the members of an ensemble are divided into those that are carried out side by side."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from hgorun.ensemble.found import Integers
from hgorun.ensemble.members.members import Members
from hgorun.ensemble.preparation.axes import Axes, distinct_rows
from hgorun.ensemble.preparation.lot import Lot, Numbers, settings_of
from hgorun.ensemble.side_by_side.ladder import searched_in_lanes
from hgorun.ensemble.side_by_side.lanes import fits
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.prepared import PreparedRun

_NUMBERS = (
    4_000_000  # doubles of the members of a lot: of their numbers, and of their trajectories where these are kept
)
_LEAST, _MOST = 64, 4096  # members of a lot

Group = list[tuple[int, PreparedRun]]  # members with the same settings and times


def with_others(groups: Iterable[Group]) -> Iterator[Group]:
    """Groups of members with one plan; those of a single member are one group with all others of its settings."""
    single: dict[object, Group] = {}
    for group in groups:
        if len(group) > 1:
            yield group
        else:
            single.setdefault(settings_of(group[0][1]), []).extend(group)
    yield from single.values()


def lots_of(groups: Sequence[Group]) -> Iterator[Lot]:
    """Groups in lots of the size that is allowed; those of one member share lots, each with times of its own."""
    single: dict[object, Group] = {}
    for group in groups:
        run = group[0][1]
        if len(group) == 1 and not run.solver.controlled:
            single.setdefault(settings_of(run), []).extend(group)
            continue
        for part in parts(group, size_of_lots(run)):
            runs = [run for _, run in part]
            yield Lot(runs[0], np.array([i for i, _ in part]), Numbers.of(runs))
    for group in single.values():
        for part in parts(group, size_of_lots(group[0][1])):
            yield Lot.of(*zip(*part, strict=True))


def parts(group: Group, size: int) -> Iterator[Group]:
    for first in range(0, len(group), size):
        yield group[first : first + size]


def families(base: Experiment, members: Members) -> Iterator[Integers]:
    """Members that agree in all that may change the equations or the times of events."""
    others = Axes.of(base, members).others
    if not others or not len(members):
        yield np.arange(len(members))
        return
    _, kind = distinct_rows([members.columns[path] for path in others])
    order = np.argsort(kind, kind="stable")
    yield from np.split(order, np.flatnonzero(np.diff(kind[order])) + 1)


def able(run: PreparedRun) -> bool:
    """Whether runs like this one can be carried out side by side."""
    return fits(run) and (not run.solver.controlled or searched_in_lanes(run))


def size_of_lots(run: PreparedRun) -> int:
    """How many members of a lot fit into the memory that is allowed for one."""
    numbers = run.numbers.z0.size + run.numbers.p.size
    numbers += sum(channel.samples.arrival.size + channel.held_changes[0].size for channel in run.heard)
    if run.solver.controlled:
        numbers += 4 * run.grid.size * run.structure.system.states
    return int(np.clip(_NUMBERS // numbers, _LEAST, _MOST))
