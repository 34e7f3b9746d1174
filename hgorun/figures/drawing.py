"""Figures of results, drawn with matplotlib's objects: no pyplot, no global state."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from hgorun.config.models import Figure as FigureBlock
from hgorun.config.models import Panel
from hgorun.figures.actors import Actor, cast
from hgorun.figures.names import check, names_of
from hgorun.figures.panels import Scene, draw_error, draw_magnitude, draw_output, draw_state, moving_window
from hgorun.figures.style import DOTS, DPI, LARGEST, TRUTH, dashes, styled
from hgorun.figures.typeset import paragraph, unit, words
from hgorun.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend

# Inches: width of a comparison, height of its rows, of a figure's panels, of title and legend.
_WIDTH, _ROW, _PANEL, _TOP = 7.2, 1.8, 2.2, 0.6


def comparison(results: Result | Sequence[Result]) -> Figure:
    """Every state with all estimates on the left, the size of the errors on the right.

    Errors are drawn as the largest ``|xhat - x|`` in a moving window as long as the metrics' moving average,
    on a logarithmic axis: noisy errors cross zero so often that they would hide each other.

    Parameters
    ----------
    results : Result or sequence of Result
        Labels are ``name: label`` when there are several.

    Returns
    -------
    matplotlib.figure.Figure
    """
    several = _several(results)
    actors = cast(several)
    states = list(dict.fromkeys(name for r in several for name in r.states))
    scene = Scene(several, actors, dashes([[a.order for a in actors]]))
    with styled():
        figure, axes = grid(len(states), 2, _WIDTH, _ROW * len(states) + _TOP, share=True)
        for (left, right), name in zip(axes, states, strict=True):
            draw_state(left, scene, name)
            draw_magnitude(right, scene, name)
        axes[0][0].set_title("states and estimates")
        axes[0][1].set_title(_magnitude_title(several))
        title = several[0].title if len(several) == 1 else None
        return finished(figure, axes, several, title, grow=True)


def draw(results: Result | Sequence[Result], figure: FigureBlock, name: str = "figure") -> Figure:
    """A figure of the configuration's ``figures`` block.

    Panels that show the same state in the same window have the same vertical axis. Measurements stand at the
    time of their arrival. A panel with one observer is titled with its label where panels differ.

    Parameters
    ----------
    results : Result or sequence of Result
        With several, panels show all of them; observers may be picked as ``run/label``.
    figure : hgorun.config.models.Figure
    name : str
        Its key, for messages.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    Problem
        When a panel names what does not exist; see :func:`hgorun.figures.check`.
    """
    several, panels = _several(results), figure.panels
    known = names_of(several)
    check({name: figure}, known.states, known.outputs, known.observers, known.span)
    actors = cast(several)
    shown = [[a for a in actors if panel.output is None and a.among(panel.observers)] for panel in panels]
    styles = dashes([[a.order for a in group] for group in shown])
    with styled():
        height = figure.height or _PANEL * len(panels)
        made, axes = grid(len(panels), 1, figure.width, height, share=len({p.window for p in panels}) == 1)
        for (ax,), panel, group in zip(axes, panels, shown, strict=True):
            _draw_panel(ax, Scene(_runs(several, group, panel), group, styles, panel.window), panel)
        _level(axes, panels)
        for (ax,), title in zip(axes, _titles(panels, shown), strict=True):
            if title:
                ax.set_title(paragraph(title, figure.width))
        return finished(made, axes, several, figure.title, grow=figure.height is None)


def _several(results: Result | Sequence[Result]) -> list[Result]:
    several = [results] if isinstance(results, Result) else list(results)
    if not several:
        raise ValueError("a figure needs at least one result")
    return several


def _magnitude_title(results: Sequence[Result]) -> str:
    windows = {f"{moving_window(r):.4g} {words(r.units.get('time', ''))}".rstrip() for r in results}
    return "largest error in a moving window" + (f" of {windows.pop()}" if len(windows) == 1 else "")


def _runs(results: Sequence[Result], group: Sequence[Actor], panel: Panel) -> list[Result]:
    """Whose truth a panel shows: that of the observers picked, or everybody's."""
    if panel.observers is None or not group:
        return list(results)
    return [r for i, r in enumerate(results) if any(a.run == i for a in group)]


