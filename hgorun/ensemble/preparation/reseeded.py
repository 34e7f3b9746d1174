"""Members whose seed decides when something happens, prepared from one of them: times and noise alone are new.

So that nothing is taken for granted, the first member of a group and the last one are prepared in full as well; where
the last differs in a single bit, all of them are.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from typing import Any

import numpy as np

from hgorun.engine.plan import Plan
from hgorun.ensemble.found import Integers
from hgorun.ensemble.members.members import Members
from hgorun.ensemble.preparation.lot import Lot, Numbers, settings_of
from hgorun.ensemble.preparation.retimed import Retimed, is_plain
from hgorun.errors import HgorunError, Problem
from hgorun.measurement.chance import OfSeeds
from hgorun.measurement.noise import is_relative
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.preparation import prepare, reseeded
from hgorun.simulation.prepared import PreparedRun

_FEW = 8  # members that are prepared one by one
_KINDS = 4  # combinations of what outputs are in a run, as where the first sample is lost or not


def retimed_lots(base: Experiment, members: Members, which: Integers) -> Iterator[Lot]:
    """Some members in lots of those that differ in their seeds alone, where these decide when samples come."""
    for changes in _groups(members, which):
        first, *_ = changes.values()
        seeds = _seeds(changes)
        try:
            run = prepare(base.varied(first))
            if np.any(seeds < 0) or not is_plain(run):
                continue
            kinds = list(Retimed(run, seeds, *_prepared(base, changes, run)).plans())
        except (Problem, HgorunError):
            continue
        places, lots = list(changes), dict[Hashable, tuple[PreparedRun, dict[int, Plan]]]()
        for own, plans in kinds:  # what has another number of samples alone goes through the same code
            z0, p = own.numbers.z0.tobytes(), own.numbers.p.tobytes()
            _, together = lots.setdefault((settings_of(own), z0, p), (own, {}))
            together |= {places[place]: plan for place, plan in plans.items()}
        yield from (Lot.with_plans(own, together) for own, together in lots.values())


def _prepared(
    base: Experiment, changes: Mapping[int, Mapping[str, Any]], run: PreparedRun
) -> tuple[OfSeeds, Callable[[int], PreparedRun | None]]:
    """The random numbers of members that differ in their seeds alone, and what prepares one of them by its place.

    That takes all but times and noise from those that have been prepared in full, a few of them.

    Parameters
    ----------
    run : PreparedRun
        The first of them.
    """
    seeds, each = _seeds(changes), list(changes.values())
    runs, chance = [run], OfSeeds(seeds)

    def full(place: int) -> PreparedRun | None:
        new = reseeded(runs, int(seeds[place]), chance.of(place))
        if new is None and len(runs) < _KINDS:
            new = prepare(base.varied(each[place]))
            runs.append(new)
        return new

    return chance, full


def _seeds(changes: Mapping[int, Mapping[str, Any]]) -> Integers:
    return np.array([change["seed"] for change in changes.values()], dtype=np.int64)


def _groups(members: Members, which: Integers) -> Iterator[dict[int, Mapping[str, Any]]]:
    """What those change that differ in their seeds alone."""
    if "seed" not in members.columns or members.columns["seed"].dtype.kind != "i":
        return
    groups: dict[str, dict[int, Mapping[str, Any]]] = {}
    for i in which.tolist():
        changes = members.changes(i)
        rest = {path: value for path, value in changes.items() if path != "seed"}
        groups.setdefault(repr(rest), {})[i] = changes
    yield from (group for group in groups.values() if len(group) >= _FEW)


def reseeded_members(base: Experiment, members: Members, which: Integers) -> dict[int, PreparedRun]:
    """The runs of some members that differ from others in their seed alone, as far as that is certain.

    Parameters
    ----------
    base : Experiment
    members : Members
    which : ndarray of int64
        Some of them.

    Returns
    -------
    dict of int to PreparedRun
        With everything that is carried out as each member has it; their experiment may be that of another seed.
    """
    found: dict[int, PreparedRun] = {}
    for changes in _groups(members, which):
        found |= _of_group(base, changes)
    return found


def _of_group(base: Experiment, changes: Mapping[int, Mapping[str, Any]]) -> dict[int, PreparedRun]:
    """The runs of members that differ in their seed alone; none where one cannot be prepared or is not as expected."""
    if np.any(_seeds(changes) < 0):
        return {}
    first, *_, last = changes
    try:
        run, other = (prepare(base.varied(changes[i])) for i in (first, last))
    except HgorunError:
        return {}
    if any(is_relative(s) for one in run.experiment.stretches for s in one):
        return {}
    _, full = _prepared(base, changes, run)
    found = {}
    for place, i in enumerate(changes):
        try:
            new = full(place)
        except (Problem, HgorunError):
            continue
        if new is not None:
            found[i] = new
    return found if last in found and _same(found[last], other) else {}


def _same(run: PreparedRun, other: PreparedRun) -> bool:
    """Whether the same is carried out, to the last bit."""
    if run.structure is not other.structure or (run.step, run.reach) != (other.step, other.reach):
        return False
    own, expected = ([*Numbers.of([one]).at(0), *_times(one)] for one in (run, other))
    return all(a.tobytes() == b.tobytes() for a, b in zip(own, expected, strict=True))


def _times(run: PreparedRun) -> Iterator[np.ndarray]:
    """All that decides when something happens."""
    yield from (run.schedule.events, run.schedule.inward, run.schedule.variant)
    for channel in run.heard:
        samples = channel.samples
        yield from (samples.arrival, samples.taken, samples.used, channel.held_changes[0])
