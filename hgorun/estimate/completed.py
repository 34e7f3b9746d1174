"""A configuration with data as a whole one: what the data decide is filled in."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any

from hgorun.config.models import ExperimentBlocks
from hgorun.config.nearest import among
from hgorun.config.overrides import replaced
from hgorun.config.types import Block
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.data.recording import Recording
from hgorun.errors import ConfigError, HgorunError, Problem
from hgorun.estimate.intervals import mean_intervals, offset_of, period_of
from hgorun.estimate.prepared import prepare_estimate
from hgorun.estimate.start.first_values import first_values, require_known
from hgorun.estimate.start.guess import guessed
from hgorun.estimate.stated_of_data import StatedOfData, noisy
from hgorun.estimate.steps.output_step import FEWEST, output_step
from hgorun.measurement.blocks import Measurement
from hgorun.observers.base import OBSERVERS
from hgorun.plants.base import units_of
from hgorun.simulation.experiment.blocks import plant_of
from hgorun.simulation.experiment.experiment import Begun, Experiment

_OF_NOISE = ("noise", "mode")  # what a measurement block says beside data: when samples come is in these


def completed(source: Source, recording: Recording, name: str, text: str) -> Experiment:
    """The experiment that the observers run in.

    The span of the data is that of the run, unless ``time`` says otherwise, and the output step is their median gap, or
    a part of it in a short log.
    When samples come is decided by the data; the measurement block is asked for the noise alone. Filters of samples are
    designed for the mean time between those of the run. States that are measured start from the first sample of each,
    where an observer's ``initial`` does not name them; or all states that it does not name start where the model passes
    nearest to the first samples, if several are to be used.

    Parameters
    ----------
    source : Source
        The configuration, its ``data`` included.
    recording : Recording
    name, text : str
        As of :class:`~hgorun.simulation.experiment.experiment.Experiment`.

    Raises
    ------
    ConfigError
    """
    source = with_inputs(source, recording.inputs)
    given: Mapping[str, Any] = source.data
    changes: dict[str, Any] = {}
    start: object = None
    end: object = None
    if isinstance(of_time := given.get("time") or {}, dict):
        with source.located():
            time = _time(of_time, recording, given.get("metrics"))
        start, end = time["start"], time["end"]
        changes = {f"time.{key}": value for key, value in time.items() if key not in of_time}  # lines of others stay
    if not (isinstance(given.get("plant"), dict) and given["plant"]):
        return Experiment(_with(source, changes), name=name, text=text)  # which says what is wrong
    _check_measurement(source)
    with source.located():
        _check_outputs(plant_of(source).output_names, recording)
    begin = float(start) if isinstance(start, (int, float)) else recording.span[0]
    changes["measurement"] = _measurement(given.get("measurement") or {}, recording, begin)
    whole, guess = _with_plant(_with(source, changes))
    intervals = mean_intervals(recording, begin, float(end) if isinstance(end, (int, float)) else recording.span[1])

    def built(whole: Source) -> Experiment:
        return Experiment(whole, name=name, text=text).with_intervals(intervals).with_recorded(recording.inputs)

    experiment = built(whole)
    with experiment.located():
        _check_names(experiment, recording)
    measured, others = first_values(experiment, recording), dict[str, float]()
    changes = {}
    if not given["plant"].get("initial") and measured:
        changes["plant.initial"] = {**guess, **measured}
    sought = set(guess) if recording.start_is_fitted else set(measured)
    judged = recording.start_is_fitted or any(one.gate is not None for one in recording.outputs.values())
    if judged and not all(sought <= set(one.initial) for one in experiment.observers.values()):
        there = changes | _begin(experiment, guess | measured if recording.start_is_fitted else measured)
        others = _start_in(built(_with(whole, there)), recording)
    first = others if others.keys() >= measured.keys() else measured | others
    changes |= _begin(experiment, first)
    if not changes:
        return experiment
    begun: Begun = {
        label: {state: "model" if state in others else "sample" for state in first if state not in one.initial}
        for label, one in experiment.observers.items()
    }
    return built(_with(whole, changes)).with_begun(begun)


def _begin(experiment: Experiment, first: Mapping[str, float]) -> dict[str, Any]:
    """The keys with which observers begin there, where their own ``initial`` does not name a state."""
    starts = {label: {**first, **one.initial} for label, one in experiment.observers.items()}
    changed = {label: start for label, start in starts.items() if start != experiment.observers[label].initial}
    return {f"observers.{label}.initial": start for label, start in changed.items()}


def _start_in(guess: Experiment, recording: Recording) -> dict[str, float]:
    """By state where the model says that observers begin which have no start; nothing where that is the first sample.

    Raises
    ------
    ConfigError
    """
    from hgorun.estimate.start.left_at_start import first_moved  # only here
    from hgorun.estimate.start.starting import fitted_start

    if recording.start_is_fitted:
        with guess.located():
            return fitted_start(prepare_estimate(guess, recording), recording.first_samples)
    try:
        return first_moved(prepare_estimate(guess, recording))
    except HgorunError:  # what is wrong is said when the run is prepared
        return {}


def streamed(source: Source, said: StatedOfData, name: str) -> Experiment:
    """The experiment that the observers of a stream run in.

    Parameters
    ----------
    source : Source
        The configuration.
    said : StatedOfData
        What its block ``data`` says of samples.

    Raises
    ------
    ConfigError
        Also where neither ``time`` nor ``solver.step`` says how long a step may be.
    """
    source = with_inputs(source, said.inputs)
    given: Mapping[str, Any] = source.data if isinstance(source.data, dict) else {}
    changes: dict[str, Any] = {}
    if "time" not in given:
        solver = given.get("solver")
        if not isinstance(solver, dict) or not isinstance(solver.get("step"), (int, float)):
            raise ConfigError("a stream without end needs solver.step", file=source.where(())[0] or None, key="solver")
        changes["time"] = {"end": 1.0, "output_step": 1.0}
    elif isinstance(given["time"], dict):
        start = given["time"].get("start", 0.0)
        if isinstance(start, (int, float)):
            changes["time"] = {"end": start + 1.0, "output_step": 1.0} | given["time"]
    if not isinstance(given.get("plant"), dict):
        return Experiment(_with(source, changes), name=name)  # which says what is wrong
    _check_measurement(source)
    measurement = dict(given.get("measurement") or {})
    outputs = noisy(measurement.get("outputs") or {}, said.std)
    # that outputs are sampled is known; how often, only where the block says so
    start = changes.get("time", {}).get("start", 0.0)
    changes["measurement"] = {"sampling": {"times": [start]}} | measurement | {"outputs": outputs}
    return Experiment(_with_plant(_with(source, changes))[0], name=name)


def _check_measurement(source: Source) -> None:
    """Refuse blocks that are no mappings, and so cannot be completed.

    Raises
    ------
    ConfigError
    """
    measurement = source.data.get("measurement") or {}
    outputs = (measurement.get("outputs") or {}) if isinstance(measurement, dict) else {}
    of_outputs = outputs.values() if isinstance(outputs, dict) else ()
    if not all(isinstance(one or {}, dict) for one in (measurement, outputs, *of_outputs)):
        validate(Measurement, measurement, source, ("measurement",))


def with_inputs(source: Source, inputs: Iterable[str]) -> Source:
    """The configuration with the inputs that come with the data, whatever its plant says of them."""
    plant = source.data.get("plant") if isinstance(source.data, dict) else None
    given = (plant.get("inputs") or {}) if isinstance(plant, dict) else None
    names = dict.fromkeys(inputs, "0")
    return _with(source, {"plant.inputs": {**given, **names}}) if names and isinstance(given, dict) else source


def _with_plant(source: Source) -> tuple[Source, dict[str, Any]]:
    """The configuration with all that a plant's block needs where nothing is simulated; and its initial state."""
    initial = guessed(source.data, plant_of(source).state_names)
    return _with(source, {"plant.initial": initial}), initial


