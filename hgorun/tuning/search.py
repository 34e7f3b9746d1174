"""The search: a Sobol scan whose best candidates get more seeds, then differential evolution with what is left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hgorun.ensemble.statistics.fronts import knee, non_dominated
from hgorun.tuning.task import Floats, Task
from hgorun.tuning.trials import Trials, failure

_SCAN = 0.5  # of the budget
_FIRST, _FEW = 1, 4  # seeds of the first rounds: one shows most estimates that are lost
_KEPT = 4  # a quarter of the candidates goes on to the next round
_POPULATION = 4  # candidates for each gain, at least 6
_WEIGHTS = (0.5, 0.25, 0.75)  # of the first goal, in the directions in which a front is polished
_GRID = 2.0**40  # places in a gain's range that are told apart
_LOST = 1e9  # what counts as worse than anything, in units of the best


@dataclass(frozen=True, eq=False)
class Found:
    """What a search has found.

    Attributes
    ----------
    trials : Trials
    scanned : int
        Of the candidates, how many the first so many of the Sobol scan are.
    front : ndarray of int, shape (F,)
        Candidates that nothing tried beats, ordered by the first goal; of one goal the best alone.
    chosen : int
        The place of the knee in the front.
    ended : str
        Why runs are left for which another candidate could have been tried with all seeds; nothing where none are.
    """

    trials: Trials
    scanned: int
    front: NDArray[np.int64]
    chosen: int
    ended: str


def search(trials: Trials) -> Found:
    """Look for the gains of a task within its budget.

    Raises
    ------
    ValueError
        When no candidate that was tried keeps its estimate and meets the limits; the message says how near any came.
    """
    task = trials.task
    scanned = _scan(trials)
    ended = _polish(trials)
    best = _front(trials)
    if not best.size:
        raise ValueError(_nothing(trials))
    goals = trials.means[best][:, : len(task.goals)]
    order = np.argsort(goals[:, 0], kind="stable")
    return Found(trials, scanned, best[order], knee(goals[order]), ended)


def _scan(trials: Trials) -> int:
    """Evenly spread candidates: all with few seeds, the best with more; how many there were."""
    from scipy.stats.qmc import Sobol

    task = trials.task
    seeds = len(task.seeds)
    rounds = sorted({min(_FIRST, seeds), min(_FEW, seeds), seeds})
    cost, before = 0.0, 0
    for i, count in enumerate(rounds):
        cost, before = cost + (count - before) / _KEPT**i, count
    power = int(np.log2(max(_SCAN * task.budget / cost, 8.0)))
    u = Sobol(len(task.gains), scramble=True, **_randomness(task)).random_base2(power)
    which = trials.add(u)
    for i, count in enumerate(rounds):
        trials.run(which, count)
        if i + 1 < len(rounds):
            which = which[_order(trials, which)[: max(len(which) // _KEPT, 6)]]
    return int(u.shape[0])


def _randomness(task: Task) -> dict[str, int]:
    return {"seed": task.seeds[0]}


def _order(trials: Trials, which: NDArray[np.int64]) -> NDArray[np.int64]:
    """Places in ``which``, the best first: front after front, in each the points of the ends and the middle alike."""
    merit = _merit(trials)[which]
    if merit.shape[1] == 1:
        return np.argsort(merit[:, 0], kind="stable")
    left = np.ones(len(merit), dtype=bool)
    order: list[int] = []
    while left.any():
        layer = np.flatnonzero(left)
        layer = layer[non_dominated(merit[layer])]
        order += layer.tolist()
        left[layer] = False
    return np.array(order, dtype=np.int64)


def _merit(trials: Trials) -> Floats:
    """Goals of all candidates, finite: those that miss a limit or lose their estimate are worse than all others."""
    task = trials.task
    means = trials.means
    goals = means[:, : len(task.goals)]
    missed = np.zeros(len(means))
    for k, limit in enumerate(task.limits):
        missed += limit.excess(means[:, len(task.goals) + k])
    lost = ~np.isfinite(goals).all(axis=1) | ~np.isfinite(missed)
    sound = goals[~lost & (missed == 0)]
    scale = np.abs(sound).max(axis=0) if sound.size else np.ones(goals.shape[1])
    scale = np.where(scale > 0, scale, 1.0)
    penalty = np.where(lost, _LOST**0.5, np.where(missed > 0, 10.0 * (1.0 + np.minimum(missed, 1e3)), 0.0))
    return np.asarray(np.where(penalty[:, None] > 0, penalty[:, None] * scale, goals))


def admissible(trials: Trials) -> NDArray[np.bool_]:
    """Which candidates have been tried with all seeds, keep their estimates and meet the limits."""
    task = trials.task
    means = trials.means
    fine = trials.complete & np.isfinite(means).all(axis=1)
    for k, limit in enumerate(task.limits):
        fine &= limit.excess(means[:, len(task.goals) + k]) == 0
    return np.asarray(fine)


def _front(trials: Trials) -> NDArray[np.int64]:
    fine = np.flatnonzero(admissible(trials))
    goals = trials.means[fine][:, : len(trials.task.goals)]
    if goals.shape[1] == 1:
        return fine[np.argsort(goals[:, 0], kind="stable")[:1]]
    return fine[non_dominated(goals)]


def _polish(trials: Trials) -> str:
    """Differential evolution from the best candidates: towards the least goal, or in three directions of a front.

    What is left after it is too little for a generation: the next best of the scan are tried with all seeds. Returned
    is why runs are left in spite of it.
    """
    task = trials.task
    weights = [None] if len(task.goals) == 1 else list(_WEIGHTS)
    for i, weight in enumerate(weights):
        share = (task.budget - trials.spent) // (len(weights) - i)
        alike = _evolve(trials, weight, share)
    _complete(trials)
    if task.budget - trials.spent < len(task.seeds):
        return ""
    if alike:
        return "all candidates of the last generation were equally good, so that nothing better is found from them"
    size = _population(task)
    return f"another generation of {size} candidates takes {size * len(task.seeds)} runs"


def _complete(trials: Trials) -> None:
    """Try with all seeds those that had fewer, the best first, as far as the budget goes."""
    left = np.flatnonzero(~trials.complete)
    if left.size:
        which = left[_order(trials, left)]
        cost = np.cumsum(trials.missing(which))
        trials.run(which[cost <= trials.task.budget - trials.spent], len(trials.task.seeds))


def _population(task: Task) -> int:
    """How many candidates a generation has."""
    return max(_POPULATION * len(task.gains), 6)


def _evolve(trials: Trials, weight: float | None, budget: int) -> bool:
    """Generations from the best candidates; whether they ended because all of one were equally good."""
    from scipy.optimize import differential_evolution

    task = trials.task
    value = _Scalar(trials, weight)
    everyone = np.arange(len(trials.u))
    best = np.lexsort((value(everyone), ~trials.complete))[: _population(task)]
    seeds, size = len(task.seeds), len(best)
    generations = (budget - int(trials.missing(best).sum())) // (size * seeds)
    if generations < 1:
        return False

    def of(u: Floats) -> Floats:
        # on a grid on which SciPy's scaling to -1/2..1/2 and back is exact: the first generation costs no run again
        which = trials.add(np.round(np.clip(u.T, 0.0, 1.0) * _GRID) / _GRID)
        trials.run(which, seeds)
        return value(which)

    ended = differential_evolution(
        of,
        [(0.0, 1.0)] * len(task.gains),
        init=trials.u[best],
        maxiter=generations,
        tol=0.0,
        atol=0.0,
        polish=False,
        vectorized=True,
        updating="deferred",
        **_randomness(task),
    )
    return bool(ended.success)


class _Scalar:
    """One number to be minimised: the goal, or the larger of two weighted ones, scaled to the ends of the front.

    The scale stays what it was when the polish began, so that values can be compared.
    """

    def __init__(self, trials: Trials, weight: float | None) -> None:
        self._trials, self._weight = trials, weight
        goals = trials.means[_front(trials)][:, : len(trials.task.goals)]
        self._log = bool(goals.size and np.all(goals > 0))
        self._ends: tuple[Floats, Floats] | None = None
        if weight is not None and goals.size:
            low, high = self._scaled(goals).min(axis=0), self._scaled(goals).max(axis=0)
            self._ends = low, np.where(high > low, high - low, 1.0)

    def _scaled(self, goals: Floats) -> Floats:
        return np.asarray(np.log(np.maximum(goals, 1e-300)) if self._log else goals)

    def __call__(self, which: NDArray[np.int64]) -> Floats:
        """The numbers of candidates."""
        merit = _merit(self._trials)[which]
        if self._weight is None or self._ends is None:
            return np.asarray(merit.sum(axis=1))
        z = (self._scaled(merit) - self._ends[0]) / self._ends[1]
        weighted = z * np.array([self._weight, 1 - self._weight])
        return np.asarray(weighted.max(axis=1) + 0.01 * weighted.sum(axis=1))


def _nothing(trials: Trials) -> str:
    """Why there is nothing to choose from."""
    task = trials.task
    means = trials.means[trials.complete]
    finite = means[np.isfinite(means).all(axis=1)]
    if not finite.size:
        count = len(trials.u)
        if error := failure(task, trials.gains[0]):
            return f"{count} gains were tried, and with the first of them there is no run: {error}"
        return f"{count} gains were tried, and the observer diverges with all of them"
    told = []
    for k, limit in enumerate(task.limits):
        values = finite[:, len(task.goals) + k]
        nearest = values.min() if limit.below else values.max()
        told.append(f"{limit.text} {'below' if limit.below else 'above'} {limit.bound:g}, at best {nearest:.4g}")
    return f"no gains that were tried meet all limits: {'; '.join(told)}"
