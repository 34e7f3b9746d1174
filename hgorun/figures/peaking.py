"""The transient of every observer beside the one that theory bounds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from hgorun.figures.actors import cast, texts
from hgorun.figures.data import Curve, thinned
from hgorun.figures.layout import TOP, finished, grid, time_axis
from hgorun.figures.looks import looks
from hgorun.figures.style import styled
from hgorun.result.data import ResultData
from hgorun.result.theory import Transient
from hgorun.tables.typeset import symbol

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH, _ROW = 7.2, 1.8
_BOUND, _NOMINAL = (0, (3, 2)), (0, (1, 2))
_TITLE = "errors; dashed: bounds where the theorems hold; dotted: their decay where they do not"
_DECADES = 12  # that an axis shows at most
_MAX_POINTS = 2000  # points of a line: noise is a band of them


def peaking(result: ResultData, transients: Mapping[str, Transient]) -> Figure:
    """|zhat - z| on a logarithmic axis, one row a coordinate, and the theorem's bound dashed.

    Where the run does not meet what the theorem assumes the bound's nominal decay is dotted, which bounds nothing
    there. Observers that compute in other coordinates have rows of their own.

    Parameters
    ----------
    result : ResultData
    transients : mapping of str to Transient
        Of the observers that have some, by label.

    Returns
    -------
    matplotlib.figure.Figure
    """
    actors = [a for a in cast([result]) if a.label in transients]
    names = list(dict.fromkeys(name for a in actors for name in transients[a.label].names))
    look = looks([actors], texts(actors, {}))
    with styled():
        figure, axes = grid(max(len(names), 1), 1, _WIDTH, _ROW * max(len(names), 1) + TOP, share=True)
        for ax, name in zip(axes, names, strict=False):
            ax.set_yscale("log")
            drawn: list[np.ndarray] = []
            for actor in actors:
                transient = transients[actor.label]
                if name not in transient.names:
                    continue
                i = transient.names.index(name)
                own = look[actor.order]
                curves = [(transient.error[:, i], own.dashes, own.text, 1.0)]
                if transient.holds:
                    curves.append((transient.bound[:, i], _BOUND, f"{own.text}: bound", 0.8))
                elif transient.nominal is not None:
                    curves.append((transient.nominal[:, i], _NOMINAL, f"{own.text}: nominal", 0.8))
                for values, line, text, width in curves:
                    kept = np.isfinite(values) & (values > 0)
                    curve = Curve(transient.time[kept], values[kept])
                    ax.plot(*thinned(curve, _MAX_POINTS), color=own.colour, linestyle=line, label=text, linewidth=width)
                    drawn.append(curve.v if line is not _NOMINAL else curve.v[:1])
            ax.set_ylim(*_limits(drawn))
            time_axis(ax, [result], (float(result.time[0]), float(result.time[-1])))
            ax.set_ylabel(rf"$|{symbol(name, hat=True)} - {symbol(name)}|$")
        return finished(figure, axes, 1, _TITLE, grow=True)


def _limits(drawn: list[np.ndarray]) -> tuple[float, float]:
    """From what is seen of the smallest to the largest."""
    values = np.concatenate([v for v in drawn if v.size] or [np.array([1.0])])
    high = float(np.max(values))
    low = max(float(np.percentile(values, 1)), high * 10.0**-_DECADES)
    return low / 2, high * 2
