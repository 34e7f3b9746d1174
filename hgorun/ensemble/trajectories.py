"""The trajectories of some members: those that are kept, and those that turn out worst."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hgorun.config.sweeps import Every
from hgorun.config.sweeps import Trajectories as Kept
from hgorun.ensemble.collected import Trajectories
from hgorun.ensemble.ensemble import Ensemble
from hgorun.simulation.simulate import simulate

Floats = NDArray[np.float64]


def chosen(kept: Kept, start: int, stop: int) -> list[int]:
    """Which members from ``start`` to before ``stop`` are followed because of their numbers."""
    if kept == "all":
        return list(range(start, stop))
    if isinstance(kept, Every):
        return list(range(start + -start % kept.every, stop, kept.every))
    return []


def follow(ensemble: Ensemble, members: Sequence[int]) -> Trajectories | None:
    """Carry out members alone, and keep their trajectories; nothing where there are no members."""
    base = ensemble.base
    m, n, count = len(base.observers), len(base.plant.model.states), len(members)
    if not count:
        return None
    followed: Trajectories | None = None
    for i, number in enumerate(members):
        changes = ensemble.members(number, number + 1).of_observers(base).changes(0)
        try:
            result = simulate(base.varied(changes))
        except Exception:  # it is recorded with its error among the members
            continue
        if followed is None:
            followed = _empty(members, result.time, m, n)
        followed.x[i] = result.x
        for j, label in enumerate(base.observers):
            followed.xhat[i, j] = result.observers[label].xhat
    return followed or _empty(members, base.grid[0][:: base.grid[1]] + base.origin, m, n)


def _empty(members: Sequence[int], time: Floats, m: int, n: int) -> Trajectories:
    count, points = len(members), time.size
    return Trajectories(
        member=np.array(members, dtype=np.int64),
        time=time,
        x=np.full((count, points, n), np.nan),
        xhat=np.full((count, m, points, n), np.nan),
    )
