"""How metrics are spread over the members of an ensemble: against an axis, or as boxes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Collected, Floats, levels
from hgorun.ensemble.statistics.never import is_time, never
from hgorun.figures.ensemble import (
    WIDTH,
    Cast,
    axis_label,
    headed,
    limits,
    logarithmic,
    places,
    pooled_over,
    scale_axis,
    spans_much,
)
from hgorun.figures.layout import TOP, finished, grid
from hgorun.figures.looks import Look
from hgorun.figures.lost import (
    draw_bands,
    draw_crosses,
    drawn_median,
    ends,
    largest_of,
    lost_or_unsettled,
    mostly_lost,
    spread,
    words_of_lost,
)
from hgorun.figures.style import PANEL, styled
from hgorun.tables.typeset import words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def against(members: Collected, axis: str, metrics: Sequence[str], *, width: float = WIDTH) -> Figure:
    """Metrics against an axis: medians, with bands from q05 to q95 and from q25 to q75 over all other axes.

    Parameters
    ----------
    members : Collected
    axis : str
    metrics : sequence of str
        A row of panels for each.
    width : float
        Of the page in inches; on a narrow one panels stand one below the other.

    Returns
    -------
    matplotlib.figure.Figure
        A column of panels for each state.
    """
    cast = Cast(members, width)
    at, whose = places(members.axes[axis])
    with styled():
        shown = [(metric, state) for metric in metrics for state in cast.states]
        columns = cast.columns(len(cast.states))
        height = PANEL * (len(shown) // columns) + TOP
        figure, axes = grid(len(shown), columns, cast.width_of_states, height, share=True)
        rows: dict[str, list[tuple[Axes, Floats]]] = {metric: [] for metric in metrics}
        for ax, (metric, state) in zip(axes, shown, strict=True):
            drawn = [at_places(*cast.column(metric, label, state), whose, len(at)) for label in cast.looks]
            largest = largest_of(drawn)
            for order, (found, look) in enumerate(zip(drawn, cast.looks.values(), strict=True)):
                _band(ax, at, found, look, order, largest)
            rows[metric].append((ax, _finite(drawn)))
            ax.set_ylabel(cast.quantity(metric, state))
            ax.set_xlabel(axis_label(axis, members.units))
            _ticks(ax, members, axis, at)
        _scale(rows)
        title = f"medians, 50 % and 90 % of {_count(members, len(at))}{pooled_over(members, [axis])}"
        title += words_of_lost_at(members, whose, len(at), metrics)
        return finished(figure, axes, columns, headed(members, title, metrics), grow=True)


def _count(members: Collected, places: int) -> str:
    each = len(members) / max(places, 1)
    return f"{'about ' if len(members) % places else ''}{each:.0f} members at each value" if each > 1 else "members"


def words_of_lost_at(members: Collected, whose: NDArray[np.int64], size: int, metrics: Sequence[str]) -> str:
    """What is said of members that are lost, or never settle, against an axis with so many places."""
    late = [never(members, metric) for metric in metrics if is_time(metric)]
    known = [members.sound, *(members.sound & ~one[:, :, j] for one in late for j in range(one.shape[2]))]
    groups = [sound[whose == k, i] for sound in known for i in range(sound.shape[1]) for k in range(size)]
    unsettled = int(np.sum(np.any(late, axis=(0, 2, 3)))) if late else 0
    return words_of_lost(members.sound, groups, unsettled=unsettled)


def at_places(values: Floats, sound: NDArray[np.bool_], whose: NDArray[np.int64], size: int) -> Floats:
    """Quantiles at every place, shape (5, size); infinite where so many are lost."""
    return np.array([spread(values[whose == k], sound[whose == k]) for k in range(size)]).T


def _band(ax: Axes, at: Floats, found: Floats, look: Look, order: int, largest: float) -> None:
    draw_bands(ax, at, found, look, largest)
    marker = {"marker": look.marker, "markersize": 3.2} if len(at) <= 24 else {}
    ax.plot(at, drawn_median(found), color=look.colour, linestyle=look.dashes, label=look.text, zorder=3, **marker)  # type: ignore[arg-type]  # matplotlib wants each one's type
    draw_crosses(ax, at[mostly_lost(found)], look, order)


def _finite(drawn: Sequence[Floats]) -> Floats:
    return np.concatenate([found[np.isfinite(found)] for found in drawn] or [np.empty(0)])


def _scale(rows: Mapping[str, Sequence[tuple[Axes, Floats]]]) -> None:
    """Limits, and logarithmic axes for all panels of a metric if one of them spans much, and all can be so."""
    for row in rows.values():
        known = [(ax, values) for ax, values in row if values.size]
        all_so = all(values.min() > 0 for _, values in known) and any(map(spans_much, (v for _, v in known)))
        for ax, values in known:
            if all_so:
                logarithmic(ax, "y")
            ax.set_ylim(limits(float(values.min()), float(values.max()), logarithmic=all_so))


def _ticks(ax: Axes, members: Collected, axis: str, at: Floats) -> None:
    """Of numbers the axis's own, of texts their words."""
    values = members.axes[axis]
    if values.dtype.kind in "iuf":
        spans = scale_axis(ax, "x", at)
        ax.set_xlim(limits(float(at.min()), float(at.max()), logarithmic=spans, margin=0.04))
    else:
        ax.set_xticks(at, [words(str(v), limit=16) for v in levels(values)])
        ax.set_xlim(-0.5, len(at) - 0.5)


