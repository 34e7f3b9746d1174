"""Gains that recorded data speak for: sought on some samples that no observer is given, reported on others."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hgorun.config.tuning import Range
from hgorun.data.recording import Recording, Signal
from hgorun.errors import HgorunError, Problem
from hgorun.estimate.evaluated import Evaluated, evaluate_run
from hgorun.estimate.holdout import part
from hgorun.estimate.prepared import PreparedEstimate, prepare_estimate
from hgorun.estimate.samples import stated
from hgorun.estimate.scores import settled
from hgorun.estimate.starting import fitted_start
from hgorun.simulation.experiment import Experiment
from hgorun.symbolic.evaluate import Floats

SCORES = ("holdout_rmse", "innovation_rms", "reference_rmse")
_CALL = re.compile(r"\s*(\w+)\s*\(\s*['\"]?([^'\",()]+?)['\"]?\s*,\s*['\"]?([^'\",()]+?)['\"]?\s*\)\s*")
_EVERY = 5  # samples: one of them is for the search, another for the report
_FEW = 2  # gains that a simplex finds alone
_SIMPLEX = 0.1  # its sides, in the unit cube
_LITTLE = 1e-3  # of a range: for derivatives
_DAMPING = 1e-3
_ENOUGH = 1e-4  # of the square of the score: what a pass has to gain for another one


ALL = "*"  # outputs


@dataclass(frozen=True)
class Goal:
    """A score of an observer, of one output or state, or of all outputs in standard deviations of their noise."""

    score: str
    label: str
    name: str

    def __str__(self) -> str:
        return f"{self.score}({self.label}, {self.name})"


@dataclass(frozen=True, eq=False, repr=False)
class Samples:
    """A recording in three parts.

    Attributes
    ----------
    given : Recording
        What the observers get.
    search, report : mapping of str to Signal
        What they do not get: by output, or by what was measured for comparison alone.
    """

    given: Recording
    search: Mapping[str, Signal]
    report: Mapping[str, Signal]


def read_goal(text: str, place: tuple[str | int, ...]) -> Goal:
    """``holdout_rmse(LABEL, OUTPUT)``.

    Raises
    ------
    Problem
    """
    found = _CALL.fullmatch(text)
    if found is None or found[1] not in SCORES:
        message = f"of recorded data {', '.join(SCORES)} can be minimised, as in holdout_rmse(LABEL, OUTPUT)"
        raise Problem(place, f"{message}; found {text!r:.80}")
    return Goal(found[1], found[2], found[3])


def split(recording: Recording, goal: Goal, between: Mapping[str, Signal] | None = None) -> Samples:
    """Samples for the observers, for the search and for the report.

    Of an output that is held out every fifth sample is for the search, and another fifth for the report; of one of
    which the observers do not get all samples anyway, those in every other gap are for the search. What was measured
    for comparison alone is given to no observer: every other sample is for the search.

    Parameters
    ----------
    between : mapping of str to Signal, optional
        By output samples that are held out already.

    Raises
    ------
    Problem
        Where nothing of that name was recorded.
    """
    if goal.score == "reference_rmse":
        if goal.name not in recording.reference:
            raise Problem(("tune", "minimise"), f"{goal}: {goal.name} is not in data.reference")
        signal = recording.reference[goal.name]
        search, report = _halves(signal, np.arange(signal.taken.size))
        return Samples(replace(recording, reference={}), {goal.name: search}, {goal.name: report})
    names = tuple(recording.outputs) if goal.name == ALL else (goal.name,)
    outputs, searched, reported = dict(recording.outputs), {}, {}
    for name in names:
        if name not in recording.outputs:
            raise Problem(("tune", "minimise"), f"{goal}: the output {name} is not in data.outputs")
        if between and name in between:
            gaps = np.searchsorted(recording.outputs[name].taken, between[name].taken)
            searched[name], reported[name] = _halves(between[name], gaps)
        else:
            outputs[name], searched[name], reported[name] = _fifths(recording.outputs[name], goal)
    return Samples(replace(recording, outputs=outputs, reference={}), searched, reported)


def _halves(signal: Signal, numbers: np.ndarray) -> tuple[Signal, Signal]:
    """Samples with even numbers, and the others."""
    odd = numbers % 2 == 1
    return part(signal, ~odd), part(signal, odd)


def _fifths(signal: Signal, goal: Goal) -> tuple[Signal, Signal, Signal]:
    """Three fifths of the samples of an output, a fifth, and another."""
    place = np.arange(signal.taken.size) % _EVERY
    search, report = place == 1, place == _EVERY - 2
    if not (search.any() and report.any()):
        raise Problem(("tune", "minimise"), f"{goal}: {signal.taken.size} samples are too few")
    return part(signal, ~(search | report)), part(signal, search), part(signal, report)


@dataclass(frozen=True, eq=False, repr=False)
class Case:
    """An observer and a recording that its gains are tried on.

    Attributes
    ----------
    experiment : Experiment
        Of that observer alone, as the recording completes it.
    samples : Samples
    named : tuple of str, optional
        If the start follows from the first samples by a model whose parameters are sought: the states whose initial
        estimate is given nevertheless.
    """

    experiment: Experiment
    samples: Samples
    named: tuple[str, ...] | None = None

    def with_gains(self, gains: Mapping[str, float]) -> PreparedEstimate:
        """The run with some gains.

        Raises
        ------
        ConfigError
        """
        prepared = prepare_estimate(self.experiment.varied(gains), self.samples.given)
        if self.named is None:
            return prepared
        with prepared.experiment.located():
            start = fitted_start(prepared, self.samples.given.first_samples)
        ((label, observer),) = prepared.experiment.observers.items()
        start |= {state: observer.initial[state] for state in self.named}
        return prepare_estimate(prepared.experiment.varied({f"observers.{label}.initial": start}), self.samples.given)


@dataclass(eq=False, repr=False)
class Trials:
    """What has been tried of one observer's gains.

    Attributes
    ----------
    cases : sequence of Case
        One for each recording.
    gains : mapping of str to Range
        By path.
    """

    cases: Sequence[Case]
    goal: Goal
    gains: Mapping[str, Range]
    budget: int
    tried: list[tuple[tuple[float, ...], float]] = field(default_factory=list)

    def at(self, u: Floats) -> dict[str, float]:
        """The gains at a place in the unit cube."""
        found = {}
        for (path, given), place in zip(self.gains.items(), np.clip(u, 0.0, 1.0).tolist(), strict=True):
            low, high = given.ends
            value = low * (high / low) ** place if given.log is not None else low + (high - low) * place
            found[path] = float(np.clip(value, low, high))
        return found

    def errors(self, u: Floats) -> Floats | None:
        """The errors on the samples of the search; None where the estimate is lost, or nothing more may be tried."""
        if len(self.tried) >= self.budget:
            return None
        gains = self.at(u)
        if not self.tried:  # what is wrong with all gains is said, and not taken for a lost estimate
            self.cases[0].experiment.varied(gains)
        found = errors(self.cases, self.goal, gains)
        size = np.inf if found is None else float(np.sqrt(found @ found))
        self.tried.append((tuple(np.clip(u, 0.0, 1.0).tolist()), size))
        return found

    def value(self, u: Floats) -> float:
        """The score on the samples of the search; infinite where there are no errors."""
        found = self.errors(u)
        return np.inf if found is None else float(np.sqrt(found @ found))

    @property
    def least(self) -> float:
        """The smallest score."""
        return min(value for _, value in self.tried)

    @property
    def first(self) -> tuple[float, ...]:
        """Where in the unit cube the score is smallest."""
        return min(self.tried, key=lambda one: one[1])[0]

    def best(self) -> dict[str, float]:
        """The gains with the smallest score.

        Raises
        ------
        HgorunError
            Where all that were tried lose the estimate.
        """
        if not np.isfinite(self.least):
            raise HgorunError(f"{self.goal}: {len(self.tried)} gains were tried, and all of them lose the estimate")
        return self.at(np.array(self.first))


def score(cases: Sequence[Case], goal: Goal, gains: Mapping[str, float], *, report: bool = False) -> float:
    """The score with some gains, the root of its mean square over the recordings.

    Infinite where an estimate is lost or cannot be made.

    Parameters
    ----------
    report : bool
        On the samples for the report, in place of those for the search.
    """
    found = errors(cases, goal, gains, report=report)
    return float(np.sqrt(found @ found)) if found is not None else np.inf


def errors(cases: Sequence[Case], goal: Goal, gains: Mapping[str, float], *, report: bool = False) -> Floats | None:
    """The errors whose sum of squares is the score's square; None where an estimate is lost or cannot be made."""
    found = []
    for case in cases:
        try:
            prepared = case.with_gains(gains)
            evaluated = evaluate_run(prepared, case.samples.report if report else case.samples.search, {})
        except HgorunError:
            return None
        of_outputs = _errors(prepared, evaluated, goal)
        parts = [one / np.sqrt(one.size * len(of_outputs) * len(cases)) for one in of_outputs if one.size]
        lost = np.isfinite(evaluated.carried.raw.diverged[0, 0]) or not parts
        if lost or not all(np.all(np.isfinite(one)) for one in parts):
            return None
        found += parts
    return np.concatenate(found)


