"""What betrays that a column is not what was measured when it was measured: pure functions of arrays.

Each returns indices, or stretches of them. Thresholds are chosen so that noise, quantised sensors, steps of a process
and machines at rest are not taken for faults; what is done about a find is decided elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgorun.data.faults.fault_passes import (
    KELVIN,
    NEAR,
    equal_runs,
    gaps_above,
    large_steps,
)
from hgorun.data.faults.switched import is_switched
from hgorun.memo import Memo, same
from hgorun.pieces import ascending as in_order
from hgorun.pieces import distinct, median, medians

GAP = 20.0
"""Median steps that make a gap."""
FIRST = 100_000
"""Samples that show what is usual."""
STUCK = 20
"""Equal values in a row that may be a stuck sensor, at the least."""
_RARE, _TWO = 30, 2  # so many stretches beside one that may be stuck: these are few; two are beside as many
_FACTORS = np.array([60.0, 100.0, 1000.0, 3600.0, 1e6])
_FEW = 5  # samples that show nothing usual
_COARSE = 8  # steps of the digits: so much coarser is a converter whose own steps look like bends
_AS_LARGE = 3.0  # times: noise of one size, and noise that is none of the digits
_LEAST, _MOST = 3, 20  # samples on each side of a slip that have to agree, in a short and in a long log


@dataclass(frozen=True)
class Stretch:
    """Samples from start up to, and without, stop."""

    start: int
    stop: int

    @property
    def size(self) -> int:
        """How many."""
        return self.stop - self.start


_ASCENDING: Memo[bool] = Memo(2)  # the signals of a file share their times
_GAPS: Memo[np.ndarray] = Memo(2)  # as above


def ascending(taken: np.ndarray) -> bool:
    """Whether all stamps are numbers, and each is larger than the one before."""
    return _ASCENDING.get(same(taken), lambda: not np.isnan(taken[:1]).any() and in_order(taken, strictly=True))


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

    def found() -> np.ndarray:
        usual = usual_step(taken)
        return gaps_above(taken, GAP * usual) if usual > 0 else np.empty(0, dtype=int)

    return _GAPS.get(same(taken), found)


def usual_step(taken: np.ndarray) -> float:
    """The median step, 0 where there are too few to speak of one."""
    return median(np.diff(taken[:FIRST])) if taken.size > _FEW else 0.0


def stuck(values: np.ndarray) -> list[Stretch]:
    """Stretches of one value that are much longer than this signal's usual ones.

    Usual is the median of those of two or more: sensors that are coarse, or machines that rest between moves, have
    many. Where those that may be stuck are few among all values, it is the median of all, single values too: two that
    are stuck would be each other's usual length. A stretch that begins and ends with a step of the digits is none, nor
    is one that is not longer and ends with the log.
    """
    runs = equal_runs(values)
    sizes = runs[:, 1] - runs[:, 0]
    long = int(np.count_nonzero(sizes >= STUCK))
    if not long:
        return []
    usual = median(sizes) if sizes.size > 1 else 1.0
    singles = values.size - int(sizes.sum())
    if (1 if long <= _TWO else long) * _RARE <= sizes.size + singles:
        usual = min(usual, median(np.append(sizes, np.ones(min(singles, sizes.size + 1)))))
    found = [Stretch(start, stop) for start, stop in runs[sizes >= max(STUCK, 5 * usual)].tolist()]
    if not found:
        return []
    steps = np.abs(np.diff(values[:FIRST]))
    step = 1.5 * float(np.min(steps, where=steps > 0, initial=np.inf))  # of a converter's it may be rounded
    slow = [np.isfinite(step) and _within_digits(values, one, step) for one in found]
    longest = max((one.size for one, true in zip(found, slow, strict=True) if true), default=0)
    ends = [one.stop == values.size and one.size <= longest for one in found]
    return [one for one, *no in zip(found, slow, ends, strict=True) if not any(no)]


def _within_digits(values: np.ndarray, held: Stretch, step: float) -> bool:
    """Whether a signal comes to a value and leaves it by no more than a step of its digits: it is as slow, not stuck.

    What is stuck jumps where it ends, unless nothing has moved meanwhile; at the end of a log nothing shows it.
    """
    if held.stop == values.size:
        return False
    into = abs(values[held.start] - values[held.start - 1]) if held.start else 0.0
    return bool(max(into, abs(values[held.stop] - values[held.stop - 1])) <= step)


def quantum_of(rise: np.ndarray) -> float:
    """The step that all differences are multiples of; 0 where there is none."""
    sizes = np.abs(rise)
    sizes = sizes[sizes > 0]
    if not sizes.size:
        return 0.0
    smallest = float(sizes.min())
    decimal = np.floor(np.log10(smallest) + 1e-9)
    for step in (smallest, *10.0 ** (decimal - np.arange(4))):
        parts = sizes / step
        # rounding leaves differences of rounded numbers off by some last bits
        if median(parts) < 1e9 and np.mean(np.abs(parts - np.rint(parts)) < 1e-3) > 0.9:
            return float(step) * (_coarser(distinct(np.rint(parts))) if parts.min() > _COARSE - 0.5 else 1.0)
    return 0.0


def _coarser(parts: np.ndarray) -> float:
    """The step that whole numbers are multiples of but for their rounding, as a converter's is in decimals; else 1.

    Parameters
    ----------
    parts : ndarray, shape (n,)
        Ascending, from 1 on.
    """
    step = upto = float(parts[0])
    while upto < 2 * parts[-1]:
        upto *= 2
        some = parts[parts <= upto]  # larger ones tell the step more exactly, once it is known to some extent
        counts = np.rint(some / step)
        step = float(some @ counts / (counts @ counts))
    counts = np.rint(parts / step)
    alike = np.abs(parts - counts * step) <= 1
    return step if distinct(counts).size >= _FEW and np.mean(alike) > 0.9 else 1.0


def slips(values: np.ndarray) -> list[tuple[int, str]]:
    """Where values change by the factor between two units from one sample on, and what they change by."""
    width = max(_LEAST, min(values.size // 12, _MOST))
    if values.size < 2 * width:
        return []
    factors, shifts = large_steps(values)
    near = _steadily(values, factors, _LEAST)  # of noise around zero few are left
    steady = _scaled(values, _steadily(values, near, width), width)
    found = [(int(k), _said(factor)) for k, factor in _confirmed(values, steady, width)]
    if found and is_switched(_logarithms(values), found[0][0], factors):
        found = []
    shifted = _shifted(values, shifts, width)
    if shifted.size and is_switched(values, int(shifted[0]), shifts, wide=NEAR):
        return found
    return sorted(found + [(int(k), "273.15") for k in shifted])


def _logarithms(values: np.ndarray) -> np.ndarray:
    """Those of the sizes of some values; of 0 as of the least that is none."""
    sizes = np.abs(values)
    return np.asarray(np.log(np.maximum(sizes, sizes[sizes > 0].min())))


def _said(factor: float) -> str:
    return f"a factor {factor:g}" if factor >= 1 else f"a factor 1/{1 / factor:g}"


def _beside(values: np.ndarray, places: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places with enough samples on both sides, and these."""
    places = places[(places >= width) & (places <= values.size - width)]
    before = values[places[:, None] + np.arange(-width, 0)]
    after = values[places[:, None] + np.arange(width)]
    return places, before, after


