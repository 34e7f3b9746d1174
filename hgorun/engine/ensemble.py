"""Many runs of one system, W of them side by side in vector registers, blocks of them on threads.

The members of an ensemble differ in their numbers: initial states, parameters, gain and bias of samples, held noise.
Each of them has the bits that it has alone, whatever the number of lanes and of threads. Trajectories are not kept
unless asked for: a :class:`Reduction` makes a few numbers of the rows of some lanes before the next ones are
integrated, while the rows are still in the cache.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from hgorun.engine.memory import Raw, Start
from hgorun.engine.plan import Floats, Plan
from hgorun.engine.program import Program
from hgorun.errors import PlantDiverged

LANES = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class MemberNumbers:
    """The numbers of N runs; of any strides, so that a transposed array costs nothing.

    Attributes
    ----------
    z0 : ndarray, shape (states, N)
    p : ndarray, shape (parameters, N)
    gain, bias : ndarray, shape (slots, N), or (slots,) where all have the same
    holds : ndarray, shape (hold values, N) or (hold values,)
        These three take the place of the plan's.
    bound : (offset, factor)
        As in :class:`~hgorun.engine.program.Start`.
    """

    z0: Floats
    p: Floats
    gain: Floats
    bias: Floats
    holds: Floats
    bound: tuple[float, float] = (1e6, 1e6)

    @property
    def count(self) -> int:
        """N."""
        return int(self.z0.shape[1])

    def some(self, which: slice) -> MemberNumbers:
        """Some of them, as views."""
        parts = {name: getattr(self, name) for name in ("z0", "p", "gain", "bias", "holds")}
        return replace(self, **{name: part[:, which] if part.ndim == 2 else part for name, part in parts.items()})


class Reduction(Protocol):
    """What is made of the rows of a member."""

    @property
    def size(self) -> int:
        """So many numbers a member."""

    def of(self, rows: Floats, p: Floats) -> Floats:
        """The numbers of the members of some lanes.

        Parameters
        ----------
        rows : ndarray, shape (grid points, states, lanes)
        p : ndarray, shape (parameters, lanes)

        Returns
        -------
        ndarray, shape (size, lanes)
        """


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """What N runs have given, the last axis counts the members.

    Attributes
    ----------
    reduced : ndarray, shape (reduction.size, N)
        Without a reduction, no rows.
    diverged : ndarray, shape (observers, N)
        Time of divergence of each observer, infinity where there was none.
    plant_diverged : ndarray, shape (N,)
        When the plant did; all other numbers of such a member are NaN. Infinity where it did not.
    first, last : ndarray, shape (states, N)
        The rows at the first and the last point of the grid.
    error : ndarray, shape (states, N)
        Largest local error estimate of an embedded method, zeros otherwise.
    rows : ndarray, shape (grid points, states, N), or None
        Where they were asked for.
    """

    reduced: Floats
    diverged: Floats
    plant_diverged: Floats
    first: Floats
    last: Floats
    error: Floats
    rows: Floats | None = None


class Ensemble:
    """Runs of one system with fixed steps.

    Parameters
    ----------
    program : callable
        The compiled program for a number of lanes.
    """

    def __init__(self, program: Callable[[int], Program]) -> None:
        self._program = program

    def run(
        self,
        plan: Plan,
        members: MemberNumbers,
        reduction: Reduction | None = None,
        *,
        rows: bool = False,
        threads: int = 1,
        progress: Callable[[int], None] | None = None,
    ) -> Outcome:
        """Runs that have a plan in common; its gain, bias and holds are not read.

        Parameters
        ----------
        plan : Plan
        members : MemberNumbers
            Their numbers take memory: an ensemble of a million is given in parts of some thousands.
        reduction : Reduction, optional
            The compiled one of :mod:`hgorun.result.reduction` runs in the native loop.
        rows : bool
            Keep all rows.
        threads : int
            So many at once, on as many threads.
        progress : callable, optional
            Called now and then with the number of members that are done; also the chance for Ctrl-C.
        """
        parts = []
        for first in range(0, members.count, LANES):
            some = members.some(slice(first, first + LANES))
            try:
                parts.append(_outcome(self._run(plan, some), some.p, reduction, rows))
            except PlantDiverged:
                for lane in range(some.count):
                    parts.append(self._alone(plan, some.some(slice(lane, lane + 1)), reduction, rows))
            if progress:
                progress(min(first + LANES, members.count))
        return _joined(parts, rows)

    def run_each(
        self,
        plans: Sequence[Plan],
        members: MemberNumbers,
        reduction: Reduction | None = None,
        *,
        rows: bool = False,
        threads: int = 1,
        progress: Callable[[int], None] | None = None,
    ) -> Outcome:
        """Runs each of which has a plan of its own, with its gain, bias and holds; all have one grid.

        The members' own gain, bias and holds are not read; all else as in :meth:`run`.
        """
        parts = []
        for i, plan in enumerate(plans):
            one = replace(members.some(slice(i, i + 1)), gain=plan.gain, bias=plan.bias, holds=plan.holds)
            parts.append(self._alone(plan, one, reduction, rows))
            if progress:
                progress(i + 1)
        return _joined(parts, rows)

    def _run(self, plan: Plan, some: MemberNumbers) -> Raw:
        own = replace(plan, gain=some.gain, bias=some.bias, holds=some.holds)
        start = Start(np.ascontiguousarray(some.z0), np.ascontiguousarray(some.p), some.bound)
        return self._program(some.count).run(own, start)

    def _alone(self, plan: Plan, one: MemberNumbers, reduction: Reduction | None, rows: bool) -> Outcome:
        try:
            return _outcome(self._run(plan, one), one.p, reduction, rows)
        except PlantDiverged as error:
            system = self._program(1).system
            nothing = np.full((plan.grid.size, system.states, 1), np.nan)
            raw = Raw(nothing, nothing[0], np.full((system.observers, 1), np.nan), nothing[0], nothing[0])
            return replace(_outcome(raw, one.p, reduction, rows), plant_diverged=np.array([error.at]))


def _outcome(raw: Raw, p: Floats, reduction: Reduction | None, rows: bool) -> Outcome:
    lanes = raw.rows.shape[2]
    return Outcome(
        reduced=np.empty((0, lanes)) if reduction is None else reduction.of(raw.rows, p),
        diverged=raw.diverged,
        plant_diverged=np.full(lanes, np.inf),
        first=raw.rows[0].copy(),
        last=raw.rows[-1].copy(),
        error=raw.error,
        rows=raw.rows if rows else None,
    )


def _joined(parts: Sequence[Outcome], rows: bool) -> Outcome:
    names = ["reduced", "diverged", "plant_diverged", "first", "last", "error", *(["rows"] if rows else [])]
    return Outcome(**{name: np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in names})
