"""What is paid for what: two metrics of an ensemble against each other, with the front that nothing beats in both."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.collected import Collected, Floats
from hgorun.ensemble.fronts import non_dominated
from hgorun.ensemble.statistics import points, quantiles, thinned
from hgorun.figures.ensemble import Cast, drawable, limits, scale_axis
from hgorun.figures.layout import TOP, finished, grid
from hgorun.figures.style import styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROW = 2.7
_MOST_POINTS = 3_000


def front(members: Collected, x: str, y: str) -> Figure:
    """Two metrics against each other, a panel for each state: the smaller both are the better.

    A point is the median over the members that differ in their seed alone. Those of an observer that no other one of
    it beats in both metrics are joined.

    Parameters
    ----------
    members : Collected
    x, y : str
        Metrics, such as noise amplification ``hf`` and convergence time ``settling``.
    """
    cast = Cast(members)
    chosen = [part for _, part in points(thinned(members, members.chosen, _MOST_POINTS), members.chosen)]
    with styled():
        columns = min(len(cast.states), 3)
        rows = -(-len(cast.states) // columns)
        figure, axes = grid(len(cast.states), columns, cast.width, _ROW * rows + TOP, share=False)
        for ax, state in zip(axes, cast.states, strict=True):
            found = {}
            for label in cast.looks:
                pairs = [[_median(Cast(part), metric, label, state) for metric in (x, y)] for part in chosen]
                found[label] = drawable(np.array(pairs))
            _draw(ax, cast, found)
            ax.set_xlabel(cast.quantity(x, state))
            ax.set_ylabel(cast.quantity(y, state))
        what = "medians over seeds" if any(len(part) > 1 for part in chosen) else "points: members"
        return finished(figure, axes, columns, f"{what}; lines: fronts", grow=True)


def _median(cast: Cast, metric: str, label: str, state: str) -> float:
    return float(quantiles(*cast.column(metric, label, state), [0.5])[0])


def _draw(ax: Axes, cast: Cast, found: dict[str, Floats]) -> None:
    for label, look in cast.looks.items():
        pairs = found[label]
        pairs = pairs[np.all(np.isfinite(pairs), axis=1)]
        best = non_dominated(pairs)
        order = np.argsort(pairs[best, 0], kind="stable")
        rest = pairs[~best]
        ax.plot(*rest.T, color=look.colour, linestyle="none", marker=look.marker, markersize=2.6, alpha=0.4)
        ax.plot(
            *pairs[best][order].T,
            color=look.colour,
            linestyle=look.dashes,
            marker=look.marker,
            markersize=4,
            label=look.text,
            zorder=3,
        )
    everything: NDArray[np.float64] = np.concatenate([*found.values(), np.empty((0, 2))])
    for which, values in zip("xy", everything.T, strict=True):
        known = values[np.isfinite(values)]
        if known.size:
            scale_axis(ax, which, known)
            logarithmic = (ax.get_xscale() if which == "x" else ax.get_yscale()) == "log"
            ends = limits(float(known.min()), float(known.max()), logarithmic=logarithmic)
            (ax.set_xlim if which == "x" else ax.set_ylim)(ends)
