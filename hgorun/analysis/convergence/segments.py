"""Slopes of phi between truth and estimate, enclosed piece by piece of a run.

phi(zhat) - phi(z) = A (xhat - x) and zhat - z = B (xhat - x), where A and B are the means of d phi/dx and dz/dx on
the segment from x to xhat: M = |A B^-1|. Interval arithmetic encloses both part by part of the segment, whether
or not z can be inverted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.analysis.convergence.charts import Chart
from hgorun.memo import Memo, same
from hgorun.native.boxes import LEAST
from hgorun.symbolic.enclosures import Enclosure

_PIECES = 600  # of a run, at most
_PARTS = 16  # of a segment
_SLACK = 0.5  # of what moves in a piece: how far it may go between the points of the output grid
_REGULAR = 0.999  # spectral radius of |E| up to which B is taken for regular
_ROUNDING = 1e-9  # of the linear algebra, relatively

Box = tuple[np.ndarray, np.ndarray]
_TRUTHS: Memo[Box] = Memo(4)  # all observers of a run have the same truth
_INPUTS: Memo[Box] = Memo(16)  # functions of time alone: those of other runs of a plant, too


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Trajectories:
    """The simulated truth and an estimate of it, in the plant's coordinates and in those of a chart.

    Attributes
    ----------
    chart : Chart
    time : ndarray, shape (Nt,)
    x, xhat : ndarray, shape (Nt, n)
    z, zhat : ndarray, shape (Nt, n)
        The same in the chart's coordinates.
    """

    chart: Chart
    time: np.ndarray
    x: np.ndarray
    xhat: np.ndarray
    z: np.ndarray
    zhat: np.ndarray


def along(trajectories: Trajectories) -> np.ndarray:
    """M over all pieces, shape (n, n); infinite where there is no bound."""
    chart, time = trajectories.chart, trajectories.time
    x, xhat = (trajectories.z, trajectories.zhat) if chart.straight else (trajectories.x, trajectories.xhat)
    sound = np.isfinite(x), np.isfinite(xhat)
    lost = [np.argmin(np.all(known, axis=1)) for known in sound if not known.all()]
    count = int(min(lost, default=len(x)))  # until the first that is not a number
    if count < 2:
        return np.full((len(chart.names),) * 2, np.inf)
    starts = np.arange(0, count - 1, -(-(count - 1) // _PIECES))
    truth_of = (same(trajectories.x), same(chart), count)
    ends = _TRUTHS.get(truth_of, lambda: _pieces(x[:count], starts)), _pieces(xhat[:count], starts)
    edges = np.append(time[starts], time[count - 1])[:, None]
    inputs = _INPUTS.get((same(chart.inputs), edges.tobytes()), lambda: chart.inputs.each(edges[:-1], edges[1:]))
    common = np.hstack([inputs[0], edges[:-1]]).T, np.hstack([inputs[1], edges[1:]]).T
    compiled = chart.along_segments.compiled(len(chart.names), _PARTS) if starts.size >= LEAST else None
    if compiled is None:
        total = _means(chart.along_segments, _parts(*ends), list(zip(*common, strict=True)))
    else:
        total = compiled(np.vstack([*(side.T for end in ends for side in end), *common]))
    n = len(chart.names)
    A, B = (
        tuple(np.swapaxes(side[:, block * n * n : (block + 1) * n * n].reshape(-1, n, n), 1, 2) for side in total)
        for block in (0, 1)
    )
    if chart.straight:
        return np.asarray(np.max(np.maximum(np.abs(A[0]), np.abs(A[1])), axis=0) * (1 + _ROUNDING))
    return _divided((A[0], A[1]), (B[0], B[1]))


def compile_slopes(chart: Chart) -> bool:
    """Compile what slopes take most of their time for, which gives the same bits; False: it is compiled already.

    It pays where a chart is used for many runs, or others that differ from it in numbers.
    """
    entries = dict.fromkeys(chart.entries.values()) if chart.invertible else ()
    new = [chart.along_segments.compile(len(chart.names), _PARTS), *(entry.compile() for entry in entries)]
    return any(new)


def _divided(A: Box, B: Box) -> np.ndarray:
    """|A B^-1|: with B = (I + E) B_m, |A B^-1| <= |A B_m^-1| (I - |E|)^-1 where |E| has a radius below 1."""
    n = A[0].shape[1]
    nothing = np.full((n, n), np.inf)
    if not all(np.all(np.isfinite(part)) for part in (*A, *B)):
        return nothing
    middle_A, middle_B = 0.5 * (A[0] + A[1]), 0.5 * (B[0] + B[1])
    try:
        inverse = np.linalg.inv(middle_B)
    except np.linalg.LinAlgError:
        return nothing
    E = 0.5 * (B[1] - B[0]) @ np.abs(inverse)
    rows = np.max(np.sum(E, axis=2))  # no radius is larger
    if rows > _REGULAR and np.max(np.abs(np.linalg.eigvals(E))) > _REGULAR:
        return nothing
    size = np.abs(middle_A @ inverse) + 0.5 * (A[1] - A[0]) @ np.abs(inverse)
    found = size @ np.linalg.inv(np.eye(n) - E)
    return np.asarray(np.max(found, axis=0) * (1 + _ROUNDING))


def _pieces(values: np.ndarray, starts: np.ndarray) -> Box:
    """Boxes that hold a trajectory between the points of the output grid, a piece each."""
    rows = np.ascontiguousarray(values.T)
    before, after = rows[:, :-1], rows[:, 1:]
    slack = _SLACK * np.abs(after - before)
    low, high = np.minimum(before, after) - slack, np.maximum(before, after) + slack
    return _in_pieces(np.minimum, low, starts), _in_pieces(np.maximum, high, starts)


def _in_pieces(extreme: np.ufunc, rows: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """The smallest or the largest in each piece, of which all but the last are as long."""
    length, even = int(starts[1]) if starts.size > 1 else rows.shape[1], starts[-1]
    found = np.empty((starts.size, len(rows)))
    extreme.reduce(rows[:, :even].reshape(len(rows), -1, length), axis=2, out=found.T[:, :-1])
    extreme.reduce(rows[:, even:], axis=1, out=found[-1])
    return found


def _parts(first: Box, second: Box) -> list[Box]:
    """Boxes around the parts of segments from one box to another: of every entry the bounds (_PARTS, pieces)."""
    places = np.arange(_PARTS + 1)[:, None, None] / _PARTS
    low, high = ((1 - places) * a + places * b for a, b in zip(first, second, strict=True))
    below, above = np.minimum(low[:-1], low[1:]), np.maximum(high[:-1], high[1:])
    lows, highs = (np.ascontiguousarray(np.moveaxis(side, -1, 0)) for side in (below, above))
    return list(zip(lows, highs, strict=True))


def _means(enclosure: Enclosure, parts: list[Box], common: list[Box]) -> Box:
    """Bounds (pieces, m) of the means over segments, which are the means of those over their parts.

    All parts go through the arithmetic at once, and what is common to them, inputs and time, once.
    """
    found = enclosure.columns([*parts, *common])
    shape = parts[0][0].shape
    low, high = (np.stack([_mean(np.broadcast_to(column[side], shape)) for column in found], axis=1) for side in (0, 1))
    return low, high


def _mean(values: np.ndarray) -> np.ndarray:
    """The mean over the first axis."""
    found = np.zeros(values.shape[1:])
    for row in values / _PARTS:
        found += row
    return found
