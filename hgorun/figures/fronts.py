"""What is paid for what: two metrics of an ensemble against each other, with the front that nothing beats in both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Collected, Floats, shown
from hgorun.ensemble.statistics.fronts import non_dominated
from hgorun.ensemble.statistics.never import never
from hgorun.ensemble.statistics.points import points, thinned
from hgorun.ensemble.statistics.statistics import quantiles
from hgorun.figures.ensemble import WIDTH, Cast, axis_label, drawable, headed, limits, scale_axis
from hgorun.figures.layout import TOP, finished, grid
from hgorun.figures.lost import lost_or_unsettled
from hgorun.figures.style import styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROW = 2.7
_MOST_POINTS = 3_000
_MOST_FRONTS = 4  # of an observer


def front(members: Collected, x: str, y: str, *, width: float = WIDTH) -> Figure:
    """Two metrics against each other, a panel for each state: the smaller both are the better.

    A point is the median over the members that differ in random draws alone, the seed among them. Points of an observer
    that no other one of it beats in both metrics are joined: among those that differ in gains alone, since noise, plant
    and sampling are no choices of an observer's designer. There is a line for each value of the latter, or for some.

    Parameters
    ----------
    members : Collected
    x, y : str
        Metrics, such as noise amplification ``hf`` and convergence time ``settling``.
    width : float
        Of the page in inches; on a narrow one panels stand one below the other.
    """
    cast = Cast(members, width)
    parts = list(points(thinned(members, members.grid, _MOST_POINTS), members.grid))
    level = np.array([_level(at, members.surroundings) for at, _ in parts], dtype=object)
    joined = _some(list(dict.fromkeys(level.tolist())))
    with styled():
        columns = cast.columns(min(len(cast.states), 3))
        rows = -(-len(cast.states) // columns)
        figure, axes = grid(len(cast.states), columns, cast.width_of_states, _ROW * rows + TOP, share=False)
        for ax, state in zip(axes, cast.states, strict=True):
            found = {label: medians_of_points(parts, (x, y), label, state) for label in cast.looks}
            ax.set_xlabel(cast.quantity(x, state))
            ax.set_ylabel(cast.quantity(y, state))
            _draw(ax, cast, found, [level == one for one in joined])
        what = "medians over random draws" if any(len(part) > 1 for _, part in parts) else "points: members"
        title = f"{what}; lines: {_fronts(members, joined)}; small: others{words_of_lost_points(members, (x, y))}"
        return finished(figure, axes, columns, headed(members, title, (x, y)), grow=True)


def words_of_lost_points(members: Collected, metrics: Sequence[str]) -> str:
    """What is said of points at which so many members are lost, or never settle, that there is no median."""
    lost = unsettled = False
    for _, part in points(thinned(members, members.grid, _MOST_POINTS), members.grid):
        for late in (never(part, metric) for metric in metrics):
            missing = 2 * np.sum(part.sound[:, :, None] & ~late, axis=0) <= len(part)
            lost |= bool(np.any(missing & np.any(~part.sound, axis=0)[:, None]))
            unsettled |= bool(np.any(missing & np.any(late, axis=0)))
    said = lost_or_unsettled(lost=lost, unsettled=unsettled)
    return f"; there is no point where half or more of its members {said}" if said else ""


def _level(at: Mapping[str, Any], axes: Sequence[str]) -> str:
    """What is no choice, at a point."""
    return ", ".join(shown(at[axis]) for axis in axes)


def _some(levels: list[str]) -> list[str]:
    """Levels whose fronts are drawn, from the first to the last."""
    if len(levels) <= _MOST_FRONTS:
        return levels
    return [levels[k] for k in np.linspace(0, len(levels) - 1, _MOST_FRONTS).round().astype(int)]


def _fronts(members: Collected, joined: Sequence[str]) -> str:
    """Which fronts are drawn."""
    if not members.surroundings:
        return "fronts"
    names = ", ".join(axis_label(axis, members.units) for axis in members.surroundings)
    return f"fronts at {names} = {'; '.join(joined)} (light to dark)"


def medians_of_points(
    parts: Sequence[tuple[Mapping[str, Any], Collected]], metrics: Sequence[str], label: str, state: str
) -> Floats:
    """The medians of metrics over the members of each point, shape (points, metrics); NaN where there is none."""
    columns = [[Cast(part).column(metric, label, state) for metric in metrics] for _, part in parts]
    return drawable(np.array([[float(quantiles(*one, [0.5])[0]) for one in row] for row in columns]))


def _draw(ax: Axes, cast: Cast, found: dict[str, Floats], groups: Sequence[NDArray[np.bool_]]) -> None:
    """The points of each observer, with a front in each group of them."""
    for label, look in cast.looks.items():
        pairs = found[label]
        rest = np.all(np.isfinite(pairs), axis=1)
        for k, group in enumerate(groups):
            best = np.zeros(len(pairs), dtype=bool)
            best[group] = non_dominated(pairs[group])
            rest &= ~best
            order = np.argsort(pairs[best, 0], kind="stable")
            ax.plot(
                *pairs[best][order].T,
                color=look.colour,
                linestyle=look.dashes,
                marker=look.marker,
                markersize=4,
                alpha=(k + 2) / (len(groups) + 1),
                label=look.text if k == len(groups) - 1 else "_",
                zorder=3,
            )
        ax.plot(*pairs[rest].T, color=look.colour, linestyle="none", marker=look.marker, markersize=2.6, alpha=0.25)
    everything: NDArray[np.float64] = np.concatenate([*found.values(), np.empty((0, 2))])
    everything = everything[np.all(np.isfinite(everything), axis=1)]
    for which, known in zip("xy", everything.T, strict=True):
        if known.size:
            spans = scale_axis(ax, which, known)
            ends = limits(float(known.min()), float(known.max()), logarithmic=spans)
            (ax.set_xlim if which == "x" else ax.set_ylim)(ends)
