"""Values that somebody has filled in between samples: points on exactly straight lines."""

from __future__ import annotations

import numpy as np

from hgorun.data.faults.fault_passes import EVEN, EXACT, straight_runs
from hgorun.data.faults.faults import FIRST, Stretch, quantum_of
from hgorun.data.faults.machine_lines import of_a_machine
from hgorun.pieces import median

LINE = 10
"""Points on a line that noise does not leave there, at the least."""
_BY_ACCIDENT = 1e-3  # lines that may be there by chance, in a log
_BEHIND = 1.5  # times as likely is a point on a line behind several as one behind two
_LIKELIEST = 0.9  # of a signal that is smooth to its digits, which is as straight for a while
_SHARP = 5.0  # steps of the digits: a bend that is more
_SHORT_LINE = 4
_NORMAL = 1.4826  # standard deviations of normal numbers in their median size


def filled(taken: np.ndarray, values: np.ndarray) -> list[Stretch]:
    """Stretches of points on one straight line that is not level: filled in by interpolation.

    Such a line begins and ends at a sharp bend, which tells it from a signal that is merely smooth. It counts if it has
    more points than lines have by accident, see :func:`_least_points`, and is straight from end to end, or if such
    lines, of at least four points, make up half of the signal; not if a machine may have drawn it: see
    :func:`hgorun.data.faults.machine_lines.of_a_machine`.
    """
    if values.size < LINE:
        return []
    quantum = quantum_of(np.diff(values[:FIRST]))
    runs = straight_runs(taken, values, quantum, _SHORT_LINE - 2)
    lines = [Stretch(start, stop + 2) for start, stop in runs.tolist()]
    if lines:
        lines = _between_bends(taken, values, lines, quantum)
    if sum(line.size for line in lines) < values.size / 2:
        lines = [line for line in lines if line.size >= LINE and _is_straight(taken, values, line, quantum)]
        least = _least_points(taken, values, lines, quantum) if lines else LINE
        lines = [line for line in lines if line.size >= least]
    drawn = of_a_machine(values, np.array([[line.start, line.stop] for line in lines], dtype=int), quantum)
    return [line for line, own in zip(lines, drawn, strict=True) if not own]


def _is_straight(taken: np.ndarray, values: np.ndarray, line: Stretch, quantum: float) -> bool:
    """Whether points are on the line from the first to the last of them, as those of a smooth curve are only nearby."""
    some = slice(line.start, line.stop)
    t, y, numbers = taken[some], values[some], np.arange(line.size)
    allowed = max(EXACT * float(np.max(np.abs(y))), 2 * quantum)  # what rounding takes off the ends, and off a point
    for place in (t, numbers):
        share = (place - place[0]) / (place[-1] - place[0])
        if np.all(np.abs(y[0] + share * (y[-1] - y[0]) - y) <= allowed):
            return True
    return False


def _least_points(taken: np.ndarray, values: np.ndarray, lines: list[Stretch], quantum: float) -> float:
    """How many points noise does not leave on a line between sharp bends, in a log of so many rows.

    Of N threes of neighbours a share b bends sharply, and a share a is on a line that climbs. By noise whose bends have
    the standard deviation s a three is on a line with the chance quantum/s: its middle has to be within a step of the
    digits, 1.25 with what these round off, and 2.5/sqrt(2 pi) = 1. Behind others on the line it has up to half as much
    again, p, since these tell where the next point would be. So a line of m points, which are m - 2 threes, stands
    between two sharp bends N b^2 a p^(m - 3) times by accident, at the most. The least m for which less than one in a
    thousand logs has one is larger by ln 10/ln(1/p) in a log of ten times the rows.

    N, a, b and s are those outside of the lines, where the signal does not rest.

    Parameters
    ----------
    taken, values : ndarray
    lines : list of Stretch
        That have ``LINE`` points.
    quantum : float
        The step of the digits.
    """
    first = np.arange(min(values.size - 2, FIRST))
    within = np.zeros(values.size, dtype=bool)
    for line in lines:
        within[max(line.start - 2, 0) : line.stop] = True  # with the bends at its ends
    bend, exact = _bends(taken, values, first)
    outside = (bend > exact) & ~within[: first.size]
    if not outside.any():
        return LINE
    bend, digits, first = bend[outside], np.maximum(exact[outside], quantum), first[outside]
    climbs = np.abs(values[first + 2] - values[first]) > _SHARP * digits
    sharp, on_line = (float(np.mean(which)) for which in (bend > _SHARP * digits, (bend <= digits) & climbs))
    rows = bend.size * values.size / min(values.size, FIRST)
    expected = rows * sharp**2 * on_line / _BY_ACCIDENT
    if expected <= 1:
        return LINE
    chance = min(_BEHIND * quantum / (_NORMAL * median(bend)), _LIKELIEST)
    return max(LINE, 3 + float(np.log(expected) / np.log(1 / chance)))


def _bends(taken: np.ndarray, values: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of threes of neighbours, by their first ones, how far the middle one is off the line, and what rounding leaves.

    The formulas are those of :mod:`hgorun.data.faults.fault_passes`, operation by operation.
    """
    (before, middle, after), (low, here, high) = ([of[first + k] for k in range(3)] for of in (taken, values))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (middle - before) / (after - before)
    by_time = low + share * (high - low) - here
    by_place = 0.5 * (low + high) - here  # filled in row by row, whatever the rounded stamps say
    even = np.abs(share - 0.5) < EVEN
    bend = np.abs(np.where(even & (np.abs(by_place) < np.abs(by_time)), by_place, by_time))
    return bend, EXACT * np.maximum(np.abs(here), np.abs(high - here))


def _between_bends(taken: np.ndarray, values: np.ndarray, lines: list[Stretch], quantum: float) -> list[Stretch]:
    """The lines with a sharp bend at both ends, or at the one that is not an end of the log."""
    last = values.size - 3
    ends = np.array([[line.start - 1, line.stop - 2] for line in lines])
    bend, exact = _bends(taken, values, np.clip(ends, 0, last).ravel())
    sharp = bend > _SHARP * np.maximum(exact, quantum)
    sharp, outside = sharp.reshape(-1, 2), (ends < 0) | (ends > last)
    kept = (sharp | outside).all(axis=1) & ~outside.all(axis=1)  # a log that is one line is a ramp
    return [line for line, true in zip(lines, kept, strict=True) if true]
