"""Figures of ensembles for a browser: zoomed with the wheel, read by pointing. This module imports bokeh."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from bokeh.models import (
    ColorBar,
    ColumnDataSource,
    CustomJSTicker,
    CustomJSTickFormatter,
    FactorRange,
    HoverTool,
    LinearColorMapper,
    LogColorMapper,
    LogTicker,
    Range1d,
    Whisker,
)
from bokeh.palettes import Viridis256
from bokeh.plotting import figure as new_figure

from hgorun.ensemble.collected.collected import Collected, Floats, levels, shown
from hgorun.ensemble.statistics.fronts import non_dominated
from hgorun.ensemble.statistics.never import is_time
from hgorun.ensemble.statistics.points import points, thinned
from hgorun.ensemble.statistics.statistics import QUANTILES
from hgorun.explore.marks import MARKERS, dash, draw_band
from hgorun.figures.data import magnitude_limits, state_limits
from hgorun.figures.ensemble import Cast, drawable, limits, places, spans_much
from hgorun.figures.fronts import medians_of_points
from hgorun.figures.lost import ends, first_lost, largest_of, mostly_lost, spread, within_sound
from hgorun.figures.maps import cell_medians, scale_of
from hgorun.figures.spread import at_places, told_of_lost
from hgorun.result.metrics.base import unit_of
from hgorun.tables.axis_names import bracketed, output_of, unit_of_axis

Plot = Any  # bokeh publishes types, but not of what figure() returns
_SIZE = {"width": 400, "height": 320}
_TOOLS = "pan,wheel_zoom,box_zoom,reset,save"
_ACROSS, _UP = 5, 6  # ticks of a logarithmic axis, at most
_MOST_LEVEL = 5  # labels of an axis, without turning them
_MOST_POINTS = 3_000  # of a scatter
_ALONG_TIME = 400  # points of a band


def against(cast: Cast, axis: str, metric: str, state: str) -> Plot:
    """A metric against an axis: medians with bands."""
    members = cast.members
    at, whose = places(members.axes[axis])
    texts = None if members.axes[axis].dtype.kind in "iuf" else [shown(v) for v in levels(members.axes[axis])]
    found = {label: at_places(*cast.column(metric, label, state), whose, len(at)) for label in cast.looks}
    x_scale: dict[str, Any] = {"x_axis_type": _scale(at)} if texts is None else {"x_range": FactorRange(*texts)}
    plot = _plot(axis_name(axis, members.units), name(cast, metric, state), **_vertical(found.values()), **x_scale)
    for label, rows in found.items():
        draw_band(plot, cast, label, at if texts is None else texts, rows, mostly_lost(rows), marked=True)
    return _finished(plot)


def boxes(cast: Cast, metric: str, state: str) -> Plot:
    """A metric of all members as boxes."""
    labels = list(cast.looks)
    found = np.array([spread(*cast.column(metric, label, state)) for label in labels]).T
    plot = _plot("", name(cast, metric, state), x_range=FactorRange(*labels), **_vertical([found]))
    data: dict[str, Any] = dict(
        zip(QUANTILES, np.where(np.isfinite(found[0]), ends(found, largest_of([found])), np.nan), strict=True)
    )
    data |= {"observer": labels, "colour": [cast.looks[label].colour for label in labels]}
    told = [told_of_lost(cast, metric, label, state) for label in labels]
    data |= {"top": [plot.y_range.end] * len(labels), "told": told}
    source = ColumnDataSource(data)
    whisker = Whisker(base="observer", upper="q95", lower="q05", source=source, line_color="colour")
    for head in (whisker.upper_head, whisker.lower_head):
        head.size = 20
    plot.add_layout(whisker)
    for low, high in (("q25", "median"), ("median", "q75")):
        plot.vbar(x="observer", top=high, bottom=low, width=0.5, source=source, fill_color="colour",
                  line_color="colour", fill_alpha=0.25)  # fmt: skip
    plot.text("observer", "top", "told", source=source, text_align="center", text_baseline="top", y_offset=2,
              text_font_size="11px", text_color="#444444")  # fmt: skip
    plot.add_tools(HoverTool(tooltips=[("", "@observer"), *((q, f"@{q}") for q in QUANTILES), ("", "@told")]))
    return plot


def heat_maps(cast: Cast, axes: tuple[str, str], metric: str, state: str) -> list[Plot]:
    """The median of a metric in each cell of two axes, a map for each observer, in one scale of colours."""
    members = cast.members
    (x, x_names), (y, y_names) = (_cells(members, axis) for axis in axes)
    medians = {label: cell_medians(*cast.column(metric, label, state), x, y) for label in cast.looks}
    missing = "lost or never" if is_time(metric) else "lost"
    low, high, logarithmic = scale_of(list(medians.values()))
    mapper_of = LogColorMapper if logarithmic else LinearColorMapper
    mapper = mapper_of(palette=Viridis256, low=low, high=high, nan_color="#dddddd")
    x_label, y_label = (axis_name(axis, members.units) for axis in axes)
    found = []
    for label, median in medians.items():
        title = f"{label}: {name(cast, metric, state)}"
        plot = _plot(x_label, y_label, title=title, x_range=FactorRange(*x_names), y_range=FactorRange(*y_names))
        rows, columns = np.indices(median.shape).reshape(2, -1)
        data = {
            "x": [x_names[k] for k in columns],
            "y": [y_names[k] for k in rows],
            "median": np.where(np.isfinite(drawable(median)), median, np.nan).ravel(),
            "shown": [missing if math.isinf(v) else f"{v:.4g}" for v in median.ravel()],
        }
        colour = {"field": "median", "transform": mapper}
        plot.rect("x", "y", 1, 1, source=ColumnDataSource(data), line_color=None, fill_color=colour)
        plot.xaxis.major_label_orientation = 0.9 if len(x_names) > _MOST_LEVEL else "horizontal"
        plot.add_layout(ColorBar(color_mapper=mapper), "right")
        plot.add_tools(HoverTool(tooltips=[(x_label, "@x"), (y_label, "@y"), ("median", "@shown")]))
        found.append(plot)
    return found


def trade_off(cast: Cast, metrics: tuple[str, str], state: str) -> Plot:
    """Two metrics against each other, medians over draws, with fronts: among gains, all else equal."""
    members = cast.members
    parts = list(points(thinned(members, members.grid, _MOST_POINTS), members.grid))
    level = np.array([", ".join(shown(at[axis]) for axis in members.surroundings) for at, _ in parts], dtype=object)
    of_axes = {axis: unit_of_axis(axis, members.units) for axis in members.grid}
    texts = [", ".join(f"{a} = {shown(value)} {of_axes[a]}".rstrip() for a, value in at.items()) for at, _ in parts]
    found = {label: medians_of_points(parts, metrics, label, state) for label in cast.looks}
    ends = np.concatenate(list(found.values()))
    ends = ends[np.all(np.isfinite(ends), axis=1)]
    plot = _plot(
        *(name(cast, metric, state) for metric in metrics),
        x_axis_type=_scale(ends[:, 0]),
        y_axis_type=_scale(ends[:, 1]),
    )
    for label, look in cast.looks.items():
        pairs = found[label]
        for one in dict.fromkeys(level.tolist()):
            own = pairs[level == one]
            best = own[non_dominated(own)]
            best = best[np.argsort(best[:, 0], kind="stable")]
            plot.line(*best.T, color=look.colour, line_dash=dash(look.dashes), legend_label=label)
        source = ColumnDataSource(
            {"x": pairs[:, 0], "y": pairs[:, 1], "where": texts, "observer": [label] * len(texts)}
        )
        plot.scatter("x", "y", source=source, color=look.colour, marker=MARKERS[look.marker], size=7,
                     alpha=0.7, legend_label=label)  # fmt: skip
    plot.add_tools(HoverTool(tooltips=[("", "@observer"), ("", "@where"), ("", "(@x, @y)")]))
    return _finished(plot)


def along_time(cast: Cast, state: str, *, error: bool) -> Plot:
    """Bands of the trajectories that were kept: of a state, or of the size of its error."""
    members = cast.members
    kept = members.trajectories
    assert kept is not None
    j, step = members.states.index(state), step_along(len(kept.time))
    time, truth = kept.time[::step], kept.x[:, ::step, j]
    estimates = {label: kept.xhat[:, i, ::step, j] for i, label in enumerate(cast.looks)}
    values = {label: np.abs(xhat - truth) if error else xhat for label, xhat in estimates.items()}
    found = {label: spread(of, np.isfinite(of), signed=not error) for label, of in values.items()}
    seen = [within_sound(values[label], rows) for label, rows in found.items()]
    seen_truth = [] if error else [truth[np.isfinite(truth)]]
    low_high = (magnitude_limits(seen, []) if error else state_limits(seen_truth, seen, [])) or (0.1, 1.0)
    unit = bracketed(members.units.get(state, ""))
    title = f"|error of {state}|{unit}" if error else f"{state}{unit}"
    axis: dict[str, Any] = {"y_axis_type": "log" if error else "linear", "y_range": Range1d(*low_high)}
    plot = _plot(f"time{bracketed(members.units.get('time', ''))}", title, **axis)
    for label, rows in found.items():
        above = np.where(rows > 0, rows, np.nan) if error else rows
        draw_band(plot, cast, label, time, above, first_lost(rows))
    if not error:
        plot.line(time, np.median(truth, axis=0), color="black", line_dash=[4, 3], legend_label="true")
    return _finished(plot)


def step_along(points: int) -> int:
    """Of so many points along time one in so many is drawn."""
    return max(points // _ALONG_TIME, 1)


def axis_name(axis: str, units: Mapping[str, str]) -> str:
    """An axis of an ensemble in words: the last part of its path, and whose it is, with its unit.

    Parameters
    ----------
    axis : str
    units : mapping of str to str
        Of ``time``, and of axes that are no times.
    """
    parts = axis.split(".")
    output = output_of(axis)
    whose = f" of {output}" if output else ""
    if parts[0] == "measurement" and "noise" in parts:
        whose = f" of noise{whose}"
    elif parts[0] == "observers" and len(parts) > 2 and parts[1] != "*":
        whose = f" of {parts[1]}"
    return parts[-1] + whose + bracketed(unit_of_axis(axis, units))


def name(cast: Cast, metric: str, state: str) -> str:
    """A metric of a state in words, with its unit."""
    return f"{metric} {state}{bracketed(unit_of(metric, state, cast.members.units))}"


def _cells(members: Collected, axis: str) -> tuple[Any, list[str]]:
    """Which place along an axis is whose, and what the places are called."""
    at, whose = places(members.axes[axis])
    if members.axes[axis].dtype.kind in "iuf":
        return whose, [f"{v:.3g}" for v in at]
    return whose, [shown(v) for v in levels(members.axes[axis])]


def _vertical(found: Iterable[Floats]) -> dict[str, Any]:
    """The vertical axis for these numbers."""
    values = np.concatenate([part[np.isfinite(part)] for part in found])
    if not values.size:
        return {"y_range": Range1d(0.0, 1.0)}
    scale = _scale(values)
    low, high = limits(float(values.min()), float(values.max()), logarithmic=scale == "log")
    return {"y_axis_type": scale, "y_range": Range1d(low, high)}


def _plot(x: str, y: str, **options: Any) -> Plot:
    """Empty axes."""
    plot = new_figure(**_SIZE, tools=_TOOLS, x_axis_label=x, y_axis_label=y, output_backend="canvas", **options)
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    plot.border_fill_color = None  # the page's is seen; of one of its own a rim stays when it changes with the scheme
    for axis, most in ((plot.xaxis, _ACROSS), (plot.yaxis, _UP)):
        if isinstance(axis[0].ticker, LogTicker):
            axis.ticker = CustomJSTicker(major_code=_ticks(), minor_code=_ticks(), args={"most": most})
            axis.formatter = CustomJSTickFormatter(code="return String(Number(tick.toPrecision(4)))")
    return plot


@cache
def _ticks() -> str:
    return (files("hgorun.explore") / "log_ticks.js").read_text(encoding="utf-8")


def _finished(plot: Plot) -> Plot:
    """An observer disappears and comes back when its name is clicked."""
    (legend,) = plot.legend
    legend.click_policy = "hide"
    legend.orientation = "horizontal"
    legend.label_text_font_size = "8pt"
    legend.border_line_color = None
    legend.padding, legend.margin, legend.spacing = 2, 2, 6
    plot.add_layout(legend, "above")
    return plot


def _scale(values: Sequence[float] | Floats) -> str:
    return "log" if spans_much(values) else "linear"
