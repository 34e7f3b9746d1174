"""What betrays that a column is not what was measured when it was measured: pure functions of arrays.

Each returns indices, or stretches of them. Thresholds are chosen so that noise, quantised sensors, steps of a process
and machines at rest are not taken for faults; what is done about a find is decided elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

GAP = 20.0
"""Median steps that make a gap."""
STUCK = 20
"""Equal values in a row that may be a stuck sensor, at the least."""
LINE = 10
"""Points on a line that noise does not leave there."""
_SHORT_LINE = 4
_EXACT = 1e-9  # of the size of the values: interpolation in doubles, written with nine digits or more
_FACTORS = np.array([60.0, 100.0, 1000.0, 3600.0, 1e6])
_KELVIN = 273.15
_WINDOW = 5  # samples beside a slip that have to agree


@dataclass(frozen=True)
class Stretch:
    """Samples from start up to, and without, stop."""

    start: int
    stop: int

    @property
    def size(self) -> int:
        """How many."""
        return self.stop - self.start


def backwards(taken: np.ndarray) -> np.ndarray:
    """Samples whose stamp lies before one that came earlier."""
    if taken.size < 2 or not np.any(taken[1:] < taken[:-1]):
        return np.empty(0, dtype=int)
    return np.flatnonzero(taken[1:] < np.maximum.accumulate(taken)[:-1]) + 1


def repeated(taken: np.ndarray) -> np.ndarray:
    """Samples with the stamp of the one before, of times in order."""
    return np.flatnonzero(taken[1:] == taken[:-1]) + 1


def gaps(taken: np.ndarray) -> np.ndarray:
    """Samples that follow a gap of more than ``GAP`` median steps."""
    steps = np.diff(taken)
    if steps.size < 5:
        return np.empty(0, dtype=int)
    usual = float(np.median(steps[: 10**6]))
    return np.flatnonzero(steps > GAP * usual) + 1 if usual > 0 else np.empty(0, dtype=int)


def stuck(values: np.ndarray) -> list[Stretch]:
    """Stretches of one value that are much longer than this signal's usual ones."""
    same = values[1:] == values[:-1]
    if np.count_nonzero(same) < STUCK - 1:
        return []
    stretches = _true_runs(same)
    sizes = np.array([stretch.size for stretch in stretches])
    usual = float(np.median(sizes)) if len(stretches) > 1 else 1.0
    return [stretch for stretch in stretches if stretch.size >= max(STUCK, 5 * usual)]


def filled(taken: np.ndarray, values: np.ndarray) -> list[Stretch]:
    """Stretches of points on one straight line that is not level: filled in by interpolation.

    A line counts if it has ``LINE`` points, or if such lines, of at least four points, make up half of the signal. In
    numbers with few digits neighbours lie on a line by chance, so there the line must climb by several digits a sample.
    """
    if values.size < LINE:
        return []
    rise = np.diff(values)
    quantum = _quantum(rise)
    bend = np.abs(_bend(taken, values, rise))
    level = np.maximum(np.abs(values[1:-1]), np.abs(rise[1:]))
    straight = bend <= np.maximum(_EXACT * level, 2.02 * quantum)
    straight &= np.abs(rise[1:]) > 5 * quantum
    straight &= rise[1:] != 0
    lines = [Stretch(run.start, run.stop + 1) for run in _true_runs(straight)]
    if quantum and lines and not _bends_elsewhere(bend, straight, quantum):
        return []
    lines = [line for line in lines if line.size >= _SHORT_LINE]
    if sum(line.size for line in lines) >= values.size / 2:
        return lines
    return [line for line in lines if line.size >= LINE]


