"""An observer on recordings: the errors that some gains leave, on samples that it is not given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hgorun.data.recording import Recording
from hgorun.errors import HgorunError
from hgorun.estimate.gains.goal import ALL, Goal, Split
from hgorun.estimate.prepared import PreparedEstimate, prepare_estimate
from hgorun.estimate.samples import stated
from hgorun.estimate.scores.evaluated import Evaluated, evaluate_run
from hgorun.estimate.scores.outlying import Errors, Mask
from hgorun.estimate.scores.scores import settled
from hgorun.estimate.start.starting import fitted_start
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.symbolic.evaluate import Floats


@dataclass(frozen=True, eq=False, repr=False)
class Case:
    """An observer and a recording that its gains are tried on.

    Attributes
    ----------
    experiment : Experiment
        Of that observer alone, as the recording completes it.
    samples : Split
    refitted : bool
        Whether the start follows from the first samples by a model whose parameters are sought; an initial estimate
        that is given, or sought itself, stays nevertheless.
    """

    experiment: Experiment
    samples: Split
    refitted: bool = False

    def with_gains(self, gains: Mapping[str, float]) -> PreparedEstimate:
        """The run with some gains.

        Raises
        ------
        ConfigError
        """
        prepared = prepare_estimate(self.experiment.varied(gains), self.samples.given)
        if not self.refitted:
            return prepared
        with prepared.experiment.located():
            start = fitted_start(prepared, self.samples.given.first_samples)
        ((label, observer),) = prepared.experiment.observers.items()
        begun = prepared.experiment.begun
        start = {state: start[state] if state in begun[label] else x for state, x in observer.initial.items()}
        again = prepared.experiment.varied({f"observers.{label}.initial": start}).with_begun(begun)
        return prepare_estimate(again, self.samples.given)


def errors_of(
    cases: Sequence[Case], goal: Goal, gains: Mapping[str, float], *, report: bool = False
) -> list[Errors] | None:
    """The errors in all recordings; None where an estimate is lost or cannot be made.

    Parameters
    ----------
    report : bool
        On the samples for the report, in place of those for the search.
    """
    found = []
    for case in cases:
        try:
            prepared = case.with_gains(gains)
            compared = case.samples.report if report else case.samples.search
            evaluated = evaluate_run(prepared, compared, {}, with_error=False)
        except HgorunError:
            return None
        parts = _errors(prepared, evaluated, case.samples.given, goal, len(cases), report=report)
        lost = np.isfinite(evaluated.carried.raw.diverged[0, 0]) or not parts
        if lost or not all(np.all(np.isfinite(one.values)) for one in parts):
            return None
        found += parts
    return found


def counted(errors: Sequence[Errors], left_out: Sequence[Mask] | None = None) -> Floats:
    """Numbers whose sum of squares is the score's square: the score is the root of its mean square over all parts."""
    kept = [one.values for one in errors]
    if left_out is not None:
        kept = [values[~out] for values, out in zip(kept, left_out, strict=True)]
    return np.concatenate([values / np.sqrt(values.size * one.parts) for one, values in zip(errors, kept, strict=True)])


def score(errors: Sequence[Errors] | None, left_out: Sequence[Mask] | None = None) -> float:
    """The score that follows from errors; infinite where there are none."""
    if errors is None:
        return np.inf
    found = counted(errors, left_out)
    return float(np.sqrt(found @ found))


def _errors(
    prepared: PreparedEstimate, found: Evaluated, given: Recording, goal: Goal, cases: int, *, report: bool
) -> list[Errors]:
    """What counts as errors of a run with one observer: of an output or state, or of every output with some.

    Innovations are of samples that the observer gets and that the search has seen. A report on them is of what is
    predicted of samples that it does not get.
    """
    noise = stated(prepared.experiment)
    units = noise if goal.name == ALL else {}
    if report or goal.score != "innovation_rms":
        gates = {name: one.gate for name, one in given.outputs.items()}
        of_outputs = [
            (name, prepared.run.origin + one.taken, one.residuals[0], gates.get(name))
            for name, one in found.held_out.items()
        ]
    else:
        chosen = [i for i, one in enumerate(prepared.samples) if goal.name in (ALL, one.output)]
        used = [found.carried.used[prepared.slots[i], 0] for i in chosen]
        of_outputs = [
            (prepared.samples[i].output, np.empty(0), settled(found.predicted[i].of(0)[taken]), None)
            for i, taken in zip(chosen, used, strict=True)
        ]
    some = [one for one in of_outputs if one[2].size]
    parts = len(some) * cases
    return [
        Errors(name, taken, values / (unit := units.get(name, 1.0)), noise.get(name, 0.0) / unit, gate, parts)
        for name, taken, values, gate in some
    ]
