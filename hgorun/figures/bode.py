"""Bode magnitude plots from measurement noise to the estimates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hgorun.figures.actors import cast, texts
from hgorun.figures.layout import TOP, finished, grid
from hgorun.figures.looks import looks
from hgorun.figures.style import styled
from hgorun.result.data import ResultData
from hgorun.result.theory import Bode
from hgorun.tables.typeset import symbol, unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH, _ROW = 7.2, 1.8
_DECADES = 10  # that an axis shows at most


def bode_figure(data: Bode, result: ResultData) -> Figure:
    """One panel a state with all observers; the configuration's own sinusoids are thin vertical lines.

    Parameters
    ----------
    data : Bode
    result : ResultData
        Whose observers they are.

    Returns
    -------
    matplotlib.figure.Figure
    """
    actors = [a for a in cast([result]) if a.label in data.magnitude]
    look = looks([actors], texts(actors, {}))
    rate = result.units.get("time", "")
    with styled():
        figure, axes = grid(len(data.states), 1, _WIDTH, _ROW * len(data.states) + TOP, share=True)
        for i, (ax, name) in enumerate(zip(axes, data.states, strict=True)):
            ax.set_xscale("log")
            ax.set_yscale("log")
            for omega in data.own:
                ax.axvline(omega, color="0.7", linewidth=0.6, zorder=1, label="_own")
            high, low = 0.0, float("inf")
            for actor in actors:
                own, values = look[actor.order], data.magnitude[actor.label][:, i]
                seen = np.where(values > 0, values, np.nan)  # what noise does not reach has no logarithm
                ax.plot(data.omega, seen, color=own.colour, linestyle=own.dashes, label=own.text)
                high, low = max(high, float(values.max())), min(low, float(values.min()))
            if high > 0:
                ax.set_ylim(max(low, high * 10.0**-_DECADES) / 2, high * 2)
            ax.set_xlim(data.omega[0], data.omega[-1])
            ax.set_xlabel(r"$\omega$" + unit(f"rad/{rate}" if rate else ""))
            ax.set_ylabel(rf"$v \rightarrow {symbol(name, hat=True)}$")
        title = "from measurement noise to the estimates, linearised at the end of the run"
        return finished(figure, axes, 1, title, grow=True)
