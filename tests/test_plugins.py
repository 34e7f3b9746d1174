"""Code of other people that fails is named: kind, name and method, with its own message."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

import casadi as ca
import numpy as np
import pytest
from examples import Block, chain, experiment, simulated

import hgorun
from hgorun.analysis.finding import FINDINGS, Finding
from hgorun.analysis.report import analyze
from hgorun.analysis.subject import Subject
from hgorun.errors import ConfigError, HgorunError, PluginError
from hgorun.noise.base import NOISE, RandomNoise, TimeFunction
from hgorun.observers.base import OBSERVERS, AnyObserver, Flow
from hgorun.observers.shgo import StandardObserver
from hgorun.plants.base import PLANTS, Expressions
from hgorun.plants.van_der_pol import VanDerPol
from hgorun.result.metrics.base import METRICS, Estimates, Metric
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols

SHGO: Block = {"type": "shgo", "theta": 2, "poles": -1}


class Design(StandardObserver):
    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        raise IndexError("list index out of range")


class States(StandardObserver):
    def states(self, form: CanonicalForm) -> dict[str, Any]:
        return {"w": 0.0}


class Equations(StandardObserver):
    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": k.Gamma * e})


class Rate(StandardObserver):
    def fastest_rate(self, form: CanonicalForm) -> float:
        return 1 / 0


@pytest.mark.parametrize(
    ("cls", "words"),
    [
        (Design, "observer 'mine': design raised IndexError: list index out of range"),
        (States, "observer 'mine': states raised TypeError: w is a float, expected an array"),
        (Equations, "observer 'mine': equations raised AttributeError: nothing is called 'Gamma' here; known: "),
        (Rate, "observer 'mine': fastest_rate raised ZeroDivisionError"),
    ],
)
def test_an_observer_that_raises(cls: type[AnyObserver], words: str) -> None:
    with OBSERVERS.replaced("mine", cls), pytest.raises(PluginError) as caught:
        simulated(chain(2), {"it": {**SHGO, "type": "mine"}})
    assert str(caught.value).startswith(words)
    assert caught.value.exit_code == 1
    assert caught.value.__cause__ is not None


def test_a_plant_that_raises() -> None:
    class Mine(VanDerPol):
        def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
            return [x.x2, x.x3], [x.x1]

    with PLANTS.replaced("mine", Mine), pytest.raises(PluginError, match="plant 'mine': equations raised Attribute"):
        simulated({"type": "mine", "initial": {"x1": 1, "x2": 0}}, {"it": SHGO})


class TooMany(RandomNoise):
    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        return random.normal(size=count + 1)


class Nothing(TimeFunction):
    def symbol(self, t: ca.SX, numbers: Mapping[str, ca.SX]) -> ca.SX:
        return numbers["amplitude"]


def test_noise_that_is_wrong() -> None:
    with ExitStack() as stack:
        stack.enter_context(NOISE.replaced("many", TooMany))
        stack.enter_context(NOISE.replaced("nothing", Nothing))
        with pytest.raises(
            PluginError, match=r"noise 'many': draw returned an array of shape \(12,\), expected \(11,\)"
        ):
            simulated(chain(2), {"it": SHGO}, measurement={"sampling": {"period": 0.1}, "noise": [{"type": "many"}]})
        with pytest.raises(PluginError, match="noise 'nothing': symbol raised KeyError: 'amplitude'"):
            simulated(chain(2), {"it": SHGO}, measurement={"noise": [{"type": "nothing"}]})


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (np.zeros(3), r"measure returned an array of shape \(3,\), expected \(1, 2\)"),
        (None, r"measure returned an array of shape \(\), expected \(1, 2\)"),
        ("many", "measure raised ValueError: could not convert string to float"),
    ],
)
def test_a_metric_that_is_wrong(value: Any, words: str) -> None:
    def measured(estimates: Estimates) -> np.ndarray:
        return value

    record = Metric(name="mine", meaning="nothing", unit="state", measure=measured)
    with METRICS.replaced("mine", record), pytest.raises(PluginError, match=f"metric 'mine': {words}"):
        simulated(chain(2), {"it": SHGO})


def test_a_finding_that_fails_is_a_reason_and_the_others_go_on() -> None:
    def raising(_: Subject) -> float:
        raise KeyError("G")

    def nothing(_: Subject) -> Any:
        return None

    with ExitStack() as stack:
        for name, function in (("raising", raising), ("nothing", nothing)):
            stack.enter_context(FINDINGS.replaced(name, Finding(name=name, meaning="none", of=function)))
        one = experiment(chain(2), {"it": SHGO})
        known = FINDINGS.find("slowest_rate" if "slowest_rate" in FINDINGS.names() else FINDINGS.names()[0])
        found = analyze(one, [FINDINGS.find("raising"), FINDINGS.find("nothing"), known]).observers["it"]
    assert found.reasons["raising"] == "finding 'raising': the function raised KeyError: 'G'"
    assert found.reasons["nothing"].startswith("finding 'nothing': it returned NoneType, expected a number")
    assert set(found.values) >= {"raising", "nothing"}


def test_what_is_meant_for_the_user_passes() -> None:
    class Refusing(StandardObserver):
        def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
            raise hgorun.errors.Problem(("theta",), "too small")

    with OBSERVERS.replaced("mine", Refusing), pytest.raises(ConfigError, match=r"observers\.it\.theta: too small"):
        simulated(chain(2), {"it": {**SHGO, "type": "mine"}})
    assert issubclass(PluginError, HgorunError)