def _with(source: Source, changes: Mapping[str, Any]) -> Source:
    """The configuration with other values."""
    for path, value in changes.items():
        source, _ = replaced(source, path, value)
    return source


def _time(given: Mapping[str, Any], recording: Recording, metrics: object) -> dict[str, Any]:
    start, end = recording.span
    if "end" not in given:
        require_known(recording)
    found: dict[str, Any] = {"start": start, "end": end, "unit": recording.origin.unit} | dict(given)
    if _numbers(found):
        _require_data(found["start"], found["end"], start, end, given)
    if "output_step" not in found:
        span = float(found["end"]) - float(found["start"]) if _numbers(found) else end - start
        recorded = isinstance(metrics, dict) and "record" in metrics  # a multiple of the gap, or a part of it
        found["output_step"] = output_step(recording.median_gap, span, least=1 if recorded else FEWEST)
    return found


def _require_data(begin: float, stop: float, start: float, end: float, given: Mapping[str, Any]) -> None:
    """Refuse a run without data, and one of no length: of samples of one time, ``time`` may give it one.

    What is told is the end of the run that is given, if one is and the other is not.

    Raises
    ------
    Problem
    """
    one_time = not end > start
    if one_time and begin == stop == start:
        message = f"all samples are of one time, {start:g}: there is nothing to follow but in a longer run, of time.end"
        raise Problem(("data",), message)
    if begin > end or stop < start or (not one_time and (begin == end or stop == start)):
        key = "start" if begin >= end and ("start" in given or "end" not in given) else "end"
        raise Problem(("time", key), f"there are no data then: they are from {start:g} to {end:g}")


