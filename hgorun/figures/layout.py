"""Axes side by side, their ticks and the legend above them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from hgorun.figures.style import (
    BAND,
    BAND_OPACITY,
    DOTS,
    DPI,
    HELD_OUT,
    LARGEST,
    OUTLIERS,
    REFERENCE,
    STATE_FEEDBACK,
    THEORY,
    TRUTH,
    edged,
)
from hgorun.result.records.data import ResultData
from hgorun.tables.typeset import columns as columns_of
from hgorun.tables.typeset import paragraph, shortened, unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.lines import Line2D

TOP = 0.6  # inches for title and legend
_MARGIN = 0.05  # inches that a legend keeps from the edges of its figure
_SHORTEST = 8  # characters of a legend's texts


def grid(count: int, columns: int, width: float, height: float, *, share: bool) -> tuple[Figure, list[Axes]]:
    """A figure with so many panels, filled row after row; with ``share`` they have one horizontal axis."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    rows = -(-count // columns)
    axes = list(figure.subplots(rows, columns, squeeze=False, sharex=share).flat)
    for ax in axes[count:]:
        ax.remove()
    for ax in axes[max(count - columns, 0) : count]:  # the lowest of each column
        ax.tick_params(axis="x", which="both", labelbottom=True)
    return figure, axes[:count]


def time_axis(ax: Axes, results: Sequence[ResultData], span: tuple[float, float] | None) -> None:
    """The horizontal axis of a panel that shows these results."""
    if span is not None and span[1] > span[0]:
        ax.set_xlim(span)
    since = {"" if r.recorded is None else r.recorded.time_origin for r in results}
    origin = f" since {since.pop().replace('T', ' ').replace('Z', ' UTC')}" if len(since) == 1 and all(since) else ""
    ax.set_xlabel("time" + unit(next((r.units["time"] for r in results if r.units.get("time")), "")) + origin)


def finished(
    figure: Figure,
    axes: Sequence[Axes],
    columns: int,
    title: str | None,
    *,
    grow: bool,
    cuts: bool = False,
    room: bool = False,
    order: Sequence[str] = (),
) -> Figure:
    """Ticks and legend, which need to know all panels; a figure may grow for a long legend.

    Parameters
    ----------
    cuts : bool
        Mark what the limits of the panels cut off.
    room : bool
        Raise the upper limits of the panels, whose axes are logarithmic, so that these marks lie on nothing.
    order : sequence of str
        What the legend calls the observers, in the order of their file.
    """
    from hgorun.figures.cut_marks import make_room_all, mark_all
    from hgorun.figures.ticks import tick

    for i, ax in enumerate(axes):
        tick(ax)
        lower = axes[i + columns] if i + columns < len(axes) else None
        if lower is not None and ax.get_shared_x_axes().joined(ax, lower):
            ax.set_xlabel("")
        for inset in _insets(ax):
            tick(inset, limit=3)
    figure.align_ylabels(axes)
    legend = _legend(figure, axes, paragraph(title, figure.get_figwidth()) if title else None, order)
    if grow:
        taller = max(legend.get_window_extent().height / figure.dpi - TOP, 0)
        figure.set_figheight(min(figure.get_figheight() + taller, LARGEST))
    figure.draw_without_rendering()  # makes the ticks now, in our style, not when somebody saves
    if room:
        make_room_all(axes, figure.dpi)
        for ax in axes:
            tick(ax)
        figure.draw_without_rendering()  # the labels of the new ticks may be wider
    figure.set_layout_engine("none")  # every format gets this layout
    if cuts:
        mark_all([*axes, *(inset for ax in axes for inset in _insets(ax))], figure.dpi)
    for ax in axes:
        for axis in (ax.xaxis, ax.yaxis):
            _freeze_label(ax, axis)
    for ax in axes:
        for inset in _insets(ax):
            for label in (*inset.get_xticklabels(), *inset.get_yticklabels()):  # they stand on the panel's lines
                label.set_bbox({"facecolor": "white", "edgecolor": "none", "alpha": 0.9, "pad": 0.5})
    return figure


def _freeze_label(ax: Axes, axis: Axis) -> None:
    """Keep a label where the layout has put it: finding its place anew among aligned ones takes a third of saving."""
    x, y = axis.label.get_transform().transform(axis.label.get_position())
    axis.set_label_coords(*ax.transAxes.inverted().transform((x, y)))


