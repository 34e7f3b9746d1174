"""Bode magnitude plots from measurement noise to the estimates."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from hgorun.figures.actors import cast, texts
from hgorun.figures.layout import TOP, finished, grid
from hgorun.figures.looks import looks
from hgorun.figures.page import LIGHT, Page, on_page
from hgorun.figures.style import styled
from hgorun.result.records.data import ResultData
from hgorun.result.records.theory import Bode
from hgorun.tables.typeset import estimate_of, unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ROW = 1.8
_DECADES = 10  # that an axis shows at most
_NOISE = "noise of this run"
_SYMBOL = "v"  # of measurement noise, where no state is called so


def bode_figure(data: Bode, result: ResultData, page: Page = LIGHT) -> Figure:
    """One panel a state with all observers; the configuration's own sinusoids are thin vertical lines.

    Parameters
    ----------
    data : Bode
    result : ResultData
        Whose observers they are.
    page : Page

    Returns
    -------
    matplotlib.figure.Figure
    """
    actors = [a for a in cast([result]) if a.label in data.magnitude]
    look = looks([actors], texts(actors, {}))
    rate = result.units.get("time", "")
    noise = r"\mathrm{noise}" if _SYMBOL in result.states else _SYMBOL
    with styled():
        figure, axes = grid(len(data.states), 1, page.width, _ROW * len(data.states) + TOP, share=True)
        for i, (ax, name) in enumerate(zip(axes, data.states, strict=True)):
            ax.set_xscale("log")
            ax.set_yscale("log")
            for k, omega in enumerate(data.own):
                ax.axvline(omega, color="0.7", linewidth=0.6, zorder=1, label="_" if i or k else _NOISE)
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
            ax.set_ylabel(rf"${noise} \rightarrow {estimate_of(name)}$" + unit(_gain_unit(result, name)))
        title = "from measurement noise to the estimates, linearised at the end of the run"
        return on_page(finished(figure, axes, 1, title, grow=True), page.style)


def _gain_unit(result: ResultData, state: str) -> str:
    """What a gain from the output to a state is measured in; nothing where there are several outputs, or no units."""
    measured = result.units.get(result.outputs[0], "") if len(result.outputs) == 1 else ""
    estimated = result.units.get(state, "")
    if not measured or not estimated or measured == estimated:
        return ""
    return "/".join(f"({one})" if re.search(r"[^\w%°]", one) else one for one in (estimated, measured))
