"""Marks of what the limits of a panel cut off: an arrow at its edge, with the value that is out of sight."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex

from hgorun.figures.style import ENDLESS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SIZE = 7.0  # points
_ROW, _LETTER = 1.15 * _SIZE, 0.52 * _SIZE  # points: height of a row, about the width of a letter
_ROWS = 6  # of marks, one below the other
_TOUCH = 1e-6  # points
_APART, _MOST = 14.0, 5  # points between marks of one colour; of more without a value the line is cut all along
_UNSEEN = 0.01  # of an axis' range: so much is inside the line that the edge is drawn with
Side = Literal["top", "bottom"]
_SIDES: dict[Side, float] = {"top": 1.0, "bottom": -1.0}
_ARROWS = {"top": "↑", "bottom": "↓"}


@dataclass(frozen=True)
class Cut:
    """Where a line, or a band, leaves a panel furthest.

    Attributes
    ----------
    side : {"top", "bottom"}
    x, value : float
        The place on the horizontal axis, and the value there.
    colour : str
    band : bool
    told : bool
        Whether the value is written: of one colour and side that of the furthest is.
    """

    side: Side
    x: float
    value: float
    colour: str
    band: bool = False
    told: bool = True

    @property
    def text(self) -> str:
        if np.isinf(self.value):  # of members that are lost
            return "∞ (band)"
        number = f"{self.value:.3g}".replace("e+0", "e").replace("e+", "e").replace("e-0", "e-").replace("-", "−")
        return f"{number} (band)" if self.band else number


def cuts(ax: Axes) -> list[Cut]:
    """Of all lines of one colour, or of its bands if no line leaves, the furthest beyond each edge, the furthest first.

    A logarithmic axis has no lower edge that a peak could pass: errors that are small for a moment leave it.
    """
    found: dict[tuple[str, str], Cut] = {}
    for x, y, colour, band in _drawn(ax):
        for one in _of_points(ax, x, y, colour, band=band):
            known = found.get((one.side, one.colour))
            if known is None or (known.band, abs(one.value)) > (band, abs(known.value)):
                found[one.side, one.colour] = one
    return sorted(found.values(), key=lambda one: -abs(one.value))


def further_cuts(ax: Axes, known: Sequence[Cut], apart: float) -> list[Cut]:
    """Where else lines leave, each time furthest: the furthest first, none close to another one of its colour.

    Nothing of a line that leaves so often that it is seen to be cut all along.

    Parameters
    ----------
    known : sequence of Cut
        What has marks already.
    apart : float
        In units of the horizontal axis as it is drawn, from 0 to 1.
    """
    further: list[Cut] = []
    times: Counter[tuple[str, str]] = Counter()
    for x, y, colour, band in _drawn(ax):
        for side in () if band else _SIDES:
            beyond = _beyond(ax, x, y, side)
            stretches = np.cumsum(np.diff(beyond, prepend=False))[beyond]
            t, v, at = x[beyond], y[beyond], _fractions(ax, x[beyond])
            left = np.ones(t.size, dtype=bool)
            for one in (*known, *further):
                if (one.side, one.colour) == (side, colour):
                    left &= np.abs(at - _fractions(ax, np.array([one.x]))) > apart
                    left &= ~np.isin(stretches, stretches[t == one.x])
            while left.any():
                k = int(np.argmax(np.where(left, np.abs(v), -np.inf)))
                further.append(Cut(side, float(t[k]), float(v[k]), colour, told=False))
                times[side, colour] += 1
                left &= (np.abs(at - at[k]) > apart) & (stretches != stretches[k])
    few = [one for one in further if times[one.side, one.colour] <= _MOST]
    return sorted(few, key=lambda one: -abs(one.value))


def _beyond(ax: Axes, x: np.ndarray, y: np.ndarray, side: str) -> np.ndarray:
    """Which points are out of sight at an edge; a logarithmic axis has an upper one alone."""
    (left, right), (low, high) = sorted(ax.get_xlim()), sorted(ax.get_ylim())
    seen = (x >= left) & (x <= right)
    logarithmic = ax.get_yscale() == "log"
    room = high * ((high / low) ** _UNSEEN - 1) if logarithmic else _UNSEEN * (high - low)
    if side == "top":
        return np.asarray(seen & (y > high + room))
    return np.asarray(seen & (y < low - room) & (not logarithmic))


def _drawn(ax: Axes) -> Iterator[tuple[np.ndarray, np.ndarray, str, bool]]:
    """The points of lines and the corners of bands, but of those across the panel, such as the line at zero."""
    for line in ax.lines:
        if line.get_transform() == ax.transData:
            x, y = np.array(line.get_data(), dtype=float)
            yield x, np.where(np.isfinite(y), y, np.nan), to_hex(line.get_color()), False
    for band in ax.collections:
        if isinstance(band, PolyCollection) and band.get_transform() == ax.transData and band.get_paths():
            x, y = np.concatenate([path.vertices for path in band.get_paths()]).T
            if band.get_gid() == ENDLESS:
                far = np.abs(y) == np.max(np.abs(y))
                y = np.where(far, np.copysign(np.inf, y), y)
            yield x, y, to_hex(np.asarray(band.get_facecolor())[0]), True


def _of_points(ax: Axes, x: np.ndarray, y: np.ndarray, colour: str, *, band: bool) -> list[Cut]:
    found = []
    for side, sign in _SIDES.items():
        beyond = _beyond(ax, x, y, side)
        if beyond.any():
            k = int(np.argmax(np.where(beyond, sign * y, -np.inf)))
            found.append(Cut(side, float(x[k]), float(y[k]), colour, band))
    return found


@dataclass(frozen=True)
class _Place:
    """Where a mark stands: its row from the edge, how far beside the cut, and whether its arrow is at its right end."""

    cut: Cut
    row: int
    shift: float  # points
    turned: bool
    more: int = 0  # cuts without room, which this mark tells of

    @property
    def text(self) -> str:
        return f"{self.cut.text}, {self.more} more" if self.more else self.cut.text


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
    marks = [_mark(ax, place) for side in _SIDES for place in _places(ax, side, width, height)]
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
    while any(place.row >= rows for place in _places(ax, "top", width, height)):
        rows += 1
        taken = (rows + 0.5) * _ROW / height
        ax.set_ylim(low, low * (high / low) ** (1.0 / (1.0 - taken)))


def _most(height: float) -> int:
    """Rows of marks at an edge of axes so many points high, half of which are left for the other edge."""
    return min(_ROWS, max(int(height / 2 / _ROW), 1))


def _places(ax: Axes, side: str, width: float, height: float) -> list[_Place]:
    rows: list[list[tuple[float, float]]] = [[] for _ in range(_most(height))]
    found: list[_Place] = []
    told = cuts(ax)
    here = [one for one in told if one.side == side]
    others = [one for one in further_cuts(ax, told, _APART / width) if one.side == side]
    for one in (*here, *others):
        at = float(_fractions(ax, np.array([one.x]))[0]) * width
        length = (len(one.text) + 2) * _LETTER if one.told else _SIZE
        turned = at + length > width  # it would leave the panel on the right
        start = at - length if turned else at
        free = [
            (abs(left - start), i, left)
            for i, row in enumerate(rows)
            for left in _free(row, start, length)
            if left == start or (one.told and 0 <= left <= width - length)
        ]
        if free:
            _, i, left = min(free)
            rows[i].append((left, left + length))
            found.append(_Place(one, i, left - start, turned))
    written = [place for place in found if place.cut.told]
    if len(written) < len(here):
        found[len(written) - 1] = replace(written[-1], more=len(here) - len(written))
    return found


def _free(row: list[tuple[float, float]], start: float, length: float) -> Iterator[float]:
    """Where a mark of this length may begin in a row: at its start, or beside what stands there."""
    for left in (start, *(high for _, high in row), *(low - length for low, _ in row)):
        if all(left + length <= low + _TOUCH or left >= high - _TOUCH for low, high in row):
            yield left


def _fractions(ax: Axes, x: np.ndarray) -> np.ndarray:
    """How far values of the horizontal axis are from its left end, in units of its length."""
    places = ax.transData.transform(np.column_stack([[*ax.get_xlim(), *x], np.ones(x.size + 2)]))[:, 0]
    return np.asarray((places[2:] - places[0]) / (places[1] - places[0]))


def _mark(ax: Axes, place: _Place) -> Any:
    one, turned = place.cut, place.turned
    top = one.side == "top"
    how: dict[str, Any] = {
        "xy": (one.x, 1.0 if top else 0.0),
        "xycoords": ax.get_xaxis_transform(),
        "textcoords": "offset points",
        "va": "top" if top else "bottom",
        "ha": "right" if turned else "left",
        "fontsize": _SIZE,
        "zorder": 8,
        "annotation_clip": False,
    }
    down = -(1.0 + _ROW * place.row) if top else 1.0 + _ROW * place.row
    step = -_SIZE if turned else _SIZE
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
