"""Where marks of cuts stand at the edges of a panel: in rows, beside each other, and where they hide few samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hgorun.figures.cuts import Cut, Side, cuts, fractions, further_cuts
from hgorun.figures.recorded import FEW

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = 7.0  # points
ROW, _LETTER = 1.15 * SIZE, 0.52 * SIZE  # points: height of a row, about the width of a letter
EDGE = 1.0  # points between the first row and the edge
_ROWS = 6  # of marks, one below the other
_TOUCH = 1e-6  # points
_APART = 14.0  # points between marks of one colour


@dataclass(frozen=True)
class Place:
    """Where a mark stands: its row from the edge, how far beside the cut, and whether its arrow is at its right end."""

    cut: Cut
    row: int
    shift: float  # points
    turned: bool
    more: int = 0  # cuts without room, which this mark tells of

    @property
    def text(self) -> str:
        return f"{self.cut.text}, {self.more} more" if self.more else self.cut.text


def _most(height: float) -> int:
    """Rows of marks at an edge of axes so many points high, half of which are left for the other edge."""
    return min(_ROWS, max(int(height / 2 / ROW), 1))


def places(ax: Axes, side: Side, width: float, height: float) -> list[Place]:
    """Of the marks at an edge, those with a value first: near their cuts, but rather where they hide no sample.

    Parameters
    ----------
    ax : Axes
        With its limits.
    width, height : float
        Of the axes, in points.
    """
    rows: list[list[tuple[float, float]]] = [[] for _ in range(_most(height))]
    found: list[Place] = []
    dots, told = _dots(ax, side, width, height), cuts(ax)
    here = [one for one in told if one.side == side]
    others = [one for one in further_cuts(ax, told, _APART / width) if one.side == side]
    for one in (*here, *others):
        at = float(fractions(ax, np.array([one.x]))[0]) * width
        length = (len(one.text) + 2) * _LETTER if one.told else SIZE
        turned = at + length > width  # it would leave the panel on the right
        start = at - length if turned else at
        free = [
            (_hidden(dots, i, left, length), abs(left - start), i, left)
            for i, row in enumerate(rows)
            for left in _free(row, start, length)
            if left == start or (one.told and 0 <= left <= width - length)
        ]
        if free:
            *_, i, left = min(free)
            rows[i].append((left, left + length))
            found.append(Place(one, i, left - start, turned))
    written = [place for place in found if place.cut.told]
    if len(written) < len(here):
        found[len(written) - 1] = replace(written[-1], more=len(here) - len(written))
    return found


def _free(row: list[tuple[float, float]], start: float, length: float) -> Iterator[float]:
    """Where a mark of this length may begin in a row: at its start, or beside what stands there."""
    for left in (start, *(high for _, high in row), *(low - length for low, _ in row)):
        if all(left + length <= low + _TOUCH or left >= high - _TOUCH for low, high in row):
            yield left


def _dots(ax: Axes, side: Side, width: float, height: float) -> np.ndarray:
    """Samples that are seen, where they are few: points from the left and from an edge, and half their size; (k, 3)."""
    found = [np.empty((0, 3))]
    for line in ax.lines:
        x, y = np.array(line.get_data(), dtype=float)
        if line.get_linestyle() == "None" and line.get_transform() == ax.transData and x.size <= FEW:
            at = ax.transAxes.inverted().transform(ax.transData.transform(np.column_stack([x, y])))
            at = at[np.all((at >= 0) & (at <= 1), axis=1)]
            depth = 1.0 - at[:, 1] if side == "top" else at[:, 1]
            half = np.full(depth.size, (line.get_markersize() + line.get_markeredgewidth()) / 2)
            found.append(np.column_stack([at[:, 0] * width, depth * height, half]))
    return np.concatenate(found)


def _hidden(dots: np.ndarray, row: int, left: float, length: float) -> int:
    """How many samples a mark in a row would hide, or touch."""
    x, depth, half = dots.T
    beside = (x > left - half) & (x < left + length + half)
    return int(np.count_nonzero(beside & (np.abs(depth - EDGE - ROW * (row + 0.5)) < ROW / 2 + half)))
