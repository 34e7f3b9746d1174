"""The transient of every observer beside the one that theory bounds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hgorun.figures.actors import cast, texts
from hgorun.figures.data import Curve, moving_maximum, thinned
from hgorun.figures.layout import TOP, finished, grid, time_axis
from hgorun.figures.looks import Look, looks
from hgorun.figures.page import LIGHT, Page, on_page
from hgorun.figures.panels import points_in_window, window_words
from hgorun.figures.scene import from_roughest
from hgorun.figures.style import styled
from hgorun.result.records.data import ResultData
from hgorun.result.records.theory import Transient
from hgorun.tables.typeset import error_of, unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ROW = 1.8
_BOUND, _NOMINAL = (0, (3, 2)), (0, (1, 2))
# Of all observers alike, each in the observer's colour: the legend has them once.
_BESIDE = {
    _BOUND: "bound of the theorem",
    _NOMINAL: "no bound of this run: that of an ideal one, without noise, delay and disturbance",
}
_DECADES = 12  # that an axis shows at most
_MAX_POINTS = 2000  # points of a line: noise is a band of them


def peaking(result: ResultData, transients: Mapping[str, Transient], page: Page = LIGHT) -> Figure:
    """|zhat - z| on a logarithmic axis, one row a coordinate, and the theorem's bound dashed.

    An error is drawn as the largest one from then on, for as long as the metrics' moving average: noisy errors cross
    zero so often that they would hide each other. A bound that falls is above that where it is above the error.

    Where the run does not meet what the theorem assumes it has no bound: dotted is that of an ideal run, which
    shows what the theorem would promise. The title names the experiment. Observers that compute in other
    coordinates have rows of their own; the caption names those without a bound.

    Parameters
    ----------
    result : ResultData
    transients : mapping of str to Transient
        Of the observers that have some, by label.
    page : Page

    Returns
    -------
    matplotlib.figure.Figure
    """
    everyone = cast([result])
    actors = [a for a in everyone if a.label in transients]
    others = [a.label for a in everyone if a.label not in transients]
    names = list(dict.fromkeys(name for a in actors for name in transients[a.label].names))
    points = points_in_window(result)
    look = looks([actors], texts(actors, {}))
    height = {order: 2 + i / len(actors) for i, order in enumerate(from_roughest(actors, look))}
    with styled():
        figure, axes = grid(max(len(names), 1), 1, page.width, _ROW * max(len(names), 1) + TOP, share=True)
        for ax, name in zip(axes, names, strict=False):
            ax.set_yscale("log")
            drawn: list[np.ndarray] = []
            for actor in actors:
                transient, own = transients[actor.label], look[actor.order]
                for (t, values), line, text, thickness in _curves(transient, name, own):
                    kept = np.isfinite(values) & (values > 0)
                    largest = moving_maximum(values[kept], points)  # of bounds too: so they stay bounds
                    how = {"color": own.colour, "linestyle": line, "label": text, "linewidth": thickness}
                    above = height[actor.order] if line is own.dashes else 3  # bounds hide nothing
                    ax.plot(*thinned(Curve(t[kept], largest), _MAX_POINTS), **how, zorder=above)
                    if line is not _NOMINAL:  # what does not hold is marked where it leaves the panel
                        drawn.append(largest)
            ax.set_ylim(*_limits(drawn))
            time_axis(ax, [result], (float(result.time[0]), float(result.time[-1])))
            ax.set_ylabel(f"$|{error_of(name)}|$" + unit(result.units.get(name, "")))
        drawn_beside = {
            _BOUND if t.holds else _NOMINAL for t in transients.values() if t.holds or t.nominal is not None
        }
        for line, text in _BESIDE.items() if names else ():
            if line in drawn_beside:
                axes[-1].plot([], [], color="0.3", linestyle=line, linewidth=0.6, label=text)
        title = f"{result.title or result.name}: {window_words('error', [result])}"
        if others:
            title += f"; not drawn, having no bound: {', '.join(others)}"
        return on_page(finished(figure, axes, 1, title, grow=True, cuts=True, room=True), page.style)


def _curves(transient: Transient, name: str, own: Look) -> list[tuple[Curve, Any, str, float]]:
    """The error of a coordinate and its bound, or what the theorem would promise: line, label and width of each."""
    if name not in transient.names:
        return []
    i = transient.names.index(name)
    curves = [(Curve(transient.time, transient.error[:, i]), own.dashes, own.text, 1.0)]
    if transient.holds:
        curves.append((Curve(transient.time, transient.bound[:, i]), _BOUND, f"_{own.text}: bound", 0.6))
    elif transient.nominal is not None:
        nominal = Curve(transient.time, transient.nominal[:, i])
        curves.append((nominal, _NOMINAL, f"_{own.text}: decay of the theorem", 0.6))
    return curves


def _limits(drawn: list[np.ndarray]) -> tuple[float, float]:
    """From what is seen of the smallest to the largest."""
    values = np.concatenate([v for v in drawn if v.size] or [np.array([1.0])])
    high = float(np.max(values))
    low = max(float(np.percentile(values, 1)), high * 10.0**-_DECADES)
    return low / 2, high * 2
