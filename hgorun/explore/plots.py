"""The figures of a live page. This module imports bokeh."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, CustomJSTickFormatter, Range1d
from bokeh.plotting import figure as new_figure

from hgorun.explore.marks import dash
from hgorun.explore.picture import NOTHING, Bound, Panel
from hgorun.figures.data import Curve
from hgorun.figures.looks import Look

Plot = Any  # bokeh publishes types, but not of what figure() returns

_TOOLS = "pan,box_zoom,wheel_zoom,reset"
_HEIGHT = 270
_BLACK, _GREY, _SAMPLES, _UNSEEN = "#000000", "#3c3c3c", "#6e6e6e", "#9b1c1c"
_BOUND, _DECAY = [6, 4], [2, 4]
_WIDTH = 1.0  # of lines: without a graphics card, noise in dashes that are any wider takes ten times as long to draw
_NO_POINTS: dict[str, Any] = {"t": [], "v": []}


@dataclass
class Changes:
    """What changes in the figures of a page, until it is sent: all of it at once, so that they are drawn once.

    Bokeh would send a message for each of its models that has changed.
    """

    _curves: dict[str, Curve] = field(default_factory=dict)
    _limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    _dashes: dict[str, list[int]] = field(default_factory=dict)

    def curve(self, source: Any, curve: Curve) -> None:
        """A source has other points."""
        self._curves[source.id] = curve

    def limits(self, axis: Any, low: float, high: float) -> None:
        """A range goes between others."""
        self._limits[axis.id] = low, high

    def dashes(self, glyph: Any, dashes: list[int]) -> None:
        """A line has another style."""
        self._dashes[glyph.id] = dashes

    def taken(self) -> tuple[dict[str, Any], bytes]:
        """The changes since the last time, by the ids of bokeh's models: how many points there are of each, and these.

        The points are numbers of 64 bits, of each curve first all times, then all values.
        """
        counts = {name: len(curve.t) for name, curve in self._curves.items()}
        parts = [np.asarray(part, dtype="<f8").tobytes() for curve in self._curves.values() for part in curve]
        said = {"curves": counts, "limits": self._limits, "dashes": self._dashes}
        self._curves, self._limits, self._dashes = {}, {}, {}
        return said, b"".join(parts)


def empty_plot(name: str, time: str, value: str, span: tuple[float, float], *, logarithmic: bool = False) -> Plot:
    """Axes without curves, as wide as the page lets them be."""
    plot = new_figure(
        name=name,
        height=_HEIGHT,
        sizing_mode="stretch_width",
        min_width=200,
        tools=_TOOLS,
        x_axis_label=time,
        y_axis_label=value,
        x_range=Range1d(*span),
        y_range=Range1d(1e-3, 1.0) if logarithmic else Range1d(0.0, 1.0),
        y_axis_type="log" if logarithmic else "linear",
        output_backend="canvas",
        border_fill_color=None,  # that of the page is seen, light or dark
        background_fill_color=None,
        outline_line_color=None,  # without a background Bokeh would stroke with it whatever was drawn last
        lod_threshold=None,  # few points are sent: all are drawn, also while a figure is moved
    )
    plot.toolbar.logo = None
    for axis in (plot.xaxis, plot.yaxis):
        axis.level = "overlay"  # has a canvas of its own: axes are not drawn anew with every curve
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_color = axis.major_label_text_color = _GREY
    if logarithmic:
        plot.yaxis.ticker.desired_num_ticks = 4
        plot.yaxis.formatter = CustomJSTickFormatter(code="return String(Number(tick.toPrecision(4)))")
    return plot


class Lines:
    """The lines of one set of axes, a source each, by their names."""

    def __init__(self, plot: Plot, changes: Changes, *, logarithmic: bool) -> None:
        self.plot, self._changes = plot, changes
        self._logarithmic = logarithmic
        self._sources: dict[str, Any] = {}
        self._glyphs: dict[str, Any] = {}
        self._shown: dict[str, Curve] = {}
        self._dashes: dict[str, list[int]] = {}
        self._limits: tuple[float, float] | None = None

    def add(self, name: str, colour: str, width: float, dashes: Any = "solid") -> None:
        """A line that has no points yet."""
        self._sources[name] = source = ColumnDataSource(dict(_NO_POINTS))
        line = self.plot.line("t", "v", source=source, color=colour, line_width=width, line_dash=dashes)
        self._glyphs[name] = line.glyph

    def add_dots(self, name: str, *, large: bool = False) -> None:
        """Points that are not joined."""
        self._sources[name] = source = ColumnDataSource(dict(_NO_POINTS))
        self.plot.scatter("t", "v", source=source, marker="diamond" if large else "circle",
                          color=_UNSEEN if large else _SAMPLES, size=8 if large else 3)  # fmt: skip

    def set(self, name: str, curve: Curve | None) -> None:
        """Give a line its points, or none; one that stays as it is costs nothing."""
        shown = self._shown.get(name, NOTHING)
        curve = NOTHING if curve is None else curve
        pairs = zip(shown, curve, strict=True)
        if not all(one is other or np.array_equal(one, other, equal_nan=True) for one, other in pairs):
            self._shown[name] = curve
            self._changes.curve(self._sources[name], curve)

    def set_dashes(self, name: str, dashes: list[int]) -> None:
        """Give a line another style."""
        if self._dashes.get(name) != dashes:
            self._dashes[name] = dashes
            self._changes.dashes(self._glyphs[name], dashes)

    def set_limits(self, low: float, high: float) -> None:
        """Between which the axis of values goes; a logarithmic one about, so that not every small change moves it."""
        if self._logarithmic:
            low, high = _in_decades(low, high)
        if (low, high) != self._limits:
            self._limits = low, high
            self._changes.limits(self.plot.y_range, low, high)


def _in_decades(low: float, high: float) -> tuple[float, float]:
    """Limits moved outwards to thirds of decades."""
    ends = math.floor(3 * math.log10(low)) / 3, math.ceil(3 * math.log10(high)) / 3
    return 10.0 ** ends[0], 10.0 ** ends[1]


def estimates_of(plot: Plot, changes: Changes, looks: Mapping[str, Look], *, closed: bool, recorded: bool) -> Lines:
    """Lines for a state: samples, estimates, and the truth above them."""
    lines = Lines(plot, changes, logarithmic=False)
    lines.add_dots("measured")
    if recorded:
        lines.add_dots("unseen", large=True)
    for label, look in looks.items():
        lines.add(f"estimate {label}", look.colour, _WIDTH, dash(look.dashes))
        if closed:
            lines.add(f"own {label}", look.colour, _WIDTH, [3, 3])
    lines.add("truth", _BLACK, _WIDTH, [6, 3])
    return lines


def errors_of(plot: Plot, changes: Changes, looks: Mapping[str, Look]) -> Lines:
    """Lines for errors and what bounds them."""
    lines = Lines(plot, changes, logarithmic=True)
    for label, look in looks.items():
        lines.add(f"error {label}", look.colour, _WIDTH, dash(look.dashes))
        lines.add(f"bound {label}", look.colour, _WIDTH, _BOUND)
    return lines


def draw_estimates(lines: Lines, panel: Panel, labels: tuple[str, ...], *, closed: bool) -> None:
    """Show a state of a run."""
    lines.set("truth", panel.truth)
    lines.set("measured", panel.measured)
    lines.set("unseen", panel.unseen)
    for label in labels:
        lines.set(f"estimate {label}", panel.estimates.get(label))
        if closed:
            lines.set(f"own {label}", panel.own_truths.get(label))
    lines.set_limits(*panel.limits)


def draw_errors(lines: Lines, panel: Panel, labels: tuple[str, ...]) -> None:
    """Show the errors of a run."""
    for label in labels:
        lines.set(f"error {label}", panel.errors.get(label))
    lines.set_limits(*panel.error_limits)


def draw_bound(lines: Lines, label: str, bound: Bound | None, *, with_error: bool) -> None:
    """Show what bounds an error, and the error where that is not of a state."""
    lines.set(f"bound {label}", None if bound is None else bound.bound)
    if bound is not None:
        lines.set_dashes(f"bound {label}", _BOUND if bound.holds else _DECAY)
    if with_error:
        lines.set(f"error {label}", None if bound is None else bound.error)
