"""What the limits of a panel cut off: where lines and bands leave it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex

from hgorun.figures.style import ENDLESS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST = 5  # marks of one colour without a value: of more the line is cut all along
_UNSEEN = 0.01  # of an axis' range: so much is inside the line that the edge is drawn with
Side = Literal["top", "bottom"]
SIDES: dict[Side, float] = {"top": 1.0, "bottom": -1.0}


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

    @property
    def far(self) -> float:
        """What is the larger the further it lies beyond its edge: of cuts at one edge, whatever signs they have."""
        return SIDES[self.side] * self.value


def cuts(ax: Axes) -> list[Cut]:
    """Of all lines of one colour, or of its bands if no line leaves, the furthest beyond each edge; the furthest first.

    A logarithmic axis has no lower edge that a peak could pass: errors that are small for a moment leave it.
    """
    found: dict[tuple[str, str], Cut] = {}
    for x, y, colour, band in _drawn(ax):
        for one in _of_points(ax, x, y, colour, band=band):
            known = found.get((one.side, one.colour))
            if known is None or (known.band, one.far) > (band, known.far):
                found[one.side, one.colour] = one
    return sorted(found.values(), key=lambda one: -one.far)


def further_cuts(ax: Axes, known: Sequence[Cut], apart: float) -> list[Cut]:
    """Where else lines leave, each time furthest: that of an edge first, none close to another one of its colour.

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
        for side, sign in () if band else SIDES.items():
            beyond = _beyond(ax, x, y, side)
            stretches = np.cumsum(np.diff(beyond, prepend=False))[beyond]
            t, v, at = x[beyond], y[beyond], fractions(ax, x[beyond])
            left = np.ones(t.size, dtype=bool)
            for one in (*known, *further):
                if (one.side, one.colour) == (side, colour):
                    left &= np.abs(at - fractions(ax, np.array([one.x]))) > apart
                    left &= ~np.isin(stretches, stretches[t == one.x])
            while left.any():
                k = int(np.argmax(np.where(left, sign * v, -np.inf)))
                further.append(Cut(side, float(t[k]), float(v[k]), colour, told=False))
                times[side, colour] += 1
                left &= (np.abs(at - at[k]) > apart) & (stretches != stretches[k])
    few = [one for one in further if times[one.side, one.colour] <= _MOST]
    return sorted(few, key=lambda one: -one.far)


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
    for side, sign in SIDES.items():
        beyond = _beyond(ax, x, y, side)
        if beyond.any():
            k = int(np.argmax(np.where(beyond, sign * y, -np.inf)))
            found.append(Cut(side, float(x[k]), float(y[k]), colour, band))
    return found


def fractions(ax: Axes, x: np.ndarray) -> np.ndarray:
    """How far values of the horizontal axis are from its left end, in units of its length."""
    places = ax.transData.transform(np.column_stack([[*ax.get_xlim(), *x], np.ones(x.size + 2)]))[:, 0]
    return np.asarray((places[2:] - places[0]) / (places[1] - places[0]))
