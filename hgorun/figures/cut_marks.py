"""Marks of what the limits of a panel cut off: an arrow at its edge, with the value that is out of sight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from hgorun.figures.cut_places import EDGE, ROW, SIZE, Place, places
from hgorun.figures.cuts import SIDES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ARROWS = {"top": "↑", "bottom": "↓"}


def mark_cuts(ax: Axes, width: float, height: float) -> list[Any]:
    """Draw an arrow with its value for every cut, one below the other where they would hide each other.

    Where a line leaves again at another time there is an arrow alone, up to five. Where all rows are full they stand
    side by side. If there is no room left, the last one says how many are not drawn.

    Parameters
    ----------
    ax : Axes
        With its limits.
    width, height : float
        Of the axes, in points.

    Returns
    -------
    list of matplotlib.text.Annotation
        The values.
    """
    marks = [_mark(ax, place) for side in SIDES for place in places(ax, side, width, height)]
    return [value for value in marks if value is not None]


def make_room(ax: Axes, width: float, height: float) -> None:
    """Raise the upper limit of a logarithmic axis until the marks at it stand above all that it has shown.

    Parameters
    ----------
    ax : Axes
    width, height : float
        Of the axes, in points.
    """
    (low, high), rows = ax.get_ylim(), 0
    while any(place.row >= rows for place in places(ax, "top", width, height)):
        rows += 1
        taken = (rows + 0.5) * ROW / height
        ax.set_ylim(low, low * (high / low) ** (1.0 / (1.0 - taken)))


def _mark(ax: Axes, place: Place) -> Any:
    one, turned = place.cut, place.turned
    top = one.side == "top"
    how: dict[str, Any] = {
        "xy": (one.x, 1.0 if top else 0.0),
        "xycoords": ax.get_xaxis_transform(),
        "textcoords": "offset points",
        "va": "top" if top else "bottom",
        "ha": "right" if turned else "left",
        "fontsize": SIZE,
        "zorder": 8,
        "annotation_clip": False,
    }
    down = -(EDGE + ROW * place.row) if top else EDGE + ROW * place.row
    step = -SIZE if turned else SIZE
    start = place.shift + (-1.0 if turned else 1.0)
    arrow = ax.annotate(_ARROWS[one.side], xytext=(start, down), color=one.colour, fontweight="bold", **how)
    value = ax.annotate(place.text, xytext=(start + step, down), **how) if one.told else None
    for text in (arrow, value) if value is not None else (arrow,):
        text.set_in_layout(False)
        text.set_path_effects(halo("white"))
    return value


def halo(colour: Any) -> list[Any]:
    """A rim around letters in the colour of the page: they are read on a curve, and hide less of it than a box."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=1.6, foreground=colour)]


def mark_all(axes: Sequence[Axes], dpi: float) -> None:
    """Mark what the limits of these axes cut off, once the layout is known."""
    for ax in axes:
        mark_cuts(ax, *_size(ax, dpi))


def make_room_all(axes: Sequence[Axes], dpi: float) -> None:
    """Raise the upper limits of logarithmic axes for their marks, once the layout is known."""
    for ax in axes:
        make_room(ax, *_size(ax, dpi))


def _size(ax: Axes, dpi: float) -> tuple[float, float]:
    """Width and height in points."""
    extent = ax.get_window_extent()
    return extent.width * 72.0 / dpi, extent.height * 72.0 / dpi
