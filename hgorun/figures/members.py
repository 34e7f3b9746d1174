"""Trajectories of the members of a study's ensemble in one panel: a line for each of them, or how they are spread."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hgorun.config.study import Panel
from hgorun.ensemble.collected.collected import Floats
from hgorun.figures.bands import POINTS, banded, truth_of
from hgorun.figures.data import Curve, error_limits, magnitude_limits, state_limits, thinned
from hgorun.figures.ensemble import drawable
from hgorun.figures.followed import MembersData
from hgorun.figures.looks import Look
from hgorun.figures.lost import say_above
from hgorun.figures.page import AS_IT_IS
from hgorun.figures.style import TRUTH
from hgorun.tables.typeset import both, error_of, symbol, unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_NAMED = 8  # values that the legend names; of more the first and the last
_MOST_CLEAR = 20  # members whose lines are told apart
_COLOURS = "viridis"
_ENDS = {"light": (0.0, 0.85), "dark": (0.36, 1.0)}  # of what is seen of the colours on a page


def draw_members(
    ax: Axes, data: MembersData, labels: Mapping[str, int], looks: Mapping[int, Look], panel: Panel, style: str
) -> None:
    """Draw a state, its error or the size of that, of the observers shown.

    Parameters
    ----------
    labels : mapping of str to int
        The observers shown: their places, keys of ``looks``.
    style : {"light", "dark"}
        Of the page.
    """
    name = str(panel.state or panel.error or panel.magnitude)
    kept, members, j = data.kept, data.members, data.members.states.index(name)
    points = _shown(kept.time, panel.window)
    t, x = kept.time[points], kept.x[:, points, j]
    own = {label: _of(panel, kept.xhat[:, members.observers.index(label), points, j], x) for label in labels}
    if panel.magnitude is not None:
        ax.set_yscale("log")
        ax.set_ylim(1e-16, 1.0)  # stays when there is no error to show
    elif panel.error is not None:
        ax.axhline(0, color="black", linewidth=0.5, zorder=1)
    as_lines = (panel.members or ("bands" if "seeds" in data.kind else "lines")) == "lines"
    theirs = [looks[labels[label]] for label in own]
    drawn: list[Floats] = []
    if as_lines:
        for values, look in zip(own.values(), theirs, strict=True):
            drawn += _lines(ax, data, t, values, look, len(own) == 1, style)
    else:
        step, beside = max(t.size // POINTS, 1), [x] if panel.state is not None else []
        thin = [values[:, ::step] for values in own.values()]
        drawn = banded(ax, t[::step], thin, theirs, signed=panel.magnitude is None, beside=beside)
    truths = _truths(ax, t, x, as_lines) if panel.state is not None else []
    _say_lost(ax, members.sound[kept.member][:, [members.observers.index(label) for label in labels]])
    if panel.state is not None:
        limits = state_limits(truths, drawn, [])
    else:
        limits = (error_limits if panel.error is not None else magnitude_limits)(drawn, [])
    if limits is not None:
        ax.set_ylim(limits)
    ax.set_xlim(panel.window or data.span)
    units, error = members.units, error_of(name)
    said = {"state": both(name) if own else symbol(name), "error": error, "magnitude": f"|{error}|"}
    ax.set_ylabel(f"${said[panel.subject]}$" + unit(units.get(name, "")))
    ax.set_xlabel("time" + unit(units.get("time", "")))


def _say_lost(ax: Axes, sound: NDArray[np.bool_]) -> None:
    """Say above a panel how many members have lost an estimate that it shows, where there are such."""
    lost = int(np.sum(~sound.all(axis=1)))
    if lost:
        say_above(ax, f"{lost} of {len(sound)} members lost")


def _shown(time: Floats, window: tuple[float, float] | None) -> slice:
    """The points in a window of time, with one more at either end so that lines reach the edges."""
    if window is None:
        return slice(None)
    return slice(max(int(np.searchsorted(time, window[0])) - 1, 0), int(np.searchsorted(time, window[1], "right")) + 1)


def _of(panel: Panel, xhat: Floats, x: Floats) -> Floats:
    """What is shown of estimates, shape (members, times)."""
    if panel.state is not None:
        return xhat
    return xhat - x if panel.error is not None else np.abs(xhat - x)


def _lines(ax: Axes, data: MembersData, t: Floats, values: Floats, look: Look, alone: bool, style: str) -> list[Floats]:
    """A line for every member: of one observer coloured by what is varied, of several each in its own colour."""
    varied = data.values[data.kept.member]
    known = np.unique(varied) if data.name else np.empty(0)
    named = set(known.tolist() if known.size <= _MOST_NAMED else known[[0, -1]].tolist()) if alone else set()
    told = False
    thin: dict[str, Any] = {"linewidth": 0.9} if len(values) <= _MOST_CLEAR else {"linewidth": 0.6, "alpha": 0.4}
    for one, value in zip(values, varied, strict=True):
        how: dict[str, Any] = {"color": look.colour, "linestyle": look.dashes, "label": "_" if told else look.text}
        if alone and known.size:
            place = float(np.searchsorted(known, value)) / max(known.size - 1, 1)
            how = {"color": _colour(place, style), "label": "_", "gid": AS_IT_IS}
            if float(value) in named:
                how["label"] = f"${symbol(data.name)} = {value:g}$"
                named.discard(float(value))
        ax.plot(*thinned(Curve(t, drawable(one))), zorder=3, **thin, **how)
        told = True
    return [one[np.isfinite(one)] for one in values]


def _colour(place: float, style: str) -> Any:
    """Along the scale of colours, from 0 to 1."""
    from matplotlib import colormaps

    first, last = _ENDS[style]
    return colormaps[_COLOURS](first + (last - first) * place)


def _truths(ax: Axes, t: Floats, x: Floats, as_lines: bool) -> list[Floats]:
    """The truth, once where members have the same one; of several each, or their median; what is drawn."""
    one = bool(np.all(x == x[:1]))
    shown = x[:1] if one else x if as_lines else np.median(x, axis=0)[None]
    for k, values in enumerate(shown):
        how = truth_of(one or as_lines) if k == 0 else {**TRUTH, "label": "_"}
        ax.plot(*thinned(Curve(t, drawable(values))), **how)
    return [values[np.isfinite(values)] for values in shown]
