"""What is kept of members beside their metrics: trajectories, of those asked for and of the worst, and quantities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hgorun.config.sweeps import Every
from hgorun.config.sweeps import Trajectories as Kept
from hgorun.ensemble.collected.collected import Trajectories
from hgorun.ensemble.found import Block
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.result.quantities.quantities import measure_quantity
from hgorun.result.result import Result
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
    if not members:
        return None
    base, followed = ensemble.base, _nothing(ensemble, members)
    for k, number in enumerate(members):
        changes = ensemble.members(number, number + 1).of_observers(base).changes(0)
        try:
            result = simulate(base.varied(changes))
        except Exception:  # it is recorded with its error among the members
            continue
        _keep(followed, k, result)
    return followed


def watched(ensemble: Ensemble) -> bool:
    """Whether something is asked for of every member that only its trajectories can give."""
    return ensemble.keep.trajectories == "all" or bool(ensemble.quantities)


class Watched:
    """What is kept of the members from ``start`` to before ``stop``, while they are carried out one by one.

    Attributes
    ----------
    followed : Trajectories or None
        Nothing where none are kept; NaN where a member has failed.
    """

    def __init__(self, ensemble: Ensemble, start: int, stop: int) -> None:
        self._ensemble, self._start = ensemble, start
        numbers = chosen(ensemble.keep.trajectories, start, stop)
        self._places = {number: k for k, number in enumerate(numbers)}
        self.followed = _nothing(ensemble, numbers) if numbers else None

    def __call__(self, block: Block, i: int, result: Result) -> None:
        """Take what is asked for of a member, whose place in the block is ``i``."""
        ensemble, number = self._ensemble, self._start + i
        results = {ensemble.name: result}
        block.quantities[i] = [measure_quantity(quantity, results) for quantity in ensemble.quantities]
        if self.followed is not None and number in self._places:
            _keep(self.followed, self._places[number], result)


def _keep(followed: Trajectories, k: int, result: Result) -> None:
    followed.x[k] = result.x
    for j, observer in enumerate(result.observers.values()):
        followed.xhat[k, j] = observer.xhat


def _nothing(ensemble: Ensemble, members: Sequence[int]) -> Trajectories:
    """Trajectories of members that have all failed so far, on the grid of the base."""
    base = ensemble.base
    time = base.grid[0][:: base.grid[1]] + base.origin
    return _empty(members, time, len(base.observers), len(base.plant.model.states))


def _empty(members: Sequence[int], time: Floats, m: int, n: int) -> Trajectories:
    count, points = len(members), time.size
    return Trajectories(
        member=np.array(members, dtype=np.int64),
        time=time,
        x=np.full((count, points, n), np.nan),
        xhat=np.full((count, m, points, n), np.nan),
    )
