"""Figures of results, drawn with matplotlib's objects: no pyplot, no global state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hgorun.config.models import Figure as FigureBlock
from hgorun.config.models import Panel
from hgorun.figures import data
from hgorun.figures.cast import Actor, cast
from hgorun.figures.data import Curve
from hgorun.figures.names import check, names_of
from hgorun.figures.style import DPI, SAMPLES, TRUTH, styled
from hgorun.figures.typeset import paragraph, symbol, unit, words
from hgorun.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Window = tuple[float, float] | None


def comparison(results: Result | Sequence[Result]) -> Figure:
    """Every state with all estimates on the left, the size of the errors on the right.

    Errors are drawn as the largest ``|xhat - x|`` in a moving window of the length of the metrics' moving
    average, on a logarithmic axis: noisy errors cross zero so often that they hide each other otherwise.

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
    with styled():
        figure, axes = _grid(len(states), 2, width=7.2, height=1.9 * len(states) + 0.5, share=True)
        for i, name in enumerate(states):
            _draw_state(axes[i][0], several, actors, name, None)
            _draw_magnitude(axes[i][1], actors, name, None)
        return _finished(figure, axes, several, several[0].title if len(several) == 1 else None)


def draw(results: Result | Sequence[Result], figure: FigureBlock, name: str = "figure") -> Figure:
    """A figure of the configuration's ``figures`` block.

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
    several = _several(results)
    known = names_of(several)
    check({name: figure}, known.states, known.outputs, known.observers, known.span)
    actors, panels = cast(several), figure.panels
    alone = [[a for a in actors if a.among(p.observers)] for p in panels]
    differ = len({tuple(a.order for a in shown) for shown in alone}) > 1
    with styled():
        made, axes = _grid(
            len(panels), 1, width=figure.width, height=figure.height or 2.2 * len(panels),
            share=len({p.window for p in panels}) == 1,
        )
        for row, panel, shown in zip(axes, panels, alone, strict=True):
            _draw_panel(row[0], several, shown, panel)
            title = panel.title
            if title is None and differ and len(shown) == 1 and panel.output is None:
                title = shown[0].text
            if title:
                row[0].set_title(paragraph(title, figure.width))
        return _finished(made, axes, several, figure.title)


def _several(results: Result | Sequence[Result]) -> list[Result]:
    several = [results] if isinstance(results, Result) else list(results)
    if not several:
        raise ValueError("a figure needs at least one result")
    return several


def _draw_panel(ax: Axes, results: Sequence[Result], actors: Sequence[Actor], panel: Panel) -> None:
    if panel.error is not None:
        _draw_error(ax, actors, panel.error, panel.window)
    elif panel.state is not None:
        _draw_state(ax, results, actors, panel.state, panel.window, samples=panel.measurements)
    elif panel.output is not None:
        _draw_output(ax, results, panel.output, panel.window)
    if panel.window is not None:
        ax.set_xlim(panel.window)
    if panel.limits is not None:
        ax.set_ylim(panel.limits)


def _draw_state(
    ax: Axes, results: Sequence[Result], actors: Sequence[Actor], name: str, window: _Window, *, samples: bool = False
) -> None:
    own = [r for r in results if name in r.states]
    truths = _distinct([data.inside(Curve(r.time, r.x[:, r.states.index(name)]), window) for r in own])
    dots = _samples(ax, results, name, window) if samples else []
    healthy, lost = _draw_estimates(ax, actors, name, window, lambda xhat, x: xhat)
    for truth in truths:
        _line(ax, truth, **TRUTH)
    _limit(ax, data.state_limits([c.v for c in truths] + dots, healthy, lost))
    ax.set_ylabel(f"${symbol(name)}$" + (rf", ${symbol(name, hat=True)}$" if actors else "") + _unit(results, name))


def _draw_error(ax: Axes, actors: Sequence[Actor], name: str, window: _Window) -> None:
    ax.axhline(0, color="black", linewidth=0.5, zorder=1)
    healthy, lost = _draw_estimates(ax, actors, name, window, lambda xhat, x: xhat - x)
    _limit(ax, data.error_limits(healthy, lost))
    ax.set_ylabel(f"${symbol(name, hat=True)} - {symbol(name)}$" + _unit([a.result for a in actors], name))


def _draw_magnitude(ax: Axes, actors: Sequence[Actor], name: str, window: _Window) -> None:
    ax.set_yscale("log")
    healthy, lost = _draw_estimates(ax, actors, name, window, lambda xhat, x: np.abs(xhat - x), smooth=True)
    _limit(ax, data.magnitude_limits(healthy, lost))
    ax.set_ylabel(f"$|{symbol(name, hat=True)} - {symbol(name)}|$" + _unit([a.result for a in actors], name))


def _draw_estimates(
    ax: Axes, actors: Sequence[Actor], name: str, window: _Window,
    of: Callable[[np.ndarray, np.ndarray], np.ndarray], *, smooth: bool = False,
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Lines of all observers; the values of the sound ones and of the diverged ones."""
    healthy: list[np.ndarray] = []
    lost: list[np.ndarray] = []
    for actor in actors:
        result, observer = actor.result, actor.observer
        if name not in result.states:
            continue
        column = result.states.index(name)
        curve = data.finite(result.time, of(observer.xhat[:, column], result.x[:, column]))
        if smooth:
            curve = data.envelope(curve, _points(result))
        curve = data.inside(curve, window)
        colour, dashes = actor.look
        _line(ax, curve, color=colour, linestyle=dashes, label=actor.text, zorder=3 - 1e-3 * actor.order)
        (healthy if observer.diverged_at is None else lost).append(curve.v)
    return healthy, lost


