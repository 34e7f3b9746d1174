"""Outliers: samples that an observer does not take, since they are too far from what it expects.

An innovation counts as too large beyond ``gate`` standard deviations. These are told by the observer's own covariance
where it has one, and otherwise by the median of the last innovations, which outliers do not move: 1.4826 times the
median of |e| is the standard deviation of normal numbers. Those found to be outliers are among them, so that a step of
the output is followed after some samples and does not shut the observer out for ever. While there are few of them the
median counts as larger, since that of few numbers may be small by chance, and an error at the start may still grow.
"""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from hgorun.engine.session import Session
from hgorun.estimate.covariance import Covariance
from hgorun.estimate.gate.entering import Entering
from hgorun.estimate.samples import stated
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.symbolic.evaluate import Floats

_WINDOW = 61  # innovations whose median is taken
_ROOM = 1024  # of them that stand in one list, those that are not needed any more among them
_FEWEST = 2  # of them, before anything is an outlier: one alone may be 0, where a start is the first sample
_ENOUGH = 8  # of them; the median of n < 8 counts 8/n times
_NORMAL = 1.4826  # standard deviations in a median of |e|

Innovations: TypeAlias = tuple[list[float], int]
"""Sizes of innovations, oldest first, and how many of them there were: a list to which others may be appended."""

Known: TypeAlias = Sequence[Sequence[Innovations]]
"""The innovations of every output and observer."""


Variances: TypeAlias = Sequence[Sequence[float] | None]
"""By observer the variance of the innovation of every output; None of one without a covariance."""


class RunningDeviation:
    """The standard deviation of the last innovations of one output and one observer, by their median.

    Parameters
    ----------
    least : float
        It is at least that: the noise stated for the output.
    """

    def __init__(self, least: float = 0.0) -> None:
        self.least = least
        self._last: list[float] = []  # appended to only: see `state`
        self._sorted: list[float] = []

    @property
    def value(self) -> float:
        """Infinite of a single innovation and of none, and where the first of them are 0 and no noise is stated."""
        count = len(self._sorted)
        if count < _FEWEST:
            return float("inf")
        middle = count // 2
        median = self._sorted[middle] if count % 2 else 0.5 * (self._sorted[middle - 1] + self._sorted[middle])
        if count >= _ENOUGH:
            return max(_NORMAL * median, self.least)
        return max(_NORMAL * median * (_ENOUGH / count), self.least) or float("inf")

    def add(self, innovation: float) -> None:
        """Take one more into account."""
        size = abs(innovation)
        if size != size:
            return
        last, ascending = self._last, self._sorted
        last.append(size)
        insort(ascending, size)
        if len(ascending) > _WINDOW:
            del ascending[bisect_left(ascending, last[-1 - _WINDOW])]
            if len(last) > _ROOM:
                self._last = last[-_WINDOW:]

    def state(self) -> Innovations:
        """The innovations known by now; nothing is copied."""
        return self._last, len(self._last)

    def restore(self, innovations: Innovations) -> None:
        """Those of :meth:`state` again."""
        self._last = kept_of(innovations)
        self._sorted = sorted(self._last)


def kept_of(innovations: Innovations) -> list[float]:
    """The innovations that are kept, oldest first."""
    last, count = innovations
    return last[max(count - _WINDOW, 0) : count]


class Gate:
    """Which samples are outliers to which observers, one sample after the other.

    Parameters
    ----------
    experiment : Experiment
    limits : sequence of float or None
        Of every output the standard deviations beyond which a sample is an outlier.
    covariances : sequence of Covariance or None
        Of every observer.
    """

    def __init__(
        self, experiment: Experiment, limits: Sequence[float | None], covariances: Sequence[Covariance | None]
    ) -> None:
        self._model, self._limits, self._covariances = experiment.plant.model, limits, covariances
        known = stated(experiment)
        self.deviations = [
            [RunningDeviation(known.get(output, 0.0)) for _ in experiment.observers] for output in self._model.outputs
        ]

    def outliers(
        self,
        output: int,
        innovations: Floats,
        t: float,
        z: Floats,
        w: Floats,
        members: Sequence[int] | None = None,
    ) -> list[int]:
        """The observers to which a sample of an output is an outlier, from the innovation of each, shape (m,).

        Parameters
        ----------
        t : float
        z, w : ndarray
            The states, and what was held, before the sample arrived.
        members : sequence of int, optional
            The observers that are asked, where these are not all.
        """
        limit, found = self._limits[output], []
        wrapped = self._model.wrapped(output, innovations).tolist()
        for j in range(len(wrapped)) if members is None else members:
            one, deviation, covariance = wrapped[j], self.deviations[output][j], self._covariances[j]
            known = None
            if covariance is not None and limit is not None:
                known = covariance.variance(np.array([t]), z[None], w)[0].tolist()
            if limit is not None and abs(one) > limit * _size(deviation, known, output):
                found.append(j)
            deviation.add(one)
        return found

    def passed(
        self, entering: Sequence[Entering], innovations: Mapping[int, list[float]], variances: Variances
    ) -> bool:
        """Whether no sample of some is an outlier; those up to one are added.

        Parameters
        ----------
        entering : sequence of Entering
        innovations : mapping of int to list of float
            By their slots, of every observer, without whole periods.
        variances : sequence
            Before they have arrived.
        """
        for one in entering:
            limit, deviations, values = self._limits[one.output], self.deviations[one.output], innovations[one.slot]
            for j in one.members:
                if limit is not None and abs(values[j]) > limit * _size(deviations[j], variances[j], one.output):
                    return False
                deviations[j].add(values[j])
        return True

    def state(self) -> Known:
        """The last innovations of every output and observer."""
        return [[one.state() for one in row] for row in self.deviations]

    def restore(self, known: Known) -> None:
        """Those of :meth:`state` again."""
        for row, kept in zip(self.deviations, known, strict=True):
            for one, innovations in zip(row, kept, strict=True):
                one.restore(innovations)


def variances_along(
    covariances: Sequence[Covariance | None], session: Session, stops: Sequence[int], times: Floats
) -> Sequence[Variances]:
    """Those of the innovations at some times, at whose stops a session arrives one after the other."""
    if not any(covariances):
        return [[None] * len(covariances)] * len(stops)
    z, w = np.empty((len(stops), session.z.size)), np.empty((len(stops), session.w.size))
    for k, stop in enumerate(stops):
        session.advance(stop)
        z[k], w[k] = session.z, session.w
    found = [None if one is None else one.variance(times, z, w).tolist() for one in covariances]
    return [[None if of is None else of[k] for of in found] for k in range(len(stops))]


def _size(deviation: RunningDeviation, variances: Sequence[float] | None, output: int) -> float:
    """The standard deviation of an innovation: the observer's own, where it knows one."""
    known = math.nan if variances is None else variances[output]
    return known**0.5 if known >= 0 else deviation.value
