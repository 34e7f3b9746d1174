"""What an observer's equations return has the shapes of its states, or the run is refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack

import casadi as ca
import numpy as np
import pytest
from examples import Block, chain, experiment, inline

from hgorun import ConfigError
from hgorun.observers.base import OBSERVERS, AnyObserver, Flow, HybridObserver, Sample
from hgorun.observers.shgo import StandardObserver
from hgorun.simulation.simulate import prepare
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols

TWO_OUTPUTS = inline({"x1": "x2", "x2": "-x1", "x3": "x4", "x4": "x1 - x3"}, ["x1", "x3"])


class OneIntegral(StandardObserver):
    """A single integrator on the innovation, however many outputs there are."""

    def states(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"w": np.zeros(1)}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({**super().equations(plant, s, e, k).derivatives, "w": e})


class ScalarForVector(OneIntegral):
    def states(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"w": np.zeros(2)}


class Missing(OneIntegral):
    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": plant.copy(s.xhat)})


class Extra(OneIntegral):
    def states(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {}


class Correction(StandardObserver):
    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow(super().equations(plant, s, e, k).derivatives, correction=s.xhat)


class Jump(HybridObserver):
    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": plant.copy(s.xhat)})

    def jump(self, plant: PlantCopy, before: PlantCopy, s: Symbols, sample: Sample, k: Symbols) -> Mapping[str, ca.SX]:
        return {"xhat": sample.y}


class JumpOfNothing(Jump):
    def jump(self, plant: PlantCopy, before: PlantCopy, s: Symbols, sample: Sample, k: Symbols) -> Mapping[str, ca.SX]:
        return {"x": s.xhat}


CLASSES: tuple[type[AnyObserver], ...] = (OneIntegral, ScalarForVector, Missing, Extra, Correction, Jump, JumpOfNothing)


@pytest.fixture(autouse=True)
def known() -> Iterator[None]:
    with ExitStack() as stack:
        for cls in CLASSES:
            stack.enter_context(OBSERVERS.replaced(cls.__name__, cls))
        yield


def refusal(name: str, plant: Block) -> str:
    keys = {} if name.startswith("Jump") else {"theta": 2, "poles": -1}
    measured = {"sampling": {"period": 0.1}}
    other = {"type": "shgo", "theta": 2, "poles": -1}
    with pytest.raises(ConfigError) as caught:
        prepare(experiment(plant, {"it": {"type": name, **keys}, "other": other}, measurement=measured))
    assert caught.value.key == "observers.it.type"
    return str(caught.value)


@pytest.mark.parametrize(
    ("name", "plant", "words"),
    [
        (
            "OneIntegral",
            TWO_OUTPUTS,
            "equations: the derivative of w has the shape (2, 1), expected (1, 1)",
        ),
        ("ScalarForVector", chain(2), "equations: the derivative of w has the shape (1, 1), expected (2, 1)"),
        ("Missing", chain(2), "equations: no derivative of w"),
        ("Extra", chain(2), "equations: a derivative of w, which is not one of its states: xhat"),
        ("Correction", chain(2), "equations: the correction has the shape (2, 1), expected (1, 1)"),
        ("Jump", chain(2), "jump: the value of xhat has the shape (1, 1), expected (2, 1)"),
        ("JumpOfNothing", chain(2), "jump: a value of x, which is not one of its states: xhat"),
    ],
)
def test_another_shape_is_refused_at_the_observer(name: str, plant: Block, words: str) -> None:
    assert words in refusal(name, plant)


def test_one_integral_fits_one_output() -> None:
    block = {"type": "OneIntegral", "theta": 2, "poles": -1}
    assert prepare(experiment(chain(2), {"it": block})).observers[0].states["w"].size == 1
