"""Fixed steps between events: how many, even or uneven, and in pieces that do not take long."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from hgorun.errors import Problem
from hgorun.measurement.long import AnySchedule
from hgorun.measurement.schedule import Schedule
from hgorun.memo import Memo, same
from hgorun.pieces import distinct
from hgorun.simulation.timeline.segment_rows import cut_rows

_PIECE = 1 << 14  # steps between two checks for Ctrl-C, more only where there were too many pieces
_MAX_PIECES = 100_000
_MAX_STEPS = 1e10  # then a piece is still a matter of a second
_KEPT = 100_000  # gaps whose steps are kept in memory
_STEPS: Memo[np.ndarray] = Memo(16, lambda steps: steps.size < _KEPT)


def steps_between(schedule: AnySchedule, longest: float, key: str = "step") -> np.ndarray:
    """How many equal steps each gap between two events of a schedule takes, as :func:`count_steps`."""
    return _STEPS.get((schedule, longest, key), lambda: count_steps(np.diff(schedule.events), longest, key))


@dataclass(frozen=True, eq=False, repr=False)
class StepCounts:
    """How many gaps between events take so many steps each.

    Attributes
    ----------
    steps, gaps : ndarray of int64, shape (N,)
    """

    steps: np.ndarray
    gaps: np.ndarray

    @property
    def segments(self) -> int:
        """All segments of the run, with the last one, which has no steps."""
        return int(np.sum(self.gaps)) + 1

    @property
    def total(self) -> int:
        """All steps of the run."""
        return int(np.sum(self.steps * self.gaps))

    def uneven(self, ratio: float) -> int:
        """All steps of the run that is compared, see :func:`uneven_steps`."""
        return int(np.sum(uneven_steps(self.steps, ratio) * self.gaps))


_COUNTED: Memo[StepCounts] = Memo(4)
_COUNTED_EVENTS: Memo[StepCounts] = Memo(4, lambda counts: counts.steps.size < _KEPT)


def counted_steps(schedule: AnySchedule, longest: float, key: str = "step") -> StepCounts:
    """The steps of a schedule, counted; as :func:`count_steps`."""
    if isinstance(schedule, Schedule):
        return _COUNTED_EVENTS.get(
            (schedule, longest, key), lambda: _alike_together(steps_between(schedule, longest, key))
        )
    return _COUNTED.get((same(schedule), longest, key), lambda: _counted(schedule.gaps(), longest, key))


def _alike_together(steps: np.ndarray) -> StepCounts:
    """All gaps at once where they take as many steps, else each of them."""
    if steps.size and (not any(steps.strides) or steps.min() == steps.max()):  # one in memory, or as large
        return StepCounts(steps[:1], np.array([steps.size]))
    return StepCounts(steps, np.ones_like(steps))


def _counted(parts: Iterable[np.ndarray], longest: float, key: str) -> StepCounts:
    found: Counter[int] = Counter()
    total = 0.0
    for gaps in parts:
        steps = count_steps(gaps, longest, key)
        if steps.size and np.all(steps == steps[0]):
            found[int(steps[0])] += steps.size
        else:
            ordered = np.sort(steps)
            edges = np.append(np.flatnonzero(np.diff(ordered, prepend=-1)), ordered.size)
            found.update(dict(zip(ordered[edges[:-1]].tolist(), np.diff(edges).tolist(), strict=True)))
        total += float(np.sum(steps))
        _require_possible(total, longest, key)
    return StepCounts(np.array(sorted(found)), np.array([found[n] for n in sorted(found)]))


def count_steps(gaps: np.ndarray, longest: float, key: str = "step") -> np.ndarray:
    """How many equal steps, none longer than ``longest``, each gap between two events takes.

    Parameters
    ----------
    gaps : ndarray
    longest : float
    key : str
        The solver's key that ``longest`` comes from.

    Raises
    ------
    Problem
        For more steps than a run can make.
    """
    if gaps.size and steps_needed(gaps.max(), longest) == 1:
        return np.broadcast_to(np.int64(1), gaps.shape)
    steps = steps_needed(gaps, longest)
    _require_possible(float(np.sum(steps)), longest, key)
    return np.asarray(steps.astype(np.int64))


def steps_needed(gaps: np.ndarray, longest: float) -> np.ndarray:
    """How many equal steps, none longer than ``longest``, each gap takes, as doubles: there may be too many."""
    with np.errstate(over="ignore", divide="ignore"):
        return np.asarray(np.maximum(np.ceil(gaps / longest * (1 - 1e-9)), 1))


def _require_possible(total: float, longest: float, key: str) -> None:
    if not total <= _MAX_STEPS:
        raise Problem(
            ("solver", key),
            f"the run takes {total:.3g} steps of {longest:.3g}, at most {_MAX_STEPS:.0e} are possible: "
            f"increase solver.{key}" + (", or solver.method: rodas5p if the system is stiff" if key == "step" else ""),
        )


_PART = 0.5 * (3 - 5**0.5)  # of a gap, before its cut: no simple fraction


def uneven_steps(steps: np.ndarray, ratio: float) -> np.ndarray:
    """How many steps a gap takes in a run that is compared with one of ``steps`` even steps.

    Parameters
    ----------
    steps : ndarray of int
    ratio : float
        So many for each of them, two at least; where that would hardly be another number, one more.
    """
    other = np.maximum(np.round(ratio * steps).astype(np.int64), 2)
    return np.where((other >= steps) & (ratio < 1), steps + 1, other)


def _cut(total: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How many of the uneven steps of each gap lie before its cut, and how many behind it."""
    before = np.clip(np.round(_PART * total).astype(np.int64), 1, total - 1)
    return before, total - before


