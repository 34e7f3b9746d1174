"""What a panel is drawn from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hgorun.figures.actors import Simulated
from hgorun.figures.looks import Look
from hgorun.figures.style import LARGEST_NUMBER, inked
from hgorun.result.records.data import ResultData

Window = tuple[float, float] | None
_ROUGHER = 1.5  # lines that differ by less go up and down about alike


@dataclass(frozen=True)
class Scene:
    """What a panel draws from.

    Attributes
    ----------
    results : mapping of str to ResultData
        Whose truth and measurements are shown, by the name of the run.
    actors : sequence of Simulated
        The observers shown.
    looks : mapping of int to Look
        By the observers' place.
    truths : mapping of str to mapping
        How the truth of each run is drawn: equal where the truths are.
    window : (from, to) or None
    """

    results: Mapping[str, ResultData]
    actors: Sequence[Simulated]
    looks: Mapping[int, Look]
    truths: Mapping[str, Mapping[str, Any]]
    window: Window = None

    @property
    def texts(self) -> list[str]:
        """What the legend calls the observers, in their order."""
        return [self.looks[actor.order].text for actor in self.actors]

    @cached_property
    def ranks(self) -> dict[int, int]:
        """The observers by their place, from the roughest: the same in every panel of a figure."""
        return {order: rank for rank, order in enumerate(from_roughest(self.actors, self.looks))}


def from_roughest(actors: Iterable[Simulated], looks: Mapping[int, Look]) -> list[int]:
    """The places of observers, the smoothest last; of those about as rough, lines with wider gaps last.

    Where two of them coincide, the one behind is seen in the gaps of the other.
    """
    rough = {actor.order: _roughness(actor) for actor in actors}
    left = sorted(rough, key=lambda order: -rough[order])
    found: list[int] = []
    while left:
        alike = [order for order in left if rough[order] * _ROUGHER >= rough[left[0]]]
        found += sorted(alike, key=lambda order: -inked(looks[order].dashes))
        left = left[len(alike) :]
    return found


def _roughness(actor: Simulated) -> float:
    """By how much the estimates go up and down, of all states in units of the truth's or their own range."""
    xhat = actor.observer.xhat[np.all(np.abs(actor.observer.xhat) <= LARGEST_NUMBER, axis=1)]
    if len(xhat) < 2:
        return 0.0
    ranges = np.ptp(xhat, axis=0) if actor.result.recorded is not None else np.ptp(actor.truth, axis=0)
    return float(np.sum(np.abs(np.diff(xhat, axis=0)).sum(axis=0) / np.where(ranges > 0, ranges, np.inf)))