def boxes(members: Collected, metrics: Sequence[str], *, width: float = WIDTH) -> Figure:
    """Metrics of all members as boxes: median, quartiles, q05 and q95, with the members lost above them.

    Parameters
    ----------
    members : Collected
    metrics : sequence of str
        A row of panels for each; a column for each state.
    width : float
        Of the page in inches; on a narrow one panels stand one below the other.
    """
    cast = Cast(members, width)
    with styled():
        shown = [(metric, state) for metric in metrics for state in cast.states]
        columns = cast.columns(len(cast.states))
        height = PANEL * (len(shown) // columns) + TOP
        figure, axes = grid(len(shown), columns, cast.width_of_states, height, share=False)
        rows: dict[str, list[tuple[Axes, Floats]]] = {metric: [] for metric in metrics}
        for ax, (metric, state) in zip(axes, shown, strict=True):
            drawn = [spread(*cast.column(metric, label, state)) for label in cast.looks]
            largest = largest_of(drawn)
            for i, (found, look) in enumerate(zip(drawn, cast.looks.values(), strict=True)):
                if np.isfinite(found).any():
                    _box(ax, i, ends(found, largest), look)
            rows[metric].append((ax, _finite(drawn)))
            ax.set_ylabel(cast.quantity(metric, state))
            _names(ax, cast, metric, state, tall=figure.get_figwidth() / columns)
        _scale(rows)
        title = f"median, box 50 %, whiskers 90 % of {len(members)} members{pooled_over(members, [])}"
        title += _above_boxes(members, metrics)
        return finished(figure, axes, columns, headed(members, title, metrics), grow=True)


def _box(ax: Axes, place: int, found: Floats, look: Look) -> None:
    q05, q25, median, q75, q95 = found
    shape = {"med": median, "q1": q25, "q3": q75, "whislo": q05, "whishi": q95, "fliers": []}
    line = {"color": look.colour, "linewidth": 1.0}
    ax.bxp(
        [shape],
        positions=[place],
        widths=0.55,
        patch_artist=True,
        boxprops={"facecolor": f"{look.colour}33", "edgecolor": look.colour, "linewidth": 1.0},
        medianprops={**line, "linewidth": 1.6},
        whiskerprops=line,
        capprops=line,
        manage_ticks=False,
    )


def _names(ax: Axes, cast: Cast, metric: str, state: str, *, tall: float) -> None:
    """Observers below their boxes, and above them how many members they have lost, or never settle."""
    labels = [words(label, limit=18) for label in cast.looks]
    ax.set_xticks(range(len(labels)), labels)
    crowded = sum(map(len, labels)) * 0.075 > tall - 0.8
    ax.tick_params(axis="x", which="both", length=0, rotation=35 if crowded else 0)
    if crowded:
        for text in ax.get_xticklabels():
            text.set_horizontalalignment("right")
            text.set_rotation_mode("anchor")
    ax.set_xlim(-0.6, len(labels) - 0.4)
    ax.grid(False, axis="x")
    for i, label in enumerate(cast.looks):
        told = told_of_lost(cast, metric, label, state)
        if told:
            ax.text(i, 1.01, told, transform=ax.get_xaxis_transform(), ha="center", va="bottom", fontsize=7)


def _above_boxes(members: Collected, metrics: Sequence[str]) -> str:
    """What is said of the counts above boxes; nothing where there are none."""
    unsettled = any(never(members, metric).any() for metric in metrics)
    which = lost_or_unsettled(lost=not members.sound.all(), unsettled=unsettled)
    return f"; above a box how many members {which}: they count as infinite" if which else ""


def told_of_lost(cast: Cast, metric: str, label: str, state: str) -> str:
    """How many members an observer has lost, and in how many others a time never comes; nothing where in none."""
    _, known = cast.column(metric, label, state)
    lost = int(np.sum(~cast.members.sound[:, cast.members.observers.index(label)]))
    counts = {"lost": lost, "never": int(np.sum(~known)) - lost}
    return ", ".join(f"{count} {word}" for word, count in counts.items() if count)
