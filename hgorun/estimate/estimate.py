"""From a recording and observers to a result: estimates, their bands, their scores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hgorun.config.yaml_source import Source
from hgorun.data.faults.said_places import samples_said
from hgorun.data.recording import Recording, Signal
from hgorun.estimate.completed import completed
from hgorun.estimate.prepared import PreparedEstimate, prepare_estimate
from hgorun.estimate.samples import stamps
from hgorun.estimate.scores.assessed import assess
from hgorun.estimate.scores.compared import unseen
from hgorun.estimate.scores.evaluated import Evaluated, evaluate_run
from hgorun.estimate.scores.far_off import far_off
from hgorun.estimate.scores.first_gain import too_large_at_first
from hgorun.estimate.scores.shut_out import of_start, shut_out, told_row, too_small
from hgorun.estimate.scores.why_left import why_left
from hgorun.estimate.start.first_values import known_far_behind, known_later, known_too_late
from hgorun.estimate.start.left_at_start import told_of_first
from hgorun.estimate.twins import of_references
from hgorun.observers.treatment import treatment_of
from hgorun.pieces import all_true
from hgorun.result.records.data import Integration, IntegrationError, Measurements
from hgorun.result.records.observer import ObserverResult
from hgorun.result.records.recorded import Assessed, Recorded, RecordedOutput
from hgorun.result.records.status import OK, Verdict
from hgorun.result.result import Result
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.outcome.left_out import told_left_out
from hgorun.simulation.outcome.outcome import internal
from hgorun.simulation.remarks.units import unit_remarks

_MOST = 200_000  # samples for which runs with other gains are made
_TOO_LONG = "it diverges with steps of {:.3g}, but not at that time with others: give a shorter solver.step"
_LARGE = "an integration error above the accuracy asked for"


def estimate(
    source: Source,
    recording: Recording,
    *,
    name: str = "estimate",
    text: str = "",
    held_out: Mapping[str, Signal] | None = None,
    sensitivity: bool = True,
) -> Result:
    """Run the observers of a configuration on recorded data.

    Parameters
    ----------
    source : Source
        The configuration; its plant is what the observers copy, and is not simulated.
    recording : Recording
    name, text : str
        What the result is called, and the configuration as written.
    held_out : mapping of str to Signal, optional
        By output, what is compared with the estimates and was set aside for that.
    sensitivity : bool
        Whether runs with other gains tell how much the scores depend on each.

    Raises
    ------
    ConfigError
        When the configuration does not fit together, or does not fit the data.
    """
    experiment = completed(source, recording, name, text)
    prepared = prepare_estimate(experiment, recording)
    with experiment.located():
        return estimate_prepared(prepared, recording, held_out or {}, sensitivity=sensitivity)


def estimate_prepared(
    prepared: PreparedEstimate,
    recording: Recording,
    held_out: Mapping[str, Signal],
    *,
    sensitivity: bool = False,
    with_error: bool = True,
) -> Result:
    """Carry a prepared estimate out; see :func:`estimate`, and of the error of given steps :func:`evaluate_run`."""
    found = evaluate_run(prepared, held_out, recording.reference, with_error=with_error)
    if not found.carried.judged:  # whether steps that are too long have lost an observer
        found = evaluate_run(prepared, held_out, recording.reference)
    assessed = [assess(prepared, found, j) for j in range(len(prepared.run.observers))]
    counts = {name: one.values.size for name, one in held_out.items()}
    result = result_of(prepared, recording, found, assessed, _recorded(prepared, recording, held_out, found), counts)
    if not sensitivity:
        return result
    count = sum(one.values.size for one in prepared.samples)
    if count > _MOST:  # each gain takes two more runs
        return without_sensitivity(result, count)
    from hgorun.estimate.scores.sensitivity import with_sensitivity

    return with_sensitivity(result, prepared, recording, held_out)


def without_sensitivity(result: Result, count: int) -> Result:
    """A result of so many samples that no other gains are tried, which is said."""
    told = f"{count} samples: how the scores depend on the gains is told up to {_MOST}"
    return replace(result, remarks=(*result.remarks, told))


def result_of(
    prepared: PreparedEstimate,
    recording: Recording,
    found: Evaluated,
    assessed: Sequence[Assessed],
    recorded: Recorded,
    set_aside: Mapping[str, int],
) -> Result:
    """What is told of a run.

    Parameters
    ----------
    prepared, recording, found
        The run, and what it has given.
    assessed : sequence of Assessed
        Of every observer.
    recorded : Recorded
    set_aside : mapping of str to int
        By output, how many samples were held out, in the run or not.
    """
    run, experiment = prepared.run, prepared.experiment
    model, origin, grid = run.plant.model, run.origin, found.grid
    units = {"time": run.time.unit, **run.plant.units}
    result = Result(
        name=experiment.name,
        title=experiment.blocks.title,
        time=origin + grid,
        x=np.zeros((grid.size, 0)),
        u=prepared.u(grid),
        y=np.zeros((grid.size, 0)),
        states=model.states,
        inputs=model.inputs,
        outputs=model.outputs,
        units=units,
        measurements=Measurements.nothing(len(model.outputs)),
        observers=_observers(prepared, found, assessed),
        config=experiment.text,
        resolved=experiment.resolved_later,
        seed=experiment.blocks.seed,
        integration=Integration(
            method=prepared.method,
            step=found.carried.step,
            rtol=None,
            evaluations=found.carried.evaluations,
            error=IntegrationError(
                {b.label: float(e) for b, e in zip(run.observers, found.carried.error, strict=True)}
            ),
        ),
        measures=model.measures,
        remarks=(
            *_remarks(prepared, recording, found),
            *_not_scored(found, set_aside),
            *far_off(prepared, found),
        ),
        recorded=recorded,
    )
    return replace(result, remarks=(*result.remarks, *_shut_out(prepared, recording, result)))


def _remarks(prepared: PreparedEstimate, recording: Recording, found: Evaluated) -> list[str]:
    """What was found in the data, and where estimates start from them."""
    told = [
        *map(str, (*recording.notes, *of_references(recording))),
        *unit_remarks(prepared.experiment.source, prepared.experiment.plant.model),
        *told_of_first(prepared, recording, found.carried.used),
        *known_later(prepared.experiment, recording),
        *known_too_late(recording),
        *known_far_behind(prepared.experiment, recording),
    ]
    observers = prepared.run.observers
    innovating = [j for j, block in enumerate(observers) if treatment_of(block.observer) == "innovation"]
    for one, slots in zip(prepared.samples, prepared.slots, strict=True):
        by_count = dict[int, list[str]]()  # a gate may have left out the newer ones for some observers
        for j in innovating:
            offered = found.carried.offered[slots, j]
            late = 0 if all_true(offered) else int(np.count_nonzero(~offered))
            by_count.setdefault(late, []).append(observers[j].label)
        for late, labels in by_count.items():
            by = "" if len(labels) == len(observers) else f" by {', '.join(labels)}"
            if late:
                newer = " became known after newer ones and"
                used = samples_said(late, f"{newer} is not used", f"{newer} are not used")
                told.append(f"{one.output}: {used}{by}")
        outside = recording.outputs[one.output].values.size - one.values.size
        if outside:
            why = _shortened_by(prepared.experiment, recording)
            told.append(f"{one.output}: {samples_said(outside, ' lies', ' lie')} outside of the run{why}")
    of_all = {one.output: (one.late, one.values.size) for one in prepared.samples}
    told += told_left_out(prepared.experiment.observers, of_all)
    return told


def _shortened_by(experiment: Experiment, recording: Recording) -> str:
    """Which keys let a run begin after the recording, or end before it, and what gives the whole of it."""
    time, (first, last) = experiment.blocks.time, recording.span
    shorter = {"start": (time.start, time.start > first), "end": (time.end, time.end < last)}
    told = [f"{experiment.source.told(('time', key))} = {value:g}" for key, (value, cuts) in shorter.items() if cuts]
    whole = "for the whole recording leave that out, or write `time: null` where it is inherited"
    return f": {', '.join(told)}; {whole}" if told else ""


def _not_scored(found: Evaluated, set_aside: Mapping[str, int]) -> Iterator[str]:
    """What is told of samples for comparison that have no part in a score: nothing is estimated at their times."""
    for kind, compared in (("held out", found.held_out), ("of the reference", found.reference)):
        for name in (name for name, one in compared.items() if not one.taken.size):
            yield f"{name}: no sample {kind} lies in the run, so that it has no score"
    for name, one in found.held_out.items():
        count = set_aside[name]
        if one.taken.size and (outside := count - one.taken.size):
            lie, are = ("lies", "is") if outside == 1 else ("lie", "are")
            yield f"{name}: {outside} of {samples_said(count)} held out {lie} outside of the run and {are} not scored"


def _shut_out(prepared: PreparedEstimate, recording: Recording, result: Result) -> Iterator[str]:
    """What is told of gates that leave out too much; an input without a column is what its plant has for it."""
    gates = {one.output: one.gate for one in prepared.samples if one.gate is not None}
    without = [name for name in prepared.experiment.plant.model.inputs if name not in recording.inputs]
    inputs = f", whether data.inputs should name columns of {', '.join(without)}" if without else ""
    for one in shut_out(result):
        row = "" if one.row is None else told_row(one.row.count, f" (t = {one.row.first:g} to {one.row.last:g})")
        observer, given = prepared.experiment.observers[one.label], not prepared.experiment.begun.get(one.label)
        start = of_start(one.label, observer, given=given) if one.early else ""
        yield (
            f"{one.label}: the gate of {one.output} left out {one.left_out} of {one.count} samples{row}, too many for "
            f"outliers: look at {start}the unit of the column, the model{inputs}, and "
            f"{too_small(observer, gates[one.output])}"
        )


def _observers(prepared: PreparedEstimate, found: Evaluated, assessed: Sequence[Assessed]) -> dict[str, ObserverResult]:
    """Those of all observers in the order of the configuration."""
    of = {b.label: _observer(prepared, found, j, assessed[j]) for j, b in enumerate(prepared.run.observers)}
    return {label: of[label] for label in prepared.experiment.observers}


def _observer(prepared: PreparedEstimate, found: Evaluated, j: int, assessed: Assessed) -> ObserverResult:
    block = prepared.run.observers[j]
    return ObserverResult(
        type=block.observer.type,
        xhat=found.xhat[j],
        internal=internal(block, found.rows),
        gains={name: np.asarray(value).tolist() for name, value in block.design.items()},
        dimension=sum(st.size for name, st in block.states.items() if name != "alpha"),
        verdict=_verdict(prepared, found, j),
        metrics={},
        coordinates=prepared.experiment.coordinates.get(block.label),
        unestimated=block.observer.unestimated(block.form),
        assessed=assessed,
    )


def _verdict(prepared: PreparedEstimate, found: Evaluated, j: int) -> Verdict:
    lost = float(found.carried.raw.diverged[j, 0])
    origin = prepared.run.origin
    if np.isfinite(lost) and (unresolved := too_large_at_first(prepared, j)):
        return Verdict("inaccurate", origin + lost, unresolved)
    if np.isfinite(lost) and found.carried.by_steps is not None and found.carried.by_steps[j]:
        return Verdict("inaccurate", origin + lost, _TOO_LONG.format(found.carried.step))
    if np.isfinite(lost):
        return Verdict("diverged", origin + lost, why_left(prepared, j, lost, found.carried.step))
    if np.isfinite(found.undefined[j]):
        return Verdict("undefined", origin + float(found.undefined[j]))
    solver = prepared.run.solver
    if solver.controlled and not found.carried.error[j] <= solver.accuracy:
        return Verdict("inaccurate", None, too_large_at_first(prepared, j) or _LARGE)
    return OK


def _recorded(
    prepared: PreparedEstimate, recording: Recording, held_out: Mapping[str, Signal], found: Evaluated
) -> Recorded:
    experiment = prepared.experiment
    span, outputs = (experiment.origin, experiment.time.end), {}
    place = {block.label: j for j, block in enumerate(prepared.run.observers)}  # those that replay come last in a run
    own = [place[label] for label in prepared.experiment.observers]
    for i, (one, slots) in enumerate(zip(prepared.samples, prepared.slots, strict=True)):
        nothing = np.full(one.values.size, np.nan)
        nis = [nothing if (normal := found.normal[j]) is None else normal.nis[i] for j in own]
        outputs[one.output] = RecordedOutput(
            *stamps(recording.outputs[one.output], *span),
            one.values,
            found.carried.used[slots][:, own],
            np.column_stack([found.predicted[i].of(j) for j in own]),
            np.column_stack(nis),
        )
    reference = unseen(recording.reference, *span)
    return Recorded(outputs, unseen(held_out, *span), reference, recording.origin.text)