def _titles(panels: Sequence[Panel], shown: Sequence[Sequence[Actor]]) -> list[str | None]:
    differ = len({tuple(a.order for a in group) for group in shown if group}) > 1
    return [
        panel.title if panel.title is not None or not differ or len(group) != 1 else group[0].text
        for panel, group in zip(panels, shown, strict=True)
    ]


def _draw_panel(ax: Axes, scene: Scene, panel: Panel) -> None:
    if panel.error is not None:
        draw_error(ax, scene, panel.error)
    elif panel.state is not None:
        draw_state(ax, scene, panel.state, samples=panel.measurements)
    elif panel.output is not None:
        draw_output(ax, scene, panel.output)
    if panel.window is not None:
        ax.set_xlim(panel.window)
    if panel.limits is not None:
        ax.set_ylim(panel.limits)


def _level(axes: list[list[Axes]], panels: Sequence[Panel]) -> None:
    """The same range for panels that show the same state, so that they can be compared."""
    groups: dict[Any, list[Axes]] = {}
    for (ax,), panel in zip(axes, panels, strict=True):
        if panel.state is not None and panel.limits is None:
            groups.setdefault((panel.state, panel.window, panel.measurements), []).append(ax)
    for group in groups.values():
        ranges = [ax.get_ylim() for ax in group]
        for ax in group:
            ax.set_ylim(min(low for low, _ in ranges), max(high for _, high in ranges))


def grid(rows: int, columns: int, width: float, height: float, *, share: bool) -> tuple[Figure, list[list[Axes]]]:
    """An empty figure and its axes, row by row; sizes in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False, sharex=share)
    return figure, [list(row) for row in axes]


def finished(
    figure: Figure, axes: list[list[Axes]], results: Sequence[Result], title: str | None, *, grow: bool
) -> Figure:
    """Ticks, time axes and legend, which need to know all panels; a figure may grow for a long legend."""
    start, end = min(float(r.time[0]) for r in results), max(float(r.time[-1]) for r in results)
    label = "time" + unit(next((r.units["time"] for r in results if r.units.get("time")), ""))
    for i, row in enumerate(axes):
        for ax in row:
            if ax.get_autoscalex_on() and end > start:
                ax.set_xlim(start, end)
            _tick(ax)
            if i == len(axes) - 1 or not ax.get_shared_x_axes().joined(ax, axes[-1][0]):
                ax.set_xlabel(label)
    figure.align_ylabels([ax for row in axes for ax in row])
    legend = _legend(figure, axes, paragraph(title, figure.get_figwidth()) if title else None)
    if grow:
        taller = max(legend.get_window_extent().height / figure.dpi - _TOP, 0)
        figure.set_figheight(min(figure.get_figheight() + taller, LARGEST))
    figure.draw_without_rendering()  # makes the ticks now, in our style, not when somebody saves
    figure.set_layout_engine("none")  # every format gets this layout
    return figure


def _tick(ax: Axes) -> None:
    from matplotlib.ticker import AutoMinorLocator, LogLocator, MaxNLocator, NullFormatter

    for axis, scale in ((ax.xaxis, ax.get_xscale()), (ax.yaxis, ax.get_yscale())):
        if scale == "log":
            axis.set_major_locator(LogLocator(numticks=6))
            axis.set_minor_formatter(NullFormatter())
        else:
            axis.set_major_locator(MaxNLocator(nbins="auto", steps=[1, 2, 5, 10]))
            axis.set_minor_locator(AutoMinorLocator())


def _legend(figure: Figure, axes: list[list[Axes]], title: str | None) -> Legend:
    """One legend above all panels, in as many columns as fit; the figure's title is its title."""
    handles: dict[tuple[str, Any], Any] = {}
    for row in axes:
        for ax in row:
            for line in ax.lines:
                text = str(line.get_label())
                if not text.startswith("_"):  # matplotlib's own names for what has none
                    handles.setdefault((text, line.get_color()), line)
    order = {TRUTH["label"]: 0, DOTS["label"]: 1}
    entries = sorted(handles, key=lambda entry: order.get(entry[0], 2))
    texts = [text for text, _ in entries]
    room = figure.get_figwidth() * figure.dpi
    columns = max(len(texts), 1)
    while True:
        legend = figure.legend(
            [handles[entry] for entry in entries],
            texts,
            ncols=columns,
            title=title,
            loc="outside upper center",
        )
        legend.get_title().set_multialignment("center")
        if columns == 1 or legend.get_window_extent().width <= room:
            return legend
        legend.remove()
        columns -= 1
