"""A benchmark drawn: how fast against how quiet, with the front of each group that nothing of it beats in both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hgorun.ensemble.statistics.fronts import non_dominated
from hgorun.figures.ensemble import logarithmic
from hgorun.figures.layout import TOP, finished, grid
from hgorun.figures.page import LIGHT, NARROW, Page, on_page
from hgorun.figures.style import MARKERS, PALETTE, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLUMNS, _ROW = 3, 2.5


@dataclass(frozen=True)
class Contender:
    """A point of a panel.

    Attributes
    ----------
    label, group : str
    speed, size : float
        How long it takes to converge, and its steady error, both in units of the smallest of each plant.
    """

    label: str
    group: str
    speed: float
    size: float


def benchmark(panels: Mapping[str, Sequence[Contender]], page: Page = LIGHT) -> Figure:
    """A panel for each scenario: time to converge against steady error, lines along the fronts of groups.

    On a narrow page panels stand one below the other.
    """
    groups = list(dict.fromkeys(one.group for points in panels.values() for one in points))
    look = {group: (PALETTE[i % len(PALETTE)], MARKERS[i % len(MARKERS)]) for i, group in enumerate(groups)}
    with styled():
        columns = 1 if page.width < NARROW else min(_COLUMNS, len(panels))
        rows = -(-len(panels) // columns)
        figure, axes = grid(len(panels), columns, page.width, _ROW * rows + TOP, share=False)
        for ax, (name, points) in zip(axes, panels.items(), strict=True):
            ax.set_title(name)
            ax.set_xlabel("time to converge / shortest")
            ax.set_ylabel("steady error / smallest")
            _draw(ax, points, look)
        return on_page(finished(figure, axes, columns, "lines: fronts of groups", grow=True), page.style)


def _draw(ax: Axes, points: Sequence[Contender], look: Mapping[str, tuple[str, str]]) -> None:
    for which in "xy":
        logarithmic(ax, which)
    for group, (colour, marker) in look.items():
        own = np.array([(one.speed, one.size) for one in points if one.group == group and np.isfinite(one.speed)])
        if not own.size:
            continue
        front = own[non_dominated(own)]
        front = front[np.argsort(front[:, 0])]
        ax.plot(own[:, 0], own[:, 1], linestyle="none", marker=marker, color=colour, label=group, markersize=4)
        ax.plot(front[:, 0], front[:, 1], color=colour, linewidth=0.8)
