"""An observer on recordings: the errors that some gains leave, on samples that it is not given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.errors import HgorunError
from hgorun.estimate.evaluated import Evaluated, evaluate_run
from hgorun.estimate.goal import ALL, Goal, Samples
from hgorun.estimate.prepared import PreparedEstimate, prepare_estimate
from hgorun.estimate.samples import stated
from hgorun.estimate.scores import settled
from hgorun.estimate.starting import fitted_start
from hgorun.simulation.experiment import Experiment
from hgorun.symbolic.evaluate import Floats


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
            compared = case.samples.report if report else case.samples.search
            evaluated = evaluate_run(prepared, compared, {}, with_error=False)
        except HgorunError:
            return None
        of_outputs = _errors(prepared, evaluated, goal, report)
        parts = [one / np.sqrt(one.size * len(of_outputs) * len(cases)) for one in of_outputs if one.size]
        lost = np.isfinite(evaluated.carried.raw.diverged[0, 0]) or not parts
        if lost or not all(np.all(np.isfinite(one)) for one in parts):
            return None
        found += parts
    return np.concatenate(found)


def _errors(prepared: PreparedEstimate, found: Evaluated, goal: Goal, report: bool) -> list[Floats]:
    """What counts as errors of a run with one observer: of an output or state, or of every output.

    Innovations are of samples that the observer gets and that the search has seen. A report on them is of what is
    predicted of samples that it does not get.
    """
    noise = stated(prepared.experiment)
    size = noise if goal.name == ALL else {}
    if report or goal.score != "innovation_rms":
        return [one.residuals[0] / size.get(name, 1.0) for name, one in found.held_out.items()]
    chosen = [i for i, one in enumerate(prepared.samples) if goal.name in (ALL, one.output)]
    used = [found.carried.used[prepared.slots[i], 0] for i in chosen]
    outputs = [prepared.samples[i].output for i in chosen]
    return [
        settled(found.predicted[i].of(0)[taken]) / size.get(name, 1.0)
        for i, taken, name in zip(chosen, used, outputs, strict=True)
    ]
