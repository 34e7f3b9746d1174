"""Who appears in a figure: the observers of all runs, and what legends call them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hgorun.figures.scaling import ScalingData
from hgorun.result.records.data import ResultData
from hgorun.result.records.observer import ObserverResult
from hgorun.result.run_names import run_names
from hgorun.tables.typeset import words

if TYPE_CHECKING:
    from hgorun.figures.followed import MembersData


@dataclass(frozen=True)
class Actor:
    """One observer of one run.

    Attributes
    ----------
    order : int
        Place among all observers of all runs.
    run, label : str
        Whose it is, and its key there.
    type : str
    filter_order : int or None
        Order of its filter, where it has one.
    """

    order: int
    run: str
    label: str
    type: str
    filter_order: int | None

    def among(self, names: Sequence[str] | None) -> bool:
        """Whether names, ``label`` or ``run/label``, include this observer; None includes all."""
        return names is None or self.label in names or f"{self.run}/{self.label}" in names


@dataclass(frozen=True)
class Simulated(Actor):
    """An observer with trajectories."""

    result: ResultData
    observer: ObserverResult

    @property
    def truth(self) -> np.ndarray:
        """What it estimates, shape (Nt, n)."""
        return self.result.truth_of(self.label)


def cast(results: Sequence[ResultData]) -> list[Simulated]:
    """All observers of all results."""
    return list(_cast(results))


def _cast(results: Sequence[ResultData]) -> Iterator[Simulated]:
    order = 0
    for result, run in zip(results, run_names(results), strict=True):
        for label, observer in result.observers.items():
            yield Simulated(order, run, label, observer.type, observer.filter_order, result, observer)
            order += 1


def cast_ensembles(panels: Mapping[int, ScalingData | MembersData], first: int) -> dict[int, list[Actor]]:
    """The observers of every panel of an ensemble, the same one where two are of one run; places from ``first``."""
    known: dict[tuple[str, str], Actor] = {}
    for panel in panels.values():
        for label, observer in panel.observers.items():
            order = first + len(known)
            known.setdefault((panel.run, label), Actor(order, panel.run, label, observer.type, observer.filter_order))
    return {i: [known[panel.run, label] for label in panel.observers] for i, panel in panels.items()}


def texts(actors: Sequence[Actor], labels: Mapping[str, str], *, with_run: bool = False) -> dict[int, str]:
    """What legends call the observers that a figure shows, by their places.

    Parameters
    ----------
    actors : sequence of Actor
    labels : mapping of str to str
        Texts by ``run/label`` or ``label``; others are called by their label, and by ``run: label`` where
        the figure shows that label of several runs.
    with_run : bool
        ``run: label`` for all.
    """
    runs: dict[str, set[str]] = {}
    for actor in actors:
        runs.setdefault(actor.label, set()).add(actor.run)
    found = {}
    for actor in actors:
        own = labels.get(f"{actor.run}/{actor.label}", labels.get(actor.label))
        if own is None:
            own = f"{actor.run}: {actor.label}" if with_run or len(runs[actor.label]) > 1 else actor.label
        text = words(own)
        text = f" {text}" if text.startswith("_") else text  # matplotlib would leave it out of legends
        if isinstance(actor, Simulated) and actor.observer.status != "ok":
            text += f" ({actor.observer.status})"
        found[actor.order] = text
    return found