def _insets(ax: Axes) -> list[Axes]:
    from matplotlib.axes import Axes

    return [child for child in ax.child_axes if isinstance(child, Axes)]


def _legend(figure: Figure, axes: Sequence[Axes], title: str | None, order: Sequence[str]) -> Legend:
    """One legend above all panels, in as many columns as fit; the figure's title is its title.

    What is measured or true is said once, whatever its greys and sizes in the panels, and so is what should lie in
    bands, beside the colours of all of them.
    """
    from matplotlib.legend_handler import HandlerTuple

    places = {text: place for place, text in enumerate(dict.fromkeys(order))}
    handles = _handles(axes, places)
    entries = sorted(handles, key=lambda entry: (_rank(entry[0], places), places.get(entry[0], 0)))
    texts = [text for text, _ in entries]
    room = figure.get_figwidth() * figure.dpi - 2 * _MARGIN * figure.dpi
    columns, limit = max(len(texts), 1), max(map(columns_of, texts), default=0)
    while True:
        legend = figure.legend(
            [_drawn(entry[0], handles[entry], places) for entry in entries],
            [text if "$" in text else shortened(text, limit) for text in texts],
            ncols=columns,
            title=title,
            handler_map={tuple: HandlerTuple(ndivide=None, pad=0.2)},
            loc="outside upper center",
        )
        legend.get_title().set_multialignment("center")
        for entry, handle in zip(entries, legend.legend_handles, strict=True):
            if handle is not None:
                handle.set_gid(handles[entry][0].get_gid())  # it keeps its colour where its line does
        width = max(legend.get_window_extent().width, legend.get_title().get_window_extent().width)
        filled = -(-len(texts) // -(-len(texts) // columns)) if texts else 1  # as many rows, without one alone in a row
        fits = width <= room or (columns == 1 and limit <= _SHORTEST)
        if fits and filled == columns:
            return legend
        legend.remove()
        if fits:
            columns = filled
        else:
            columns, limit = (columns - 1, limit) if columns > 1 else (1, limit - 2)


def _handles(axes: Sequence[Axes], places: Mapping[str, int]) -> dict[tuple[str, Any], list[Line2D]]:
    """The lines of each entry of the legend: of bands one in every colour, of all else one."""
    handles: dict[tuple[str, Any], list[Line2D]] = {}
    titles = [ax.get_title(loc="left") for ax in axes]
    for ax in axes:
        for line in ax.lines:
            text = str(line.get_label())
            named = text == ax.get_title(loc="left") and titles.count(text) == 1  # by its panel's title
            if text.startswith("_") or named:  # matplotlib's own names for what has none
                continue
            once = _of_bands(text, places) or (_rank(text) < _OBSERVERS and text not in places)
            known = handles.setdefault((text, "" if once else line.get_color()), [])
            if _of_bands(text, places):
                known += [line] if all(line.get_color() != other.get_color() for other in known) else []
            elif not known or known[0].get_markersize() < line.get_markersize():
                known[:] = [line]
    return handles


def _drawn(text: str, lines: Sequence[Line2D], places: Mapping[str, int]) -> Any:
    """What a legend shows of these lines: of bands patches, of those that are dotted lines."""
    from matplotlib.patches import Patch

    if not _of_bands(text, places):
        return lines[0]
    return tuple(
        Patch(**edged(str(line.get_color()), BAND_OPACITY)) if line.get_linestyle() == "-" else line for line in lines
    )


def _of_bands(text: str, places: Mapping[str, int]) -> bool:
    return text.startswith(BAND) and text not in places


_KINDS = [STATE_FEEDBACK, *(str(kind["label"]) for kind in (TRUTH, REFERENCE, DOTS, OUTLIERS, HELD_OUT, THEORY))]
_OBSERVERS = len(_KINDS)


def _rank(text: str, observers: Mapping[str, int] = MappingProxyType({})) -> int:
    """Truth, reference, measurements and theory stand before the observers, bands behind all else."""
    if text in observers:
        return _OBSERVERS
    if text.startswith(BAND):
        return _OBSERVERS + 2
    of = (i for i, kind in enumerate(_KINDS) if text == kind or text.endswith(f": {kind}"))
    found = next(of, None)
    if found is None and text.startswith(f"{OUTLIERS['label']} by "):
        found = _KINDS.index(str(OUTLIERS["label"]))
    if found is None:
        found = _OBSERVERS + 1 if observers else _OBSERVERS
    return found
