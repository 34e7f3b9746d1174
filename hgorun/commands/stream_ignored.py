"""What a configuration says of files and does not happen to samples of a stream."""

from __future__ import annotations

import math
from collections.abc import Iterator

from hgorun.config.data import Data
from hgorun.data.units.units import alike
from hgorun.simulation.experiment.experiment import Experiment


def ignored(block: Data, experiment: Experiment) -> Iterator[str]:
    """What would change the numbers of a file."""
    for key, unit, wanted in in_other_units(block, experiment):
        yield f"{key}: values of a stream are not converted from {unit}: send them in {wanted}"
    for name, given in block.inputs.items():
        if given.hold == "linear":
            held = "in a stream an input is held until its next value comes, and not linear"
            yield f"data.inputs.{name}.hold: {held}, since that is not known before: send it more often"
    for name, measured in block.outputs.items():
        if measured.plausible is not None:
            yield f"data.outputs.{name}.plausible: samples of a stream are taken whatever they are"
        if measured.quality is not None:
            yield f"data.outputs.{name}.quality: a stream has no such column: send samples that are good alone"
    tables = {f"data.outputs.{name}": one.csv for name, one in block.outputs.items() if one.csv is not None}
    for key, table in {"data": block.csv, **tables}.items():
        if numbers := [text for text in table.missing if _is_number(text)]:
            taken = "values of a stream are taken whatever they are"
            yield f"{key}.csv.missing: {taken}: leave out those of {', '.join(numbers)}"


def beginnings(experiment: Experiment) -> Iterator[str]:
    """Where observers of a stream that begins start elsewhere than in a file."""
    for label, observer in experiment.observers.items():
        states = [state for state in experiment.plant.model.measures.values() if state not in observer.initial]
        if states:
            begins = f"in a stream {', '.join(states)} starts at 0, and in a file at its first sample"
            yield f"{label}: {begins}: give observers.{label}.initial"


def in_other_units(block: Data, experiment: Experiment) -> Iterator[tuple[str, str, str]]:
    """What is converted in a file: the key that says its unit there, that unit, and the one of the model."""
    units = {"time": experiment.blocks.time.unit, **experiment.plant.units}
    said = {"data.time": ("time", None if block.time is None else block.time.unit)}
    for group, columns in (("outputs", block.outputs), ("inputs", block.inputs)):
        said |= {f"data.{group}.{name}": (name, column.unit) for name, column in columns.items()}
    for key, (name, unit) in said.items():
        wanted = units.get(name, "")
        if unit is not None and wanted and not alike(unit, wanted):
            yield f"{key}.unit", unit, wanted


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
