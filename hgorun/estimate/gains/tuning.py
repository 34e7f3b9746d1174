"""Gains that recorded data speak for: sought on some samples that no observer is given, reported on others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hgorun.config.tuning import Range
from hgorun.errors import HgorunError
from hgorun.estimate.gains.cases import Case, counted, errors_of, score
from hgorun.estimate.gains.goal import Goal
from hgorun.estimate.scores.outlying import Errors, Mask, outliers, told
from hgorun.symbolic.evaluate import Floats

_FEW = 2  # gains that a simplex finds alone
_SIMPLEX = 0.1  # its sides, in the unit cube
LITTLE = 1e-5  # of a range: for derivatives, in valleys much narrower than the range
_DAMPING = 1e-3
_CHANCE = 5  # samples a gain, of which fewer are met by chance
_SAME = 1e-9  # of a score: rounding
_ENOUGH = 1e-4  # of the square of the score: what a pass has to gain for another one


@dataclass(eq=False, repr=False)
class Trials:
    """What has been tried of one observer's gains.

    Attributes
    ----------
    cases : sequence of Case
        One for each recording.
    gains : mapping of str to Range
        By path.
    left_out : sequence of ndarray of bool, optional
        Which samples the score is without.
    """

    cases: Sequence[Case]
    goal: Goal
    gains: Mapping[str, Range]
    budget: int
    tried: list[tuple[tuple[float, ...], float]] = field(default_factory=list)
    left_out: Sequence[Mask] | None = None
    _runs: list[Sequence[Errors] | None] = field(default_factory=list)  # until it is known what is left out

    def at(self, u: Floats) -> dict[str, float]:
        """The gains at a place in the unit cube."""
        places = np.clip(u, 0.0, 1.0).tolist()
        return {path: float(one.at(place)) for (path, one), place in zip(self.gains.items(), places, strict=True)}

    def errors(self, u: Floats) -> Floats | None:
        """The errors on the samples of the search; None where the estimate is lost, or nothing more may be tried."""
        if len(self.tried) >= self.budget:
            return None
        gains = self.at(u)
        if not self.tried:  # what is wrong with all gains is said, and not taken for a lost estimate
            self.cases[0].experiment.varied(gains)
        found = errors_of(self.cases, self.goal, gains)
        if self.left_out is None:
            self._runs.append(found if found is not None and any(one.gate is not None for one in found) else None)
        self.tried.append((tuple(np.clip(u, 0.0, 1.0).tolist()), score(found, self.left_out)))
        return None if found is None else counted(found, self.left_out)

    def value(self, u: Floats) -> float:
        """The score on the samples of the search; infinite where there are no errors."""
        found = self.errors(u)
        return np.inf if found is None else float(np.sqrt(found @ found))

    def leave_out(self) -> None:
        """Leave out of the score, from now on and of what has been tried, the samples that are outliers in it."""
        known = [run for run in self._runs if run is not None]
        self.left_out = outliers(known) if known else None
        if self.left_out is not None and any(out.any() for out in self.left_out):
            self.tried = [
                (place, size if run is None else score(run, self.left_out))
                for (place, size), run in zip(self.tried, self._runs, strict=True)
            ]
        self._runs.clear()

    @property
    def least(self) -> float:
        """The smallest score."""
        return min(value for _, value in self.tried)

    @property
    def first(self) -> tuple[float, ...]:
        """Where in the unit cube the score is smallest."""
        return min(self.tried, key=lambda one: one[1])[0]

    @property
    def alike(self) -> bool:
        """Whether all scores are the same, of those that do not lose the estimate."""
        found = [value for _, value in self.tried if np.isfinite(value)]
        return len(found) > 1 and self._same(max(found))

    def as_good(self, gains: Mapping[str, float]) -> bool:
        """Whether other gains give the smallest score."""
        return self._same(score(errors_of(self.cases, self.goal, gains), self.left_out))

    def _same(self, value: float) -> bool:
        return value <= self.least * (1 + _SAME)

    def best(self) -> dict[str, float]:
        """The gains with the smallest score.

        Raises
        ------
        HgorunError
            Where all that were tried lose the estimate, or no run can be made with them.
        """
        if not np.isfinite(self.least):
            for case in self.cases:
                case.with_gains(self.at(np.array(self.first)))  # which says why no run can be made
            raise HgorunError(
                f"{self.goal}: {len(self.tried)} gains were tried, and the observer diverges with all of them"
            )
        return self.at(np.array(self.first))


def search(trials: Trials) -> dict[str, float]:
    """The best gains: a scan of Sobol points with half of the budget, then a search from the best of them.

    That is a simplex. Of three gains or more it begins where the method of Gauss and Newton ends, which knows that the
    score is a sum of squares and follows the narrow valleys that gains and parameters of a plant make together. Where
    the scores of the scan are all the same, nothing follows it.

    Raises
    ------
    HgorunError
    """
    from scipy.optimize import minimize
    from scipy.stats import qmc

    count = len(trials.gains)
    scan = qmc.Sobol(count, scramble=False).random_base2(max(int(np.log2(max(trials.budget // 2, 2))), 1))
    for u in scan + 0.5 / len(scan):
        trials.value(u)
    if not np.isfinite(trials.least):
        return trials.best()  # which says so
    trials.leave_out()
    if trials.alike:
        return trials.best()
    if count > _FEW:
        _descend(trials)
    best = np.array(trials.first)
    shifts = np.vstack([np.zeros(count), _SIMPLEX * np.eye(count)])
    simplex = np.where(best + shifts > 1, best - shifts, best + shifts)
    minimize(
        trials.value,
        best,
        method="Nelder-Mead",
        options={
            "initial_simplex": simplex,
            "maxfev": max(trials.budget - len(trials.tried), 1),
            "xatol": 1e-4,
            "fatol": 0.0,
        },
    )
    return trials.best()


def reported(trials: Trials, gains: Mapping[str, float]) -> tuple[float, list[str]]:
    """The score on samples that the search has not seen, and what is told of outliers among these and the others."""
    remarks: list[str] = []
    if (found := errors_of(trials.cases, trials.goal, gains)) is not None:
        count = sum(one.values.size for one in found)
        if count < _CHANCE * len(gains):
            many = "one sample decides" if count == 1 else f"{count} samples decide"
            sought = ", ".join(path.removeprefix("observers.") for path in gains)
            chance = "so few that chance meets them: seek fewer numbers, or give more files"
            remarks.append(f"in the search {many} on {sought}, {chance}")
        remarks += told(found, trials.left_out or outliers([found]), "search")
    if (found := errors_of(trials.cases, trials.goal, gains, report=True)) is None:
        return np.inf, remarks
    left_out = outliers([found])
    return score(found, left_out), [*remarks, *told(found, left_out, "report")]


def _descend(trials: Trials) -> None:
    """Passes of Gauss and Newton with the damping of Levenberg and Marquardt, in the unit cube."""
    u = np.array(trials.first)
    found, damping = trials.errors(u), _DAMPING
    while found is not None and damping < 1 / _DAMPING:
        slopes = []
        for k in range(u.size):
            step = LITTLE if u[k] + LITTLE <= 1 else -LITTLE
            beside = trials.errors(u + step * np.eye(u.size)[k])
            if beside is None or beside.size != found.size:
                return
            slopes.append((beside - found) / step)
        slope = np.column_stack(slopes)
        while damping < 1 / _DAMPING:
            tried = u + _shift(slope, found, damping, u)
            there = trials.errors(tried)
            if there is not None and there.size == found.size and there @ there < found @ found:
                break
            if len(trials.tried) >= trials.budget:
                return
            damping *= 10
        else:
            return
        gain = 1 - (there @ there) / (found @ found)
        u, found, damping = tried, there, damping / 10
        if gain < _ENOUGH:
            return


def _shift(slope: Floats, errors: Floats, damping: float, u: Floats) -> Floats:
    """The damped step of Gauss and Newton that is best among those that stay in the unit cube.

    Cut at an end of a range, the step of all would leave a valley along which others make up for what one lacks.

    Parameters
    ----------
    slope : ndarray, shape (N, k)
    errors : ndarray, shape (N,)
    damping : float
        Over the squares of the columns.
    u : ndarray, shape (k,)
        Where it begins, in the unit cube.
    """
    from scipy.optimize import lsq_linear

    lengths = np.sqrt(damping * np.sum(slope**2, axis=0) + np.finfo(float).tiny)
    q, triangle = np.linalg.qr(np.vstack([slope, np.diag(lengths)]))
    aim = q[: errors.size].T @ -errors
    found = lsq_linear(triangle, aim, bounds=(-u, 1 - u), method="bvls").x
    return np.asarray(np.clip(u + found, 0.0, 1.0) - u)
