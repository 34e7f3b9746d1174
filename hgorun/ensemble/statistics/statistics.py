"""What is said of many members: means with their uncertainty, quantiles, differences between observers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.collected.collected import Collected, Floats
from hgorun.ensemble.statistics.inference import holm, interval, mean_of, paired
from hgorun.ensemble.statistics.never import is_time, never
from hgorun.result.records.data import PLANT

QUANTILES = {"q05": 0.05, "q25": 0.25, "median": 0.5, "q75": 0.75, "q95": 0.95}
SIGNIFICANT = 0.05  # a Holm-adjusted p below it


@dataclass(frozen=True)
class Summary:
    """A metric of an observer's error in a state, over members.

    Attributes
    ----------
    n : int
        Members whose status is ok or inaccurate, over which the mean is taken.
    mean, sem : float
        With the standard error; NaN where there are too few members, or they are no independent draws. So is ci95.
    ci95 : (float, float)
        Of the mean, by Student's t.
    median, q05, q25, q75, q95 : float
        Over all members: a lost estimate counts as an infinite one. By linear interpolation.
    """

    n: int
    mean: float
    sem: float
    ci95: tuple[float, float]
    median: float
    q05: float
    q25: float
    q75: float
    q95: float

    @property
    def half(self) -> float:
        """Half the width of the interval."""
        return (self.ci95[1] - self.ci95[0]) / 2


@dataclass(frozen=True)
class Difference:
    """A metric of observer a minus that of b, over members in which both have numbers: the same noise for both.

    Attributes
    ----------
    a, b, metric, state : str
    n : int
    mean : float
    ci95 : (float, float)
        By Student's t.
    p : float
        Of the paired t-test that the mean is zero.
    p_holm : float
        The same, adjusted after Holm for all pairs of observers of this metric and state.
    """

    a: str
    b: str
    metric: str
    state: str
    n: int
    mean: float
    ci95: tuple[float, float]
    p: float
    p_holm: float

    @property
    def half(self) -> float:
        """Half the width of the interval."""
        return (self.ci95[1] - self.ci95[0]) / 2

    @property
    def significant(self) -> bool:
        """Whether chance is an unlikely reason."""
        return self.p_holm < SIGNIFICANT


@dataclass(frozen=True)
class Statistics:
    """What is said of some members.

    Attributes
    ----------
    at : mapping of str to value
        Their values on the axes by which the ensemble was divided.
    members : int
    counts : mapping of str to mapping of str to int
        Of every observer, how many members have each status that occurs.
    pooled, shared : tuple of str
        Axes for which the members are no independent draws, so that there are neither intervals nor p values: those
        that were chosen and differ, and random ones on which members share a draw.
    summaries : mapping of (str, str, str) to Summary
        By observer, metric and state.
    differences : tuple of Difference
    without : mapping of (str, str, str) to int
        Of ``summaries`` the times that have not come by the end of the run, or are decided by noise, in some members:
        in how many.
    """

    at: Mapping[str, Any]
    members: int
    counts: Mapping[str, Mapping[str, int]]
    summaries: Mapping[tuple[str, str, str], Summary]
    differences: tuple[Difference, ...]
    pooled: tuple[str, ...] = ()
    shared: tuple[str, ...] = ()
    without: Mapping[tuple[str, str, str], int] = field(default_factory=dict)

    @cached_property
    def never(self) -> frozenset[tuple[str, str, str]]:
        """Those of them that at least half of the members with numbers lack: no mean tells anything."""
        return frozenset(key for key, count in self.without.items() if 2 * count >= self.summaries[key].n)

    @property
    def cut(self) -> dict[tuple[str, str, str], int]:
        """The others, whose means are too small."""
        return {key: count for key, count in self.without.items() if key not in self.never}

    def has_none(self, metric: str, state: str, *labels: str) -> bool:
        """Whether that is so of an observer, or of any of several; of any at all where none is named."""
        return any((m, s) == (metric, state) and (not labels or label in labels) for label, m, s in self.never)

    @property
    def independent(self) -> bool:
        """Whether the members are independent draws."""
        return not self.pooled and not self.shared

    def failed(self, observer: str) -> int:
        """How many members have no numbers of an observer."""
        return sum(n for status, n in self.counts[observer].items() if status not in ("ok", "inaccurate"))


def statistics(members: Collected, metrics: Sequence[str] = (), at: Mapping[str, Any] | None = None) -> Statistics:
    """Of all members together.

    Parameters
    ----------
    members : Collected
    metrics : sequence of str
        Which; all by default.
    at : mapping, optional
        What they have in common.
    """
    names = tuple(metrics) or tuple(members.metrics)
    summaries = {}
    for metric in names:
        found = _summaries(members.metrics[metric], members.sound, chance=members.independent)
        for (i, label), (j, state) in product(enumerate(members.observers), enumerate(members.states)):
            summaries[label, metric, state] = found[i][j]
    differences = tuple(_differences(members, names))
    without = _counted_never(members, names)
    return Statistics(
        dict(at or {}), len(members), members.counts, summaries, differences, members.grid, members.shared, without
    )


def _counted_never(members: Collected, metrics: Sequence[str]) -> dict[tuple[str, str, str], int]:
    """Of times that have none in some members, in how many."""
    found = {}
    for metric in filter(is_time, metrics):
        count = np.sum(never(members, metric), axis=0)
        for (i, label), (j, state) in product(enumerate(members.observers), enumerate(members.states)):
            if count[i, j]:
                found[label, metric, state] = int(count[i, j])
    return found


def quantiles(values: Floats, sound: NDArray[np.bool_], at: Iterable[float]) -> list[Floats]:
    """Quantiles along the first axis by linear interpolation, where what is not sound counts as infinite.

    Parameters
    ----------
    values : ndarray, shape (N, ...)
    sound : ndarray of bool, of a shape that fits that of the values
    at : iterable of float
        Between 0 and 1.

    Returns
    -------
    list of ndarray
        One for each of ``at``; NaN without members.
    """
    if len(values) == 0:
        return [np.full(values.shape[1:], np.nan) for _ in at]
    ordered = np.sort(np.where(sound, values, np.inf), axis=0)
    found = []
    for q in at:
        place = q * (len(ordered) - 1)
        low, high = ordered[int(np.floor(place))], ordered[int(np.ceil(place))]
        with np.errstate(invalid="ignore"):  # between two infinite values there is a third
            found.append(np.where(low == high, low, low + (high - low) * (place % 1)))
    return found


def _summaries(values: Floats, sound: NDArray[np.bool_], *, chance: bool) -> list[list[Summary]]:
    """For every observer and state; values of shape (N, m, n), sound (N, m); intervals only of independent draws."""
    with_state = sound[:, :, None]
    mean, sem, n = mean_of(values, with_state)
    sem = sem if chance else np.full_like(sem, np.nan)
    low, high = interval(mean, sem, n)
    spread = dict(zip(QUANTILES, quantiles(values, with_state, QUANTILES.values()), strict=True))
    return [
        [
            Summary(
                n=int(n[i, j]),
                mean=float(mean[i, j]),
                sem=float(sem[i, j]),
                ci95=(float(low[i, j]), float(high[i, j])),
                **{name: float(found[i, j]) for name, found in spread.items()},
            )
            for j in range(values.shape[2])
        ]
        for i in range(values.shape[1])
    ]


def _differences(members: Collected, metrics: Sequence[str]) -> Iterator[Difference]:
    pairs = list(combinations(range(len(members.observers)), 2))
    for metric, (j, state) in product(metrics, enumerate(members.states)):
        values = members.metrics[metric][:, :, j]
        tests = [
            paired(values[:, a], values[:, b], members.sound[:, a] & members.sound[:, b], chance=members.independent)
            for a, b in pairs
        ]
        for (a, b), (n, mean, ci95, p), adjusted in zip(pairs, tests, holm([p for *_, p in tests]), strict=True):
            yield Difference(members.observers[a], members.observers[b], metric, state, n, mean, ci95, p, adjusted)


def largest_errors(members: Collected) -> tuple[int, dict[str, float]]:
    """Of how many members an integration error is known, and the largest one of the plant and of every observer."""
    known = members.integration_error[~np.isnan(members.integration_error).all(axis=1)]
    if not len(known):
        return 0, {}
    largest = np.fmax.reduce(known, axis=0).tolist()  # NaN where none is known
    names = (PLANT, *members.observers)
    return len(known), {name: error for name, error in zip(names, largest, strict=True) if not math.isnan(error)}