def _points(result: Result) -> int:
    """Points of the output grid in the metrics' moving average."""
    if result.time.size < 2:
        return 1
    step = float(result.time[1] - result.time[0])
    return 2 * round(float(result.windows.get("average", 0.01 * (result.time[-1] - result.time[0]))) / step / 2) + 1


def _draw_output(ax: Axes, results: Sequence[Result], name: str, window: _Window) -> None:
    own = [r for r in results if name in r.outputs]
    dots = _samples(ax, results, name, window)
    truths = _distinct([data.inside(Curve(r.time, r.y[:, r.outputs.index(name)]), window) for r in own])
    for truth in truths:
        _line(ax, truth, **TRUTH)
    _limit(ax, data.state_limits([c.v for c in truths] + dots, [], []))
    ax.set_ylabel(("$y$" if name in own[0].states else f"${symbol(name)}$") + _unit(results, name))


def _samples(ax: Axes, results: Sequence[Result], name: str, window: _Window) -> list[np.ndarray]:
    """Measurements at their arrival: dots, or a line where there is one at every point of the output grid."""
    drawn = []
    for result in results:
        if name not in result.outputs:
            continue
        t, y = result.measurements.time, result.measurements.y[:, result.outputs.index(name)]
        known = np.isfinite(y)
        if window is not None:
            known &= (t >= window[0]) & (t <= window[1])
        t, y = t[known], y[known]
        if t.size == 0:
            continue
        dense = _dense(t, result.time)
        if np.any(dense):
            for piece in np.split(np.arange(t.size), np.flatnonzero(np.diff(dense.astype(int))) + 1):
                if dense[piece[0]]:
                    _line(ax, Curve(t[piece], y[piece]), linewidth=0.5, **SAMPLES)
        if not np.all(dense):
            ax.plot(t[~dense], y[~dense], linestyle="none", marker="o", markersize=2.2, markeredgewidth=0, **SAMPLES)
        drawn.append(y)
    return drawn


def _dense(t: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Which of the times lie as close to a neighbour as the output grid."""
    if t.size < 2 or grid.size < 2:
        return np.zeros(t.size, dtype=bool)
    close = np.diff(t) <= 1.001 * (grid[1] - grid[0])
    return np.concatenate([close[:1], close]) | np.concatenate([close, close[-1:]])


def _distinct(curves: Sequence[Curve]) -> list[Curve]:
    """Truths of several runs, the same one once."""
    found: list[Curve] = []
    for curve in curves:
        if not any(np.array_equal(curve.t, c.t) and np.array_equal(curve.v, c.v) for c in found):
            found.append(curve)
    return found


def _line(ax: Axes, curve: Curve, **how: Any) -> None:
    ax.plot(*data.thinned(curve), **how)


def _limit(ax: Axes, limits: tuple[float, float] | None) -> None:
    if limits is not None:
        ax.set_ylim(limits)


def _unit(results: Sequence[Result], name: str) -> str:
    return unit(next((r.units[name] for r in results if r.units.get(name)), ""))


def _grid(rows: int, columns: int, *, width: float, height: float, share: bool) -> tuple[Figure, list[list[Axes]]]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False, sharex=share)
    return figure, [list(row) for row in axes]


def _finished(figure: Figure, axes: list[list[Axes]], results: Sequence[Result], title: str | None) -> Figure:
    """Time axes and legend, which need to know all panels."""
    from matplotlib.ticker import AutoMinorLocator, LogLocator

    start, end = min(float(r.time[0]) for r in results), max(float(r.time[-1]) for r in results)
    label = "time" + unit(next((r.units["time"] for r in results if r.units.get("time")), ""))
    for i, row in enumerate(axes):
        for ax in row:
            if ax.get_autoscalex_on() and end > start:
                ax.set_xlim(start, end)
            ax.xaxis.set_minor_locator(AutoMinorLocator())
            if ax.get_yscale() == "linear":
                ax.yaxis.set_minor_locator(AutoMinorLocator())
            else:
                ax.yaxis.set_major_locator(LogLocator(numticks=6))
            if i == len(axes) - 1 or not ax.get_shared_x_axes().joined(ax, axes[-1][0]):
                ax.set_xlabel(label)
    figure.align_ylabels([ax for row in axes for ax in row])
    _legend(figure, axes, paragraph(title, figure.get_figwidth()) if title else None)
    figure.draw_without_rendering()  # makes the ticks now, in our style, not when somebody saves
    return figure


def _legend(figure: Figure, axes: list[list[Axes]], title: str | None) -> None:
    """One legend above all panels, in as many columns as fit."""
    handles: dict[str, Any] = {}
    for row in axes:
        for ax in row:
            for handle, text in zip(*ax.get_legend_handles_labels(), strict=True):
                handles.setdefault(text, handle)
    first = [text for text in (TRUTH["label"], SAMPLES["label"]) if text in handles]
    texts = first + [text for text in handles if text not in first]
    room = figure.get_figwidth() * figure.dpi
    for columns in range(len(texts), 0, -1):
        legend = figure.legend(
            [handles[text] for text in texts], texts, ncols=columns, title=title, loc="outside upper center"
        )
        if columns == 1 or legend.get_window_extent().width <= room:
            return
        legend.remove()


__all__ = ["comparison", "draw", "words"]
