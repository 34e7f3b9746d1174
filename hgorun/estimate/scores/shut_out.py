"""Gates that leave out so many samples that these are no outliers: the estimate does not follow what is measured."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hgorun.observers.base import AnyObserver
from hgorun.observers.covariance import BeginsWithCovariance
from hgorun.result.records.recorded import InARow
from hgorun.result.result import Result

_OUTLIERS = 0.2  # of the samples: more are none
_IN_A_ROW = 20  # one after the other: as many are none, however long the log is
_FIRST_PART = 0.1  # of a run


@dataclass(frozen=True)
class ShutOut:
    """What a gate has left out of an output.

    Attributes
    ----------
    label, output : str
    left_out, count : int
        How many samples were left out, and of how many.
    row : InARow or None
        Those one after the other, where these alone are too many.
    early : bool
        Whether most are of one row that begins in the first tenth of the run: then the start is a likely cause.
    """

    label: str
    output: str
    left_out: int
    count: int
    row: InARow | None
    early: bool = False


def too_many(left_out: int, count: int, in_a_row: int = 0) -> bool:
    """Whether a gate has left out more of ``count`` samples, or more one after the other, than can be outliers.

    A single one may always be one.
    """
    return left_out > max(1, _OUTLIERS * count) or in_a_row >= _IN_A_ROW


def until_too_many(in_a_row: int) -> int:
    """How many samples come at least before so many, one after the other, can be too many."""
    return max(_IN_A_ROW - in_a_row, 1)


def told_row(in_a_row: int, when: str = "") -> str:
    """What is told of samples that were left out one after the other; nothing of a few."""
    return f", {in_a_row} of them one after the other{when}" if too_many(0, 0, in_a_row) else ""


def too_small(observer: AnyObserver, gate: float) -> str:
    """Which numbers may be too small where a gate leaves out too many samples: of a filter also what P grows by."""
    of_filter = observer.model_fields_set if isinstance(observer, BeginsWithCovariance) else frozenset[str]()
    grows = "".join(f", {key}" for key in ("Q", "q", "theta") if key in of_filter)
    return f"whether std{grows} or the gate of {gate:g} is too small"


def of_start(label: str, observer: AnyObserver, *, given: bool) -> str:
    """Which keys say where an observer starts, whole as its ``initial`` or not, and how far off that may be."""
    ways = [f"observers.{label}.initial"]
    if not given:
        ways.append("data.first_samples")
    if isinstance(observer, BeginsWithCovariance):
        ways.append("internal: {P: ...}, how far off it may be")
    return f"the start, near which most of them lie ({', '.join(ways)}), "


def shut_out(result: Result) -> Iterator[ShutOut]:
    """Of such gates; samples that the start has found to be outliers are told as such, and not counted."""
    if result.recorded is None:
        return
    for j, (label, observer) in enumerate(result.observers.items()):
        assessed = observer.assessed
        gated = {} if assessed is None else assessed.scores.get("gated", {})
        for output, score in gated.items():
            left_out = round(score)
            count = left_out + int(np.count_nonzero(result.recorded.outputs[output].used[:, j]))
            row = None if assessed is None else assessed.in_a_row.get(output)
            many = row is not None and too_many(0, count, row.count)
            outliers = 0 if assessed is None else assessed.outliers_at_start.get(output, 0)
            if many or too_many(left_out - outliers, count):
                yield ShutOut(label, output, left_out, count, row if many else None, _early(result, row, left_out))


def _early(result: Result, row: InARow | None, left_out: int) -> bool:
    """Whether so many of those that are left out lie in one row that begins where a run does."""
    first, last = result.time[0], result.time[-1]
    return row is not None and 2 * row.count > left_out and row.first - first <= _FIRST_PART * (last - first)
