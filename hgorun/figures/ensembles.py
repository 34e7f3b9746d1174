"""The figures that an ensemble has the numbers for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from hgorun.ensemble.collected.collected import Collected
from hgorun.figures.bands import bands, family
from hgorun.figures.fronts import front
from hgorun.figures.maps import heat_map
from hgorun.figures.page import LIGHT, Page, on_page
from hgorun.figures.spread import against, boxes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWN = ("rmse", "hf")  # by default
_PAID = ("hf", "settling")  # noise amplification, convergence time


def figures_of(members: Collected, metrics: Sequence[str] = (), *, page: Page = LIGHT) -> Iterator[tuple[str, Figure]]:
    """Figures of an ensemble with their names.

    Parameters
    ----------
    members : Collected
    metrics : sequence of str
        Which are shown; by default rmse and hf, or the first two.
    page : Page
        What they are drawn for.

    Yields
    ------
    (str, Figure)
        ``boxes`` where members differ in chance alone, ``against-AXIS`` for every axis, ``map-METRIC`` where there
        are two axes, ``front`` of settling time and noise amplification where gains of observers were chosen; ``bands``
        and ``family-AXIS`` of the trajectories that were kept. Nothing where there are no observers, or all are lost.
    """
    for name, figure in _figures(members, metrics, page):
        yield name, on_page(figure, page.style)


def _figures(members: Collected, metrics: Sequence[str], page: Page) -> Iterator[tuple[str, Figure]]:
    """The same before they are made dark."""
    width = page.width
    if not members.observers or not members.sound.any():
        return
    chosen = [name for name in metrics or _SHOWN if name in members.metrics] or list(members.metrics)[:2]
    if not members.chosen:
        yield "boxes", boxes(members, chosen, width=width)
    for axis in members.chosen:
        yield f"against-{_last(axis, members)}", against(members, axis, chosen, width=width)
    if len(members.chosen) == 2 and len(members) > 2:
        for name in chosen:
            yield f"map-{name}", heat_map(members, (members.chosen[0], members.chosen[1]), name, width=width)
    if members.gains and all(name in members.metrics for name in _PAID):
        yield "front", front(members, *_PAID, width=width)
    if members.trajectories is not None and len(members.trajectories.member) > 1:
        yield "bands", bands(members, width=width)
        for axis in members.chosen:
            yield f"family-{_last(axis, members)}", family(members, axis, page=page)


def _last(axis: str, members: Collected) -> str:
    """A name for files: the end of a path, or all of it where two end alike."""
    last = axis.rpartition(".")[2]
    unique = sum(other.rpartition(".")[2] == last for other in members.chosen) == 1
    return (last if unique else axis.removeprefix("observers.")).replace("/", "_").replace("*", "all")
