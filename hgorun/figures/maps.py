"""Heat maps: a metric of an ensemble over two of its axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Collected, Floats, levels
from hgorun.ensemble.statistics.never import never
from hgorun.ensemble.statistics.statistics import quantiles
from hgorun.figures.ensemble import (
    WIDTH,
    Cast,
    axis_label,
    drawable,
    headed,
    places,
    pooled_over,
    said_logarithmic,
    spans_much,
)
from hgorun.figures.layout import TOP, finished, grid
from hgorun.figures.lost import lost_or_unsettled
from hgorun.figures.page import AS_IT_IS, seen_on
from hgorun.figures.style import styled
from hgorun.tables.typeset import paragraph, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

_PANEL, _LEAST, _ROW, _BAR = 2.4, 4.2, 1.9, 0.9  # inches
_LABEL = 1.7  # of a bar, in inches: longer ones have two lines, so that they do not touch those of other rows
_MOST_LABELS = 7  # of an axis
_WRITTEN = 40  # cells that have room for a number


def heat_map(members: Collected, axes: tuple[str, str], metric: str, *, width: float = WIDTH) -> Figure:
    """The median of a metric in each cell of two axes, over all that the members differ in besides.

    Parameters
    ----------
    members : Collected
    axes : (str, str)
        The horizontal and the vertical one.
    metric : str
    width : float
        Of the page in inches; on a narrow one panels stand one below the other.

    Returns
    -------
    matplotlib.figure.Figure
        A row of panels for each state, a column for each observer; a state has one scale of colours. Cells in which
        half or more of the members are lost, or never settle, are hatched.
    """
    from matplotlib.colors import LogNorm

    cast = Cast(members, width)
    labels = list(cast.looks)
    cells = [_cells(members.axes[axis]) for axis in axes]
    with styled():
        count, columns = len(labels) * len(cast.states), cast.columns(len(labels))
        room = cast.page if cast.narrow else max(_PANEL * len(labels) + _BAR, _LEAST)
        figure, panels = grid(count, columns, room, _ROW * (count // columns) + TOP, share=False)
        for j, state in enumerate(cast.states):
            row = panels[j * len(labels) : (j + 1) * len(labels)]
            medians = [cell_medians(*cast.column(metric, label, state), cells[0][1], cells[1][1]) for label in labels]
            norm = _norm(medians)
            for i, (ax, label, found) in enumerate(zip(row, labels, medians, strict=True)):
                mesh = _draw(ax, found, norm)
                lowest = ax in panels[-columns:]
                _axis(ax, "x", cells[0][0], axis_label(axes[0], members.units) if lowest else "")
                _axis(ax, "y", cells[1][0], axis_label(axes[1], members.units) if i == 0 or cast.narrow else "")
                if j == 0 or cast.narrow:
                    ax.set_title(words(label), loc="center")
            bar = figure.colorbar(mesh, ax=row, pad=0.02, aspect=14)
            label = paragraph(cast.quantity(metric, state), _LABEL)
            bar.set_label(said_logarithmic(label) if isinstance(norm, LogNorm) else label)
        title = _title(members, axes, metric, len({*zip(*(whose.tolist() for _, whose in cells), strict=True)}))
        return finished(figure, panels, columns, headed(members, title, (metric,)), grow=cast.narrow)


def _title(members: Collected, axes: tuple[str, str], metric: str, cells: int) -> str:
    """What is said of so many cells that have members."""
    said = lost_or_unsettled(lost=not members.sound.all(), unsettled=bool(never(members, metric).any()))
    hatched = f"; hatched: most {said}" if said else ""
    if len(members) == cells:
        return f"each cell is a member{hatched}"
    each = len(members) / cells
    about = "about " if len(members) % cells else ""
    return f"median of {about}{each:.0f} members in each cell{pooled_over(members, axes)}{hatched}"


def _cells(values: NDArray[Any]) -> tuple[list[str], NDArray[np.int64]]:
    """What the places along an axis are called, and whose they are."""
    at, whose = places(values)
    if values.dtype.kind in "iuf":
        from hgorun.figures.ticks import written

        short = [written(float(v), 2) for v in at]
        return short if len(set(short)) == len(short) else [written(float(v), 3) for v in at], whose
    return [words(str(v), limit=12) for v in levels(values)], whose


def cell_medians(values: Floats, sound: NDArray[np.bool_], x: NDArray[np.int64], y: NDArray[np.int64]) -> Floats:
    """The median in each cell, shape (rows, columns): infinite where most are lost, NaN where there is no member."""
    found = np.full((int(y.max()) + 1, int(x.max()) + 1), np.nan)
    for row, column in np.ndindex(*found.shape):
        here = (y == row) & (x == column)
        found[row, column] = float(quantiles(values[here], sound[here], [0.5])[0])
    return found


def _norm(medians: list[Floats]) -> Normalize:
    from matplotlib.colors import LogNorm, Normalize

    low, high, logarithmic = scale_of(medians)
    return LogNorm(low, high) if logarithmic else Normalize(low, high)


def scale_of(medians: Sequence[Floats]) -> tuple[float, float, bool]:
    """The ends of a scale of colours for medians of cells, and whether it is logarithmic."""
    known = drawable(np.concatenate([found.ravel() for found in medians]))
    known = known[np.isfinite(known)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    return low, high, spans_much(known)


def _draw(ax: Axes, found: Floats, norm: Normalize) -> Any:
    ax.grid(False)
    lost = np.isposinf(found)
    for row, column in zip(*np.nonzero(lost), strict=True):
        ax.add_patch(_hatched(column, row))
    mesh = ax.pcolormesh(
        np.where(np.isfinite(drawable(found)), found, np.nan), norm=norm, cmap="viridis", rasterized=True
    )
    if found.size <= _WRITTEN:
        for (row, column), value in np.ndenumerate(found):
            if math.isfinite(value):
                colour = seen_on(mesh.cmap(float(norm(value))))
                ax.text(column + 0.5, row + 0.5, _short(value), ha="center", va="center", fontsize=6.5, color=colour,
                        gid=AS_IT_IS)  # fmt: skip
    return mesh


def _short(value: float) -> str:
    """A number that fits into a cell; nothing where none does."""
    if 99.5 <= abs(value) < 9999.5:  # two digits are too few
        return f"{value:.0f}"
    text = f"{value:#.2g}".removesuffix(".")
    return text if "e" not in text else ""


def _hatched(column: int, row: int) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((column, row), 1, 1, facecolor="0.93", edgecolor="0.6", hatch="////", linewidth=0)


def _axis(ax: Axes, which: str, names: list[str], label: str) -> None:
    named = _named(len(names))
    at = [i + 0.5 for i in named]
    (ax.set_xticks if which == "x" else ax.set_yticks)(at, [names[i] for i in named] if label else [])
    ax.tick_params(axis=which, which="both", length=0)  # type: ignore[arg-type]  # x or y
    (ax.set_xlabel if which == "x" else ax.set_ylabel)(label)


def _named(count: int) -> list[int]:
    """Which of the places along an axis have labels: both ends and others, in equal steps where there are such."""
    last = count - 1
    steps = range(max(-(-last // (_MOST_LABELS - 1)), 1), last // 2 + 1)
    step = next((step for step in steps if last % step == 0), None)
    if step is not None:
        return list(range(0, count, step))
    return sorted(set(np.linspace(0, last, min(count, _MOST_LABELS)).round().astype(int).tolist()))