def part_of_difference(steps: np.ndarray, ratio: float, order: int) -> float:
    """How large the error of even steps is, for a difference of one to uneven ones.

    Parameters
    ----------
    steps : ndarray of int
        Even steps of every gap.
    ratio : float
        As in :func:`uneven_steps`.
    order : int
        With which errors fall with the step; where it is higher, what is found is too large.
    """
    even = distinct(steps)
    uneven = _cut(uneven_steps(even, ratio))
    own = even ** (-1.0 * order)
    parts = (_PART, 1 - _PART)
    other = sum(part ** (order + 1) / count ** (1.0 * order) for part, count in zip(parts, uneven, strict=True))
    return float(np.max(own / np.abs(other - own)))


def unevenly(spans: np.ndarray, counts: np.ndarray, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Segments cut in two parts with even steps each, whose times are no simple fractions of the segment.

    Two runs with even steps share the zeros of many a sinusoid, whatever the numbers of their steps.
    """
    before, after = _cut(uneven_steps(counts[:, 0], ratio))
    return cut_rows(spans, counts, before, after, _PART)


def unevenly_alike(events: np.ndarray, count: np.ndarray, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """The same of segments that are alike.

    Parameters
    ----------
    events : ndarray, shape (N + 1,)
        Between which they are.
    count : ndarray of int64, shape (7,)
        Of each of them.

    Returns
    -------
    times : ndarray, shape (2 N + 1,)
    counts : ndarray of int64, shape (2, 7)
        Of the two parts of each.
    """
    steps, (regime, first, last) = _cut(uneven_steps(count[:1], ratio)), count[3:6].tolist()
    times = np.empty(2 * events.size - 1)
    times[::2], times[1::2] = events, events[:-1] + _PART * np.diff(events)
    counts = [[part[0], 0, part[0], regime, begin, last, 1] for part, begin in zip(steps, (first, last), strict=True)]
    return times, np.array(counts)


def steps_of_a_piece(total: int) -> int:
    """How many steps a piece has, of so many in the run: see :func:`in_pieces`."""
    return max(_PIECE, -(-total // _MAX_PIECES))


def in_pieces(spans: np.ndarray, counts: np.ndarray, piece: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Long segments in pieces, so that the native code comes back soon; numbering of the steps goes on.

    A piece has 16,384 steps. In runs of more than 1.6e9 steps it is longer, since the pieces themselves
    take memory: up to 100,000 steps, well below a second for all but the largest systems.
    """
    piece = steps_of_a_piece(int(counts[:, 0].sum())) if piece is None else piece
    if counts[:, 0].max(initial=1) <= piece:
        return spans, counts
    pieces = np.maximum(-(-counts[:, 0] // piece), 1)
    origin = np.repeat(np.arange(counts.shape[0]), pieces)
    part = np.arange(origin.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    new = counts[origin].copy()
    new[:, 1] = part * piece
    new[:, 2] = np.minimum((part + 1) * piece, new[:, 0])
    inner = new[:, 2] < new[:, 0]
    new[inner, 6] = 1
    new[part > 0, 4] = new[part > 0, 5]
    return spans[origin], new