def _errors(prepared: PreparedEstimate, found: Evaluated, goal: Goal) -> list[Floats]:
    """What counts as errors of a run with one observer: of an output or state, or of every output."""
    noise = stated(prepared.experiment)
    size = noise if goal.name == ALL else {}
    if goal.score != "innovation_rms":
        return [one.residuals[0] / size.get(name, 1.0) for name, one in found.held_out.items()]
    chosen = [i for i, one in enumerate(prepared.samples) if goal.name in (ALL, one.output)]
    used = [found.carried.used[prepared.slots[i], 0] for i in chosen]
    outputs = [prepared.samples[i].output for i in chosen]
    return [
        settled(found.predicted[i][0][taken]) / size.get(name, 1.0)
        for i, taken, name in zip(chosen, used, outputs, strict=True)
    ]


def search(trials: Trials) -> dict[str, float]:
    """The best gains: a scan of Sobol points with half of the budget, then a search from the best of them.

    That is a simplex. Of three gains or more it begins where the method of Gauss and Newton ends, which knows that the
    score is a sum of squares and follows the narrow valleys that gains and parameters of a plant make together.

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


def _descend(trials: Trials) -> None:
    """Passes of Gauss and Newton with the damping of Levenberg and Marquardt, in the unit cube."""
    u = np.array(trials.first)
    found, damping = trials.errors(u), _DAMPING
    while found is not None and damping < 1 / _DAMPING:
        slopes = []
        for k in range(u.size):
            step = _LITTLE if u[k] + _LITTLE <= 1 else -_LITTLE
            beside = trials.errors(u + step * np.eye(u.size)[k])
            if beside is None or beside.size != found.size:
                return
            slopes.append((beside - found) / step)
        slope = np.column_stack(slopes)
        square, pull = slope.T @ slope, slope.T @ found
        while damping < 1 / _DAMPING:
            shift = np.linalg.solve(square + damping * np.diag(np.diag(square) + np.finfo(float).tiny), -pull)
            tried = np.clip(u + shift, 0.0, 1.0)
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
