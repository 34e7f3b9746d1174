"""The members of a study's ensemble whose trajectories a panel shows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from hgorun.ensemble.collected.collected import Collected, Floats, Trajectories


@dataclass(frozen=True)
class Family:
    """What decides the look of an observer."""

    type: str
    filter_order: int | None


@dataclass(frozen=True, eq=False)
class MembersData:
    """What a panel of an ensemble's trajectories shows.

    Attributes
    ----------
    run, kind : str
        The run, and what its members differ in: ``seeds``, ``vary``, ``seeds and vary``.
    members : Collected
    name : str
        What is varied; nothing without ``vary``.
    values : ndarray, shape (N,)
        What every member has of it.
    """

    run: str
    kind: str
    members: Collected
    name: str
    values: Floats

    @property
    def observers(self) -> dict[str, Family]:
        """All observers, by their labels."""
        return {label: Family(*self.members.families[label]) for label in self.members.observers}

    @property
    def kept(self) -> Trajectories:
        """Trajectories of all members, or of some."""
        assert self.members.trajectories is not None
        return self.members.trajectories

    @cached_property
    def span(self) -> tuple[float, float]:
        """From the first to the last point."""
        return float(self.kept.time[0]), float(self.kept.time[-1])
