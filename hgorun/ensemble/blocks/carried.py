"""Members that have been carried out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

from hgorun.ensemble.blocks.block import compute
from hgorun.ensemble.blocks.checked import check
from hgorun.ensemble.collected.collected import Trajectories
from hgorun.ensemble.collected.trajectories import Watched, chosen, follow, watched
from hgorun.ensemble.found import Block
from hgorun.ensemble.members.recipe import ensemble_of


@dataclass(frozen=True, kw_only=True, eq=False)
class Carried:
    """The members from ``start`` to before ``stop``.

    Attributes
    ----------
    block : Block
    followed : Trajectories or None
        Trajectories of those that are followed.
    seconds : float
        What it took.
    """

    start: int
    stop: int
    block: Block
    followed: Trajectories | None = None
    seconds: float = 0.0


def carry_out(
    recipe: str, start: int, stop: int, threads: int = 1, progress: Callable[[int], None] | None = None
) -> Carried:
    """Carry members out; the same in any process.

    Parameters
    ----------
    recipe : str
        Of the ensemble, see :func:`hgorun.ensemble.members.recipe.recipe_of`.
    start, stop : int
        Numbers of the first member and of that behind the last.
    threads : int
        How many carry members out side by side.
    progress : callable, optional
        Called with the number of members that are finished.
    """
    began = perf_counter()
    ensemble = ensemble_of(recipe)
    members = ensemble.members(start, stop)
    watch = Watched(ensemble, start, stop) if watched(ensemble) else None
    block = compute(
        ensemble.base,
        members,
        metrics=ensemble.metrics,
        threads=threads,
        progress=progress,
        quantities=len(ensemble.quantities),
        watch=watch,
    )
    check(ensemble, block, start, stop)
    if watch is not None:
        followed = watch.followed
    else:
        followed = follow(ensemble, chosen(ensemble.keep.trajectories, start, stop))
    return Carried(start=start, stop=stop, block=block, followed=followed, seconds=perf_counter() - began)
