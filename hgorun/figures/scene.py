"""What a panel is drawn from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hgorun.figures.actors import Simulated
from hgorun.figures.looks import Look
from hgorun.result.data import ResultData

Window = tuple[float, float] | None


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
