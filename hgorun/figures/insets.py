"""Details of a panel, enlarged inside it, where they cover least of what is drawn."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from hgorun.config.study import Inset
from hgorun.figures.style import INSET, INSET_FRAME

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Place = tuple[float, float, float, float]

_WIDTH, _HEIGHT = 0.42, 0.42
# Left and bottom of the places tried, the usual one first; numbers at its axes need room on the left and below.
_CORNERS = ((0.55, 0.5), (0.09, 0.5), (0.55, 0.14), (0.09, 0.14))
_ABOVE: Place = (0.55, 0.56, _WIDTH, 0.4)
_LEFT, _BELOW, _AROUND = 0.06, 0.1, 0.02  # of the panel, what an inset takes beside its own axes
_POINTS = 400  # along each line, where it is looked for
_COVERED = 4  # points of all lines that an inset may hide


def make_room(ax: Axes, inset: Inset, *, free: bool) -> Place:
    """Where an inset goes: the place it is given, or the corner with the least in it.

    Parameters
    ----------
    ax : Axes
        With everything that is drawn, and its limits.
    inset : Inset
    free : bool
        Whether the vertical axis may grow: then it does where every corner is taken, and the inset stands above the
        lines.
    """
    if inset.place is not None:
        return inset.place
    counts = [_covered(ax, (*corner, _WIDTH, _HEIGHT)) for corner in _CORNERS]
    best = int(np.argmin(counts))
    if counts[best] > _COVERED and free and ax.get_yscale() == "linear":
        low, high = ax.get_ylim()
        ax.set_ylim(low, low + (high - low) / (_ABOVE[1] - _BELOW - _AROUND))
        return _ABOVE
    return (*_CORNERS[best], _WIDTH, _HEIGHT)


def _covered(ax: Axes, place: Place) -> int:
    """How many points, evenly spaced along all lines, an inset would hide."""
    left, bottom, width, height = place
    found = 0
    start, end = ax.get_xlim()
    for line in ax.lines:
        if line.get_transform() != ax.transData:
            continue
        t, v = (np.asarray(values, dtype=float) for values in line.get_data())
        known = np.isfinite(v)
        if known.sum() < 2:
            continue
        at = np.linspace(start, end, _POINTS)
        at = at[(at >= t[known][0]) & (at <= t[known][-1])]
        points = ax.transData.transform(np.column_stack([at, np.interp(at, t[known], v[known])]))
        x, y = ax.transAxes.inverted().transform(points).T
        inside = (x > left - _LEFT) & (x < left + width + _AROUND) & (y > bottom - _BELOW)
        found += int(np.sum(inside & (y < bottom + height + _AROUND)))
    return found


def draw_inset(ax: Axes, inset: Inset, place: Place, draw: Callable[[Axes], None]) -> None:
    """The panel's lines once more, in the inset's window.

    Parameters
    ----------
    draw : callable
        Draws them into the axes that it is given.
    """
    inner = ax.inset_axes(place, zorder=7)
    draw(inner)
    inner.set_ylabel("")
    inner.set_xlim(inset.window)
    if inset.limits is not None:
        inner.set_ylim(inset.limits)
    inner.tick_params(which="both", **INSET)
    ax.indicate_inset_zoom(inner, **INSET_FRAME)
