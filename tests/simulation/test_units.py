"""The same plant in other units, another order, with another clock gives the same numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import examples
import numpy as np
import pytest

import hgorun
from hgorun.errors import ConfigError


@dataclass(frozen=True)
class Plant:
    """Equations of states, inputs u and v and time; outputs; the observers that take it, without theta."""

    dynamics: Mapping[str, str]
    outputs: Mapping[str, str]
    initial: Mapping[str, float]
    observers: tuple[str, ...] = ("shgo", "fhgo2")
    inputs: Mapping[str, str] = field(default_factory=dict)


PLANTS = {
    "chain": Plant({"a": "b - a", "b": "c - a*b", "c": "-a - 2*b - 2*c"}, {"y": "a"}, {"a": 1, "b": 0.5, "c": -0.3}),
    "driven": Plant({"a": "b - a", "b": "u - b"}, {"y": "a"}, {"a": 1, "b": 0}, inputs={"u": "cos(3*t)"}),
    "van der Pol": Plant({"a": "b", "b": "(1 - a**2)*b - a"}, {"y": "a"}, {"a": 1, "b": 0}, ("shgo", "treangle")),
    "pendulum": Plant({"a": "b", "b": "-9.81*sin(a) - 0.1*b"}, {"y": "a"}, {"a": 1, "b": 0}),
    "squares": Plant({"a": "b*b - a", "b": "-b + 0.2*a"}, {"y": "a"}, {"a": 1, "b": 0.9}),
    "product": Plant({"a": "a*b - a", "b": "-b + u"}, {"y": "a"}, {"a": 1, "b": 1.2}, inputs={"u": "1 + sin(t)/2"}),
    "output": Plant({"a": "b", "b": "-a"}, {"y": "a + a**3"}, {"a": 1, "b": 0}),
    "sum": Plant({"a": "b - a", "b": "-a - b"}, {"y": "a + 2*b"}, {"a": 1, "b": 0.5}),
    "two": Plant({"a": "c - a", "b": "0.3*c - b", "c": "-c"}, {"y": "a", "z": "b"}, {"a": 1, "b": 0.5, "c": 1}),
    "meeting": Plant(
        {"a": "b - a", "b": "-a + 0.1*d", "c": "d - c", "d": "-c*a - d"},
        {"y": "a", "z": "c"},
        {"a": 1, "b": 0.5, "c": 1, "d": 0.2},
    ),
    "redundant": Plant({"a": "b", "b": "-a"}, {"y": "a", "z": "2*a"}, {"a": 1, "b": 0}),
    "not one": Plant({"a": "-a", "b": "a - b"}, {"y": "a"}, {"a": 1, "b": 0.5}, ("shgo",)),
    "hidden": Plant({"a": "b*(1 + u)", "b": "-a"}, {"y": "a"}, {"a": 1, "b": 1}, ("shgo",), {"u": "sin(t)"}),
}
SAMPLING, STD = 0.05, 0.01


@dataclass(frozen=True)
class Units:
    """One of the old unit in new ones, by name; time by ``t``; and how the lists are ordered."""

    sizes: Mapping[str, float] = field(default_factory=dict)
    backwards: bool = False

    def of(self, name: str) -> float:
        return self.sizes.get(name, 1.0)

    def rewritten(self, text: str) -> str:
        """An expression of the old quantities with the new ones in it."""
        return re.sub(r"\b[abcdtu]\b", lambda m: f"({m[0]}/{self.of(m[0])!r})", text)


def outcome(plant: Plant, units: Units, kind: str) -> dict[str, np.ndarray] | str:
    """Trajectories in the old units by state, or why there are none."""
    t = units.of("t")
    names, outputs = list(plant.dynamics), list(plant.outputs)
    if units.backwards:
        names, outputs = names[::-1], outputs[::-1]
    measured = {
        name: {"sampling": {"period": SAMPLING * t}, "noise": [{"type": "gaussian", "std": STD * units.of(name)}]}
        for name in outputs
    }
    block = {
        "states": names,
        "dynamics": {s: f"{units.of(s) / t!r}*({units.rewritten(plant.dynamics[s])})" for s in names},
        "output": {name: f"{units.of(name)!r}*({units.rewritten(plant.outputs[name])})" for name in outputs},
        "initial": {s: plant.initial[s] * units.of(s) for s in names},
        "inputs": {name: f"{units.of(name)!r}*({units.rewritten(text)})" for name, text in plant.inputs.items()},
    }
    guess = {s: 0.8 * plant.initial[s] * units.of(s) for s in names}
    observers = {"o": {"type": kind, "theta": 2 / t, "initial": guess}}
    try:
        run = examples.experiment(
            block, observers, end=2 * t, output_step=0.1 * t, step=5e-3 * t, measurement={"outputs": measured}
        )
        # beyond which numbers an observer counts as diverged is one number for all of its states, of whatever unit
        result = hgorun.simulate(run.varied({"solver.divergence": 1e250}))
    except ConfigError as error:
        return re.sub(r"\d|slope \S+|rank \S+", "", error.message.split("; observer")[0])
    scales = np.array([units.of(s) for s in result.states])
    both = np.column_stack([result.x / scales, result.observers["o"].xhat / scales])
    return dict(zip([*result.states, *(s + "hat" for s in result.states)], both.T, strict=True))


CASES = [(name, kind) for name, plant in PLANTS.items() for kind in plant.observers]


@pytest.mark.one_in(2)
@pytest.mark.measured_once
@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind"), CASES)
def test_units_and_order_do_not_matter(name: str, kind: str) -> None:
    plant = PLANTS[name]
    reference = outcome(plant, Units(), kind)
    random = np.random.default_rng(sum(map(ord, name)))
    quantities = [*plant.dynamics, *plant.outputs, *plant.inputs, "t"]
    for trial in range(3):
        powers = random.integers(-12, 13, len(quantities)) if trial else random.integers(-3, 4, len(quantities))
        units = Units({q: 10.0 ** int(p) for q, p in zip(quantities, powers, strict=True)}, backwards=trial != 1)
        other = outcome(plant, units, kind)
        if isinstance(reference, str) or isinstance(other, str):
            assert other == reference, units
            continue
        for state, values in reference.items():
            size = np.max(np.abs(values))
            np.testing.assert_allclose(other[state], values, rtol=1e-9, atol=1e-9 * size, err_msg=f"{state} {units}")
