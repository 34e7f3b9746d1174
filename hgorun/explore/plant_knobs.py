"""What of a plant can be varied on a page: its parameters, where it starts, and the numbers in its inputs.

None of these is in the equations that are compiled, but as a symbol: other values need no new code.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from hgorun.config.expressions import ExpressionError, parse
from hgorun.config.literals import template
from hgorun.config.types import number
from hgorun.explore.knobs import Knob, of_number
from hgorun.explore.target import Target, numbers_in, with_number
from hgorun.plants.base import units_of
from hgorun.simulation.experiment.experiment import Experiment

GROUP = "plant"
_MOST_FACTOR = 3.0  # of a state at the start
_LONG = 40  # characters of an expression that a label shows


def of_plant(experiment: Experiment) -> Iterator[Knob]:
    """Knobs for all numbers of the plant, those of the file and the parameters that have their defaults."""
    yield from _parameters(experiment)
    yield from _initial(experiment)
    yield from _inputs(experiment)


def _parameters(experiment: Experiment) -> Iterator[Knob]:
    """Parameters; one that follows from others is left to do so."""
    plant = experiment.plant
    known = plant.block.known_parameters
    for name, value in zip(plant.model.parameters, plant.parameters, strict=True):
        text = plant.block.parameters.get(name)
        if text is None or not parse(text).names:
            unit = known[name].unit if name in known else ""
            yield of_number(f"plant.parameters.{name}", name, GROUP, float(value), unit=unit)


def _initial(experiment: Experiment) -> Iterator[Knob]:
    units = units_of(experiment.plant.block)
    for name, found in zip(experiment.plant.model.states, experiment.plant.initial, strict=True):
        path, value = f"plant.initial.{name}", float(found)
        far = _MOST_FACTOR * value
        low, high = (min(0.0, far), max(0.0, far)) if value else (-1.0, 1.0)
        yield Knob(path, f"initial {name}", GROUP, "linear", low, high, value, (Target(path),), units.get(name, ""))


def _inputs(experiment: Experiment) -> Iterator[Knob]:
    """A constant input; else every number in its expression, such as an amplitude and a frequency."""
    units = units_of(experiment.plant.block)
    for name, text in experiment.plant.block.inputs.items():
        path = f"plant.inputs.{name}"
        try:
            yield of_number(path, f"input {name}", GROUP, float(number(text)), unit=units.get(name, ""))
        except (ValueError, ExpressionError):
            yield from _numbers(path, name, text)


def _numbers(path: str, name: str, text: str) -> Iterator[Knob]:
    """The numbers in an expression, in its order; not those that decide what is computed, such as an exponent."""
    shown = text if len(text) <= _LONG else f"{text[: _LONG - 3]}..."
    said, (kept, _) = numbers_in(text), template(parse(text))
    for i, digits in enumerate(said):
        if template(parse(with_number(text, i, 1.1 * float(digits) + 0.1)))[0] != kept:
            continue
        which = f" (its number {i + 1})" if said.count(digits) > 1 else ""
        knob = of_number(f"{path}.{i + 1}", f"{digits}{which} in {name} = {shown}", GROUP, float(digits))
        yield replace(knob, targets=(Target(path, expression=text, place=i),))
