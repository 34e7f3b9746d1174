"""What of a configuration of recorded data can be varied: its observers, where they start, how samples are taken."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any

from hgorun.config.tuning import Range, Tune
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.explore.knobs import Knob, of_gains, of_number
from hgorun.observers.base import AnyObserver
from hgorun.simulation.experiment.experiment import Experiment


def knobs_of(experiment: Experiment, said: Source) -> tuple[Knob, ...]:
    """Everything that a page can vary.

    Parameters
    ----------
    experiment : Experiment
        The configuration as a whole one.
    said : Source
        The configuration as it is written: what the data decide is not in it.
    """
    tune = said.data.get("tune")
    ranges = {} if tune is None else validate(Tune, tune, said, ("tune",)).gains
    found: list[Knob] = []
    for label, observer in experiment.observers.items():
        given = said.data["observers"][label]
        tuned = [name for name in type(observer).model_fields if _range(ranges, f"observers.{label}.{name}")]
        found += of_gains(given, label, observer, tuned)
        found += _initial(given, label, observer)
    found += _of_data(said, experiment.blocks.time.unit)
    return tuple(_within(knob, _range(ranges, knob.name)) for knob in found)


def _initial(given: dict[str, Any], label: str, observer: AnyObserver) -> Iterator[Knob]:
    for state in given.get("initial") or {}:
        path = f"observers.{label}.initial.{state}"
        yield of_number(path, f"initial {state}", label, float(observer.initial[state]))


def _of_data(said: Source, unit: str) -> Iterator[Knob]:
    data = said.data["data"]
    for output, column in data["outputs"].items():
        for key in ("std", "gate"):
            if isinstance(column, dict) and isinstance(column.get(key), (int, float)):
                label = f"{key} of {output}"
                yield of_number(f"data.outputs.{output}.{key}", label, "measurement", float(column[key]))
    if isinstance(data.get("period"), (int, float)):
        yield of_number("data.period", "period between samples", "measurement", float(data["period"]), unit=unit)


def _range(ranges: Mapping[str, Range], path: str) -> Range | None:
    """Between which values the file seeks a gain."""
    return next((part for pattern, part in ranges.items() if fnmatchcase(path, pattern)), None)


def _within(knob: Knob, tuned: Range | None) -> Knob:
    """A knob over the range in which the file seeks its gain, which may be wider than that around its value."""
    if tuned is None or knob.scale == "integer":
        return knob
    low, high = tuned.ends
    scale = "linear" if tuned.log is None else "log"
    return replace(knob, low=min(low, knob.start), high=max(high, knob.start), scale=scale)  # type: ignore[arg-type]  # one of Scale
