"""Gains that have been tried: every quantity for every seed, computed once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.blocks.block import compute
from hgorun.ensemble.found import Block
from hgorun.ensemble.members.members import Members
from hgorun.study.sentences import Sentence
from hgorun.tuning.task import Floats, Task, is_plain


@dataclass(eq=False)
class Trials:
    """What has been tried of a task, candidate by candidate.

    Attributes
    ----------
    task : Task
    u : ndarray, shape (C, k)
        Places in the unit cube of the gains.
    values : ndarray, shape (C, S, q)
        Goals, then limits, for every seed; NaN where they have not been computed, infinite where an estimate was lost.
    spent : int
        Runs so far.
    """

    task: Task
    threads: int = 1
    told: Callable[[int], None] = lambda _: None
    u: Floats = field(init=False)
    values: Floats = field(init=False)
    spent: int = 0

    def __post_init__(self) -> None:
        self.u = np.empty((0, len(self.task.gains)))
        self.values = np.empty((0, len(self.task.seeds), len(self.task.sentences)))

    @property
    def gains(self) -> Floats:
        """The gains of all candidates, shape (C, k)."""
        return gains_at(self.task, self.u)

    @property
    def complete(self) -> NDArray[np.bool_]:
        """Which candidates have been tried with all seeds."""
        return np.asarray(~np.isnan(self.values).any(axis=(1, 2)))

    def missing(self, which: NDArray[np.int64]) -> NDArray[np.int64]:
        """How many runs each of some candidates needs until it is complete; one that is lost needs none."""
        of = self.values[which]
        return np.asarray(np.isnan(of[:, :, 0]).sum(axis=1) * ~np.isinf(of).any(axis=(1, 2)))

    @property
    def means(self) -> Floats:
        """Goals and limits of all candidates over the seeds tried so far, shape (C, q)."""
        tried: NDArray[np.bool_] = ~np.isnan(self.values[:, :, :1])
        total: Floats = np.where(tried, self.values, 0.0).sum(axis=1)
        return np.asarray(total / np.maximum(tried.sum(axis=1), 1))

    def add(self, u: Floats) -> NDArray[np.int64]:
        """Numbers of candidates at places, new ones where they are new."""
        known = {one.tobytes(): i for i, one in enumerate(self.u)}
        found = []
        fresh: list[Floats] = []
        for one in np.ascontiguousarray(u, dtype=float):
            key = one.tobytes()
            if key not in known:
                known[key] = len(self.u) + len(fresh)
                fresh.append(one)
            found.append(known[key])
        if fresh:
            self.u = np.vstack([self.u, fresh])
            empty = np.full((len(fresh), *self.values.shape[1:]), np.nan)
            self.values = np.concatenate([self.values, empty])
        return np.array(found, dtype=np.int64)

    def run(self, which: NDArray[np.int64], seeds: int) -> None:
        """Try candidates with the first so many seeds, as far as they have not been.

        A candidate that loses its estimate is infinite for the seeds left: nothing can make its mean finite.
        """
        which = np.unique(which)
        own = self.values[which][:, :seeds, 0]
        lost = np.atleast_1d(np.isinf(self.values[which]).any(axis=(1, 2)))
        self.values[which[lost]] = np.where(np.isnan(self.values[which[lost]]), np.inf, self.values[which[lost]])
        rows, columns = np.nonzero(np.isnan(own) & ~lost[:, None])
        if not rows.size:
            return
        candidates = which[rows]
        numbers = np.array(self.task.seeds)[columns]
        found = measured(self.task, self.gains[candidates], numbers, self.threads)
        self.values[candidates, columns] = found
        self.spent += len(rows)
        self.told(self.spent)


def gains_at(task: Task, u: Floats) -> Floats:
    """Gains at places in the unit cube, shape (C, k)."""
    return np.column_stack([gain.range.at(u[:, i]) for i, gain in enumerate(task.gains)])


def measured(task: Task, gains: Floats, seeds: Sequence[int] | NDArray[np.int64], threads: int = 1) -> Floats:
    """Goals and limits of runs.

    Parameters
    ----------
    gains : ndarray, shape (N, k)
    seeds : sequence of int, length N

    Returns
    -------
    ndarray, shape (N, q)
        Infinite where an estimate was lost or the run has failed.
    """
    block = _runs(task, gains, seeds, threads)
    return np.column_stack([_values(sentence, block) for sentence in task.sentences])


def failure(task: Task, gains: Floats) -> str:
    """Why there is no run with some gains, shape (k,); empty where there is one, whatever becomes of the estimate."""
    return str(_runs(task, gains[None], task.seeds[:1], 1).error[0])


def _runs(task: Task, gains: Floats, seeds: Sequence[int] | NDArray[np.int64], threads: int) -> Block:
    columns = {gain.path: gains[:, i] for i, gain in enumerate(task.gains)} | {"seed": np.asarray(seeds)}
    names = tuple(dict.fromkeys(q.function for sentence in task.sentences for q in sentence.quantities))
    return compute(task.base, Members.of(columns), metrics=names, threads=threads)


def _values(sentence: Sentence, block: Block) -> Floats:
    """A sentence for every member; what is not a number counts as lost."""
    columns = {}
    for quantity in sentence.quantities:
        i, j = block.observers.index(str(quantity.of[0][1])), block.states.index(str(quantity.state))
        columns[str(quantity)] = block.metrics[quantity.function][:, i, j]
    if is_plain(sentence):
        values = next(iter(columns.values()))
    else:
        rows = zip(*columns.values(), strict=True)
        values = np.array([sentence.value(dict(zip(columns, row, strict=True))) for row in rows])
    return np.where(np.isfinite(values), values, np.inf)
