"""Gains that recorded data speak for: sought on some samples that no observer is given, reported on others."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from hgorun.config.tuning import Range
from hgorun.data.recording import Recording, Signal
from hgorun.errors import HgorunError, Problem
from hgorun.estimate.evaluated import evaluate_run
from hgorun.estimate.holdout import part
from hgorun.estimate.prepared import prepare_estimate
from hgorun.estimate.scores import scores_of
from hgorun.simulation.experiment import Experiment
from hgorun.symbolic.evaluate import Floats

SCORES = ("holdout_rmse", "innovation_rms", "reference_rmse")
_CALL = re.compile(r"\s*(\w+)\s*\(\s*['\"]?([^'\",()]+?)['\"]?\s*,\s*['\"]?([^'\",()]+?)['\"]?\s*\)\s*")
_EVERY = 5  # samples: one of them is for the search, another for the report


@dataclass(frozen=True)
class Goal:
    """A score of an observer, of one output or state."""

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


def split(recording: Recording, goal: Goal) -> Samples:
    """Samples for the observers, for the search and for the report.

    Of an output that is held out every fifth sample is for the search, and another fifth for the report. What was
    measured for comparison alone is given to no observer: every other sample is for the search.

    Raises
    ------
    Problem
        Where nothing of that name was recorded.
    """
    if goal.score == "reference_rmse":
        if goal.name not in recording.reference:
            raise Problem(("tune", "minimise"), f"{goal}: {goal.name} is not in data.reference")
        signal = recording.reference[goal.name]
        odd = np.arange(signal.taken.size) % 2 == 1
        return Samples(
            replace(recording, reference={}), {goal.name: part(signal, ~odd)}, {goal.name: part(signal, odd)}
        )
    if goal.name not in recording.outputs:
        raise Problem(("tune", "minimise"), f"{goal}: the output {goal.name} is not in data.outputs")
    signal = recording.outputs[goal.name]
    place = np.arange(signal.taken.size) % _EVERY
    search, report = place == 1, place == _EVERY - 2
    if not (search.any() and report.any()):
        raise Problem(("tune", "minimise"), f"{goal}: {signal.taken.size} samples are too few")
    outputs = {**recording.outputs, goal.name: part(signal, ~(search | report))}
    given = replace(recording, outputs=outputs, reference={})
    return Samples(given, {goal.name: part(signal, search)}, {goal.name: part(signal, report)})


@dataclass(eq=False, repr=False)
class Trials:
    """What has been tried of one observer's gains.

    Attributes
    ----------
    experiment : Experiment
        Of that observer alone.
    gains : mapping of str to Range
        By path.
    """

    experiment: Experiment
    goal: Goal
    gains: Mapping[str, Range]
    samples: Samples
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

    def value(self, u: Floats) -> float:
        """The score on the samples of the search; infinite where the estimate is lost."""
        if len(self.tried) >= self.budget:
            return np.inf
        found = score(self.experiment.varied(self.at(u)), self.goal, self.samples.given, self.samples.search)
        self.tried.append((tuple(np.clip(u, 0.0, 1.0).tolist()), found))
        return found

    def best(self) -> dict[str, float]:
        """The gains with the smallest score.

        Raises
        ------
        HgorunError
            Where all that were tried lose the estimate.
        """
        place, least = min(self.tried, key=lambda one: one[1])
        if not np.isfinite(least):
            raise HgorunError(f"{self.goal}: {len(self.tried)} gains were tried, and all of them lose the estimate")
        return self.at(np.array(place))


def score(experiment: Experiment, goal: Goal, given: Recording, unseen: Mapping[str, Signal]) -> float:
    """The score of an experiment with one observer; infinite where the estimate is lost or cannot be made."""
    try:
        prepared = prepare_estimate(experiment, given)
        found = evaluate_run(prepared, unseen, {})
    except HgorunError:
        return np.inf
    lost = np.isfinite(found.carried.raw.diverged[0, 0])
    name = "innovation_rms" if goal.score == "innovation_rms" else "holdout_rmse"
    value = scores_of(prepared, found, 0).get(name, {}).get(goal.name, np.inf)
    return float(value) if np.isfinite(value) and not lost else np.inf


def search(trials: Trials) -> dict[str, float]:
    """The best gains: a scan of Sobol points with half of the budget, then a simplex from the best of them.

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
    best = np.array(min(trials.tried, key=lambda one: one[1])[0])
    shifts = np.vstack([np.zeros(count), 0.1 * np.eye(count)])
    simplex = np.where(best + shifts > 1, best - shifts, best + shifts)
    minimize(
        trials.value,
        best,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": max(trials.budget - len(scan), 1), "xatol": 1e-4, "fatol": 0.0},
    )
    return trials.best()
