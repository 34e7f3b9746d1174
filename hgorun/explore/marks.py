"""Lines, markers and bands of observers in figures for a browser. This module imports bokeh."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, LogScale
from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Floats
from hgorun.ensemble.statistics.statistics import QUANTILES
from hgorun.figures.ensemble import Cast
from hgorun.figures.lost import bands, drawn_median, height_of_crosses

Plot = Any  # bokeh publishes types, but not of what figure() returns
_EDGE = {"line_alpha": 0.7, "line_width": 0.6}  # of bands, so that each is told where several overlap
MARKERS = {
    "o": "circle", "s": "square", "^": "triangle", "D": "diamond", "v": "inverted_triangle", "P": "plus", "X": "x",
    "<": "triangle", ">": "triangle", "h": "hex",
}  # fmt: skip


def dash(style: Any) -> Any:
    """A line style of matplotlib for bokeh: whole numbers of pixels."""
    return "solid" if style == "solid" else [max(round(1.4 * part), 1) for part in style[1]]


def draw_band(
    plot: Plot, cast: Cast, label: str, at: Any, rows: Floats, crossed: NDArray[np.bool_], *, marked: bool = False
) -> None:
    """Median and bands of an observer, with crosses at the top where they are asked for."""
    look, beside = cast.looks[label], []
    for low, high, alpha in bands(rows, max(abs(plot.y_range.start), abs(plot.y_range.end))):
        source = ColumnDataSource({"x": at, "low": low, "high": high})
        plot.varea("x", "low", "high", source=source, fill_color=look.colour, fill_alpha=alpha, legend_label=label)
        beside += [plot.line("x", end, source=source, color=look.colour, **_EDGE) for end in ("low", "high")]
    data = {"x": at, **dict(zip(QUANTILES, rows, strict=True)), "observer": [label] * len(rows[2])}
    source = ColumnDataSource(data | {"median": drawn_median(rows)})
    line = plot.line("x", "median", source=source, color=look.colour, line_width=1.6,
                     line_dash=dash(look.dashes), legend_label=label)  # fmt: skip
    if crossed.any():
        places = [at[k] for k in np.flatnonzero(crossed)]
        top = _height(plot, height_of_crosses(list(cast.looks).index(label)))
        beside.append(plot.scatter(places, [top] * len(places), marker="x", size=9, color=look.colour, line_width=2))
    for one in beside:  # hidden with the line; in the legend they would be seen on it
        line.js_link("visible", one, "visible")
    if marked:
        line = plot.scatter("x", "median", source=source, color=look.colour, marker=MARKERS[look.marker], size=6,
                            legend_label=label)  # fmt: skip
    plot.add_tools(HoverTool(renderers=[line], tooltips=[("", "@observer at @x"), *((q, f"@{q}") for q in QUANTILES)]))


def _height(plot: Plot, part: float) -> float:
    """The value at a part of the height of a plot."""
    low, high = plot.y_range.start, plot.y_range.end
    return float(low * (high / low) ** part if isinstance(plot.y_scale, LogScale) else low + part * (high - low))
