"""What a tuning has tried and found: a front of two goals, or a goal against the gains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.statistics.fronts import non_dominated
from hgorun.figures.actors import Actor, texts
from hgorun.figures.ensemble import axis_label, drawable, limits, logarithmic, scale_axis
from hgorun.figures.layout import TOP, finished, grid
from hgorun.figures.looks import Look, looks
from hgorun.figures.page import LIGHT, NARROW, TWO, Page, on_page
from hgorun.figures.style import styled
from hgorun.tables.typeset import paragraph

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

_WIDTH, _HEIGHT, _PANEL = 6.0, 3.8, 2.6
_MINIMUM = "points: tried with all seeds; star: the minimum, on held-out seeds with its 95 % interval"
_STAR: dict[str, Any] = {"marker": "*", "markersize": 9, "markeredgecolor": "black", "markeredgewidth": 0.6}
# in front of the star, and wider, since it may be shorter
_INTERVAL: dict[str, Any] = {
    "linestyle": "none", "color": "black", "elinewidth": 0.7, "capsize": 4, "capthick": 0.7, "zorder": 4.2,
}  # fmt: skip
# tried, and no choice
_MISSED: dict[str, Any] = {
    "linestyle": "none",
    "marker": "x",  # hollow points mean something else
    "markersize": 2.4,
    "markeredgecolor": "0.7",
    "markeredgewidth": 0.5,
    "color": "0.7",
    "zorder": 1.4,
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Tuned:
    """What is drawn of the gains of an observer.

    Attributes
    ----------
    label, type, filter_order
        The observer, or what its task is called.
    paths : tuple of str
        Of the gains.
    logarithmic : tuple of bool
        Of each gain, whether equal ratios are equally far apart.
    gains : ndarray, shape (C, k)
        Of all candidates that were tried with all seeds.
    goals : ndarray, shape (C, g)
        Their means.
    met : ndarray of bool, shape (C,)
        Whether they meet the limits.
    front_gains : ndarray, shape (F, k)
    front, half : ndarray, shape (F, g)
        Means of the front on held-out seeds, and half the widths of their 95 % intervals.
    chosen : int
        The knee or the minimum, in the front.
    units : mapping of str to str
        Of time, and of gains that are no times.
    """

    label: str
    type: str
    filter_order: int | None
    paths: tuple[str, ...]
    logarithmic: tuple[bool, ...]
    gains: Floats
    goals: Floats
    met: NDArray[np.bool_]
    front_gains: Floats
    front: Floats
    half: Floats
    chosen: int
    units: Mapping[str, str] = field(default_factory=dict)


def tuning(found: Sequence[Tuned], goals: Sequence[str], page: Page = LIGHT) -> Figure:
    """A front of two goals with all that was tried, or one goal against each of the gains.

    Parameters
    ----------
    found : sequence of Tuned
        One for each observer.
    goals : sequence of str
        What axes call them; mathematics between dollar signs.
    page : Page
        On a narrow one panels stand one below the other.
    """
    narrow = page.width < NARROW
    actors = [Actor(i, "", one.label, one.type, one.filter_order) for i, one in enumerate(found)]
    look = looks([actors], texts(actors, {}))
    with styled():
        if len(goals) == 2:
            width = page.width if narrow else _WIDTH
            figure, axes = grid(1, 1, width, min(_HEIGHT, width) + TOP, share=False)
            for i, one in enumerate(found):
                _front(axes[0], one, look[i])
            axes[0].set_xlabel(paragraph(goals[0], width))
            axes[0].set_ylabel(paragraph(goals[1], _HEIGHT))
            _limits(axes[0], found)
            title = "dots: tried with all seeds; lines: fronts on held-out seeds; stars: knees"
            if not all(non_dominated(one.front).all() for one in found):
                title += "; hollow: beaten on held-out seeds"
            return on_page(finished(figure, axes, 1, title, grow=True, cuts=True), page.style)
        panels = [(i, k) for i, one in enumerate(found) for k in range(len(one.paths))]
        columns = 1 if narrow else min(len(panels), 3)
        rows = -(-len(panels) // columns)
        width = page.width if narrow else _WIDTH if columns < 3 else TWO
        figure, axes = grid(len(panels), columns, width, _PANEL * rows + TOP, share=False)
        for ax, (i, k) in zip(axes, panels, strict=True):
            ax.set_ylabel(paragraph(goals[0], _PANEL))
            _against(ax, found[i], k, look[i])
        return on_page(finished(figure, axes, columns, _MINIMUM, grow=True, cuts=True), page.style)


def _front(ax: Axes, one: Tuned, look: Look) -> None:
    tried = drawable(one.goals)
    if not one.met.all():
        ax.plot(*tried[~one.met].T, **_MISSED, label="misses a limit")
    ax.plot(*tried[one.met].T, linestyle="none", marker=".", markersize=2.2, color=look.colour, alpha=0.35, zorder=1.5)
    front, best = drawable(one.front), non_dominated(one.front)
    half = one.half.copy()
    half[one.chosen] = np.nan  # drawn with its star
    order = np.flatnonzero(best)[np.argsort(front[best, 0], kind="stable")]
    marks: dict[str, Any] = {"color": look.colour, "marker": look.marker, "markersize": 3.5, "label": "_"}
    bars: dict[str, Any] = marks | {"elinewidth": 0.7, "capsize": 1.5, "zorder": 3}
    for which, line in ((order, {"linestyle": look.dashes}), (~best, {"linestyle": "none", "markerfacecolor": "none"})):
        x_half, y_half = half[which].T
        ax.errorbar(front[which, 0], front[which, 1], xerr=x_half, yerr=y_half, **bars, **line)
    ax.plot([], [], **marks | {"linestyle": look.dashes, "label": look.text})
    face = look.colour if best[one.chosen] else "white"
    ax.plot(*front[one.chosen], color=look.colour, markerfacecolor=face, linestyle="none", zorder=4, **_STAR)
    (x, y), (x_half, y_half) = front[one.chosen], one.half[one.chosen]
    ax.errorbar(x, y, xerr=x_half, yerr=y_half, **_INTERVAL)


def _limits(ax: Axes, found: Sequence[Tuned]) -> None:
    """So much that the fronts are seen well; what was tried far away is not, unless the front is a single point."""
    front = _known(drawable(np.concatenate([one.front for one in found])))
    if not len(front):
        return
    if len(np.unique(front, axis=0)) == 1:
        front = np.concatenate([front, *(_most(_known(drawable(one.goals[one.met]))) for one in found)])
    intervals = np.concatenate(
        [one.front[one.chosen] + sign * one.half[one.chosen] for one in found for sign in (-1, 1)]
    )
    for which, values, ends_of in zip("xy", front.T, drawable(intervals).reshape(-1, 2).T, strict=True):
        spans = scale_axis(ax, which, values)
        low, high = float(values.min()), float(values.max())
        known = ends_of[np.isfinite(ends_of) & ((ends_of > 0) | (not spans))]
        ends = limits(low, high, logarithmic=spans, margin=0.25)
        wide = limits(float(min([low, *known])), float(max([high, *known])), logarithmic=spans)
        (ax.set_xlim if which == "x" else ax.set_ylim)(min(ends[0], wide[0]), max(ends[1], wide[1]))


def _known(points: Floats) -> Floats:
    return points[np.isfinite(points).all(axis=1)]


def _most(points: Floats) -> Floats:
    """Points without the tenth that is largest in each goal."""
    return points[(points <= np.quantile(points, 0.9, axis=0)).all(axis=1)] if len(points) else points


def _against(ax: Axes, one: Tuned, k: int, look: Look) -> None:
    tried = drawable(one.goals[:, 0])
    known = np.isfinite(tried)
    if not one.met.all():
        ax.plot(one.gains[known & ~one.met, k], tried[known & ~one.met], **_MISSED, label="misses a limit")
    ax.plot(one.gains[known & one.met, k], tried[known & one.met], linestyle="none", marker=look.marker, markersize=2.8,
            color=look.colour, alpha=0.6, label=look.text)  # fmt: skip
    best = one.front_gains[one.chosen, k], one.front[one.chosen, 0]
    ax.plot(*best, color=look.colour, linestyle="none", zorder=4, **_STAR)
    ax.errorbar(*best, yerr=one.half[one.chosen, 0], **_INTERVAL)
    ax.set_xlabel(axis_label(one.paths[k], one.units))
    if one.logarithmic[k]:
        logarithmic(ax, "x")
    low, high = float(one.gains[:, k].min()), float(one.gains[:, k].max())
    ax.set_xlim(limits(low, high, logarithmic=one.logarithmic[k], margin=0.03))
    values = tried[known]
    ends = best[1] + one.half[one.chosen, 0] * np.array([-1.0, 0.0, 1.0])
    ends = ends[np.isfinite(ends)]
    spans = scale_axis(ax, "y", np.append(values, ends))
    seen = np.append(values[values <= np.quantile(values, 0.9)] if values.size else values, ends)
    if seen.size:
        ax.set_ylim(limits(float(seen.min()), float(seen.max()), logarithmic=spans))