def _steadily(values: np.ndarray, places: np.ndarray, width: int) -> np.ndarray:
    """Places on whose sides the values agree among each other."""
    places, before, after = _beside(values, places, width)
    steady: np.ndarray = places[_steady(before) & _steady(after)]
    return steady


def _scaled(values: np.ndarray, places: np.ndarray, width: int) -> np.ndarray:
    """Those without noise that is as large on both sides: that of a slip has the unit of its values, too."""
    if not places.size:
        return places
    places, before, after = _beside(values, places, width)
    noise = np.sort([np.abs(np.diff(side, axis=1)).mean(axis=1) for side in (before, after)], axis=0)
    digits = quantum_of(np.diff(values[:FIRST]))
    scaled: np.ndarray = places[(noise[1] >= _AS_LARGE * noise[0]) | (noise[0] <= _AS_LARGE * digits)]
    return scaled


def _confirmed(values: np.ndarray, places: np.ndarray, width: int) -> list[tuple[int, float]]:
    """Those on whose sides the values differ by a factor between units."""
    places, before, after = _beside(values, places, width)
    ratio = medians(after, 1) / medians(before, 1)
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
    moved = np.abs(medians(after, 1) - medians(before, 1))
    shifted: np.ndarray = places[quiet & (np.abs(moved - KELVIN) < NEAR)]
    return shifted