def _bend(taken: np.ndarray, values: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """How far the middle of every three points lies from the line through the others, twice."""
    steps = np.diff(taken)
    whole = steps[1:] + steps[:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(whole > 0, steps[:-1] / whole, 0.5)
    by_time = 2 * (values[:-2] + share * (values[2:] - values[:-2]) - values[1:-1])
    by_place = rise[1:] - rise[:-1]  # filled in row by row, whatever the rounded stamps say
    even = np.abs(share - 0.5) < 0.01
    bend: np.ndarray = np.where(even & (np.abs(by_place) < np.abs(by_time)), by_place, by_time)
    return bend


def _quantum(rise: np.ndarray) -> float:
    """The step that all differences are multiples of; 0 where there is none."""
    sizes = np.abs(rise[:100_000])
    sizes = sizes[sizes > 0]
    if not sizes.size:
        return 0.0
    smallest = float(sizes.min())
    decimal = np.floor(np.log10(smallest) + 1e-9)
    for step in (smallest, *10.0 ** (decimal - np.arange(4))):
        parts = sizes / step
        # rounding leaves differences of rounded numbers off by some last bits
        if np.median(parts) < 1e6 and np.mean(np.abs(parts - np.rint(parts)) < 1e-3) > 0.9:
            return float(step)
    return 0.0


def _bends_elsewhere(bend: np.ndarray, straight: np.ndarray, quantum: float) -> bool:
    """Whether points off the lines are far off, compared with the digits: else it is a smooth signal."""
    rest = bend[~straight]
    return bool(rest.size >= 2 and np.median(rest) > 40 * quantum)


def slips(values: np.ndarray) -> list[tuple[int, str]]:
    """Where values change by the factor between two units from one sample on, and what they change by."""
    width = _WINDOW if values.size >= 6 * _WINDOW else 3
    if values.size < 2 * width:
        return []
    before, after = values[:-1], values[1:]
    small, large = np.minimum(np.abs(before), np.abs(after)), np.maximum(np.abs(before), np.abs(after))
    candidates = np.flatnonzero((large > 45 * small) & (small > 0)) + 1
    found = [(int(k), _said(factor)) for k, factor in _confirmed(values, candidates, width)]
    shifts = np.flatnonzero(np.abs(np.abs(after - before) - _KELVIN) < 5) + 1
    return sorted(found + [(int(k), "273.15") for k in _shifted(values, shifts, width)])


def _said(factor: float) -> str:
    return f"a factor {factor:g}" if factor >= 1 else f"a factor 1/{1 / factor:g}"


def _beside(values: np.ndarray, places: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places with enough samples on both sides, and these."""
    places = places[(places >= width) & (places <= values.size - width)]
    before = values[places[:, None] + np.arange(-width, 0)]
    after = values[places[:, None] + np.arange(width)]
    return places, before, after


def _confirmed(values: np.ndarray, places: np.ndarray, width: int) -> list[tuple[int, float]]:
    """Those on whose sides the values agree among each other, and differ by a factor between units."""
    places, before, after = _beside(values, places, width)
    kept = _steady(before) & _steady(after)
    places, ratio = places[kept], np.median(after[kept], axis=1) / np.median(before[kept], axis=1)
    factors = np.concatenate([_FACTORS, 1 / _FACTORS])
    # a unit's factor is exact; what the quantity itself has changed meanwhile is little
    off = np.abs(np.log(np.abs(ratio)[:, None] / factors))
    same_sign = ratio > 0
    return [
        (int(place), float(factors[row.argmin()]))
        for place, row, same in zip(places, off, same_sign, strict=True)
        if same and row.min() < 0.4
    ]


def _steady(windows: np.ndarray) -> np.ndarray:
    """Windows whose values have one sign and differ by less than a factor 2.5."""
    sizes = np.abs(windows)
    one_sign = np.abs(np.sign(windows).sum(axis=1)) == windows.shape[1]
    steady: np.ndarray = one_sign & (sizes.max(axis=1) < 2.5 * sizes.min(axis=1))
    return steady


def _shifted(values: np.ndarray, places: np.ndarray, width: int) -> np.ndarray:
    """Those on whose sides the values differ by 273.15 and little else."""
    places, before, after = _beside(values, places, width)
    quiet = (np.ptp(before, axis=1) < 10) & (np.ptp(after, axis=1) < 10)
    moved = np.abs(np.median(after, axis=1) - np.median(before, axis=1))
    shifted: np.ndarray = places[quiet & (np.abs(moved - _KELVIN) < 5)]
    return shifted


def _true_runs(flags: np.ndarray) -> list[Stretch]:
    """Samples around runs of true flags, where flag k is about the samples k and k + 1."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return [Stretch(int(a), int(b) + 1) for a, b in edges.reshape(-1, 2)]
