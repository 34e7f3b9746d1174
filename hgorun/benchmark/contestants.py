"""Who takes part: the observers that the file of a benchmark names, and the others that there are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hgorun.benchmark.parabolas import Floats
from hgorun.benchmark.scan import Scan
from hgorun.config.benchmark import BenchmarkFile, Contestant, Knob, Others
from hgorun.config.nearest import listed, nearest
from hgorun.errors import Problem
from hgorun.observers.base import OBSERVERS, AnyObserver
from hgorun.observers.capabilities import Differentiator
from hgorun.simulation.experiment.experiment import Experiment

_EVALUATIONS = 1e6  # of the equations: a run that takes more is taken for lost


def contestants(blocks: BenchmarkFile) -> dict[str, Contestant]:
    """Label: contestant, of those of the file, and then of the others that take part."""
    found = dict(blocks.observers)
    if blocks.others is not None:
        for name, one in sorted(_unnamed(blocks).items()):
            knob = _knob_of(one, blocks.others)
            if knob is not None and name not in found:
                found[name] = _joined(name, one, knob, blocks.others)
    return found


def absent(blocks: BenchmarkFile) -> dict[str, str]:
    """Type: why it does not take part, of all observers that there are."""
    others, found = blocks.others, dict(blocks.without)
    for name, one in _unnamed(blocks).items():
        if others is None:
            found[name] = "the file does not name it"
        elif _knob_of(one, others) is None:
            found[name] = f"none of its keys is a knob ({', '.join(knob.key for knob in others.knobs)})"
    return dict(sorted(found.items()))


def check_types(blocks: BenchmarkFile) -> None:
    """Refuse observers that there are not.

    Raises
    ------
    Problem
    """
    known = OBSERVERS.names()
    for path, name in [
        *((("observers", label, "block", "type"), one.block["type"]) for label, one in blocks.observers.items()),
        *((("without", name), name) for name in blocks.without),
    ]:
        if name not in known:
            there = listed(known, name, "hgorun list observers")
            raise Problem(path, f"no observer is called {name!r}.{nearest(name, known)} Known: {there}")


def _unnamed(blocks: BenchmarkFile) -> dict[str, type[AnyObserver]]:
    """Observers of which the file says nothing."""
    named = {one.block["type"] for one in blocks.observers.values()} | blocks.without.keys()
    return {name: one for name, one in OBSERVERS.all().items() if name not in named}


def _knob_of(one: type[AnyObserver], others: Others) -> Knob | None:
    return next((knob for knob in others.knobs if knob.key in one.model_fields), None)


def _joined(name: str, one: type[AnyObserver], knob: Knob, others: Others) -> Contestant:
    group = "differentiator" if issubclass(one, Differentiator) else others.group
    return Contestant.model_validate({"group": group, "knob": knob, "block": {"type": name}})


def with_knob(knob: Knob, values: Floats) -> dict[str, NDArray[Any]]:
    """Keys of the block with what they are at some values of the knob."""
    own = values.astype(np.int64) if knob.whole else values
    return {knob.key: own, **{key: factor * values for key, factor in knob.follow.items()}}


def _needed(name: str, states: tuple[str, ...]) -> dict[str, object]:
    """Keys that have to be given, as its example has them."""
    one = OBSERVERS.find(name)
    return {key: value for key, value in one.example(states).items() if one.model_fields[key].is_required()}


def contestant_in(base: Experiment, label: str, one: Contestant, rate: float) -> Experiment:
    """The plant and scenario of a base with a contestant in place of its observer, whose initial estimate it gets.

    Raises
    ------
    ConfigError
        When the observer does not take the plant, or what is measured of it.
    """
    (reference,) = base.observers
    middle = with_knob(one.knob, Scan(one.knob, rate).at(np.array([0.5])))
    block: Mapping[str, Any] = {
        **_needed(one.block["type"], tuple(base.plant.model.states)),
        **one.block,
        "initial": dict(base.observers[reference].initial),
    }
    for key, value in middle.items():
        block = _put(block, key.split("."), value[0].item())
    changes: dict[str, Any] = {"observers": {label: block}}
    if one.steps == "auto":
        changes["solver"] = {"method": "auto", "max_evaluations": _EVALUATIONS}
    return base.varied(changes)


def _put(block: Any, keys: Sequence[str], value: object) -> Any:
    """A block with a value at a path of keys and of indices of lists."""
    if not keys:
        return value
    first, *rest = keys
    if isinstance(block, list):
        return [_put(item, rest, value) if str(i) == first else item for i, item in enumerate(block)]
    return {**block, first: _put(block.get(first, {}), rest, value)}