def _numbers(time: Mapping[str, Any]) -> bool:
    return all(isinstance(time[key], (int, float)) for key in ("start", "end"))


def _measurement(given: Mapping[str, Any], recording: Recording, start: float) -> dict[str, Any]:
    """The noise of the block, and every output sampled about as often as it was recorded; of one sample as it says."""
    found = {key: given[key] for key in _OF_NOISE if key in given}
    outputs: dict[str, Any] = {}
    of_outputs = given.get("outputs") or {}
    for name in [*recording.outputs, *(name for name in of_outputs if name not in recording.outputs)]:
        block = of_outputs.get(name) or {}
        outputs[name] = {key: block[key] for key in _OF_NOISE if key in block}
        signal = recording.outputs.get(name)
        if signal is not None:
            told = block.get("sampling") or given.get("sampling")
            if not (told and signal.taken.size == 1):
                stated = told.get("period") if isinstance(told, dict) else None
                told = {"period": period_of(signal.taken, stated), **offset_of(signal.taken, start)}
            outputs[name]["sampling"] = told
    std = {name: signal.std for name, signal in recording.outputs.items() if signal.std is not None}
    return {**found, "outputs": noisy(outputs, std)}


def ready(source: Source) -> None:
    """Make ready what checks a configuration, which takes longer than to check one: files may be read meanwhile."""
    observers = source.data.get("observers") if isinstance(source.data, dict) else None
    blocks = observers.values() if isinstance(observers, dict) else ()
    checks: list[type[Block]] = [ExperimentBlocks, Measurement]
    for block in blocks:
        with suppress(KeyError, HgorunError):  # what is wrong is said when it is checked
            if isinstance(block, dict):
                checks.append(OBSERVERS.find(str(block["type"])))
    for one in checks:
        one.model_rebuild()


def plant_units(source: Source) -> dict[str, str]:
    """Units of the plant's states and outputs; nothing where its block is wrong, which is said later."""
    block = source.data.get("plant")
    return units_of(plant_of(source)) if isinstance(block, dict) else {}


def plant_periods(source: Source) -> dict[str, float]:
    """Of the plant's outputs that are known up to whole periods."""
    block = source.data.get("plant")
    return dict(plant_of(source).periods) if isinstance(block, dict) else {}


def _check_outputs(outputs: tuple[str, ...], recording: Recording) -> None:
    """Every output has to be recorded, and nothing else can be."""
    for name in recording.outputs:
        if name not in outputs:
            raise Problem(
                ("data", "outputs", name),
                f"no output of the plant; there are {among(name, outputs)}",
            )
    missing = [name for name in outputs if name not in recording.outputs]
    if missing:
        raise Problem(("data", "outputs"), f"the output {missing[0]} of the plant is not among them")


def _check_names(experiment: Experiment, recording: Recording) -> None:
    """What is recorded for comparison has to be something of the plant."""
    model = experiment.plant.model
    for name in recording.reference:
        if name not in {*model.states, *model.outputs}:
            known = tuple(dict.fromkeys((*model.states, *model.outputs)))
            said = f"neither a state nor an output; there are {among(name, known)}"
            raise Problem(("data", "reference", name), said)
