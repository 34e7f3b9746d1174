"""Code of other people that fails is named: kind, name and method, with its own message."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from contextlib import ExitStack
from inspect import getattr_static
from types import FunctionType, new_class
from typing import Any, cast

import casadi as ca
import numpy as np
import pytest
from examples import Block, chain, experiment, simulated
from pydantic import model_validator

import hgorun
from hgorun.analysis.finding import FINDINGS, Finding
from hgorun.analysis.report import analyze
from hgorun.analysis.subject import Subject
from hgorun.config.plugin import Plugin
from hgorun.errors import ConfigError, HgorunError, PluginError
from hgorun.noise.base import NOISE, Noise, RandomNoise, TimeFunction
from hgorun.noise.gaussian import GaussianNoise as Gaussian
from hgorun.noise.sinusoids import Sinusoids
from hgorun.observers.base import OBSERVERS, AnyObserver, ContinuousObserver, Flow, Observer, SampledObserver
from hgorun.observers.capabilities import HighGain
from hgorun.observers.hgo_fd import ForwardDifferenceObserver as SampledEuler
from hgorun.observers.shgo import StandardObserver
from hgorun.plants.base import PLANTS, Expressions, Invertible, Plant, TriangularCoordinates
from hgorun.plants.bioreactor_gauthier import GauthierBioreactor as Gauthier
from hgorun.plants.contois import Contois
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
        (States, "observer 'mine': states has a float for w, expected an array"),
        (Equations, "observer 'mine': equations raised AttributeError: nothing is called 'Gamma' here; known: "),
        (Rate, "observer 'mine': fastest_rate raised ZeroDivisionError"),
    ],
)
def test_an_observer_that_raises(cls: type[AnyObserver], words: str) -> None:
    with OBSERVERS.replaced("mine", cls), pytest.raises(PluginError) as caught:
        simulated(chain(2), {"it": {**SHGO, "type": "mine"}})
    # the block that names the class, what went wrong, and where in its file
    assert re.match(rf"test:\d+: observers\.it: {re.escape(words)}", str(caught.value)), caught.value
    line = inspect.getsourcelines(cls)[1] + 2
    assert cls is States or str(caught.value).endswith(f" (test_plugins.py:{line})")
    assert caught.value.exit_code == 2
    assert cls is States or caught.value.__cause__ is not None


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
    assert re.fullmatch(
        r"finding 'raising': the function raised KeyError: 'G' \(test_plugins\.py:\d+\)", found.reasons["raising"]
    )
    assert found.reasons["nothing"].startswith("finding 'nothing': it returned NoneType, expected a number")
    assert set(found.values) >= {"raising", "nothing"}


def test_what_is_meant_for_the_user_passes() -> None:
    class Refusing(StandardObserver):
        def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
            raise hgorun.errors.Problem(("theta",), "too small")

    with OBSERVERS.replaced("mine", Refusing), pytest.raises(ConfigError, match=r"observers\.it\.theta: too small"):
        simulated(chain(2), {"it": {**SHGO, "type": "mine"}})
    assert issubclass(PluginError, HgorunError)


def _declared(*bases: type) -> list[tuple[type, str]]:
    """Every public method and property that a class of other people may define."""
    return [
        (base, name)
        for base in bases
        for name, value in vars(base).items()
        if not name.startswith("_") and isinstance(value, (FunctionType, property, classmethod))
    ]


HOOKS = [
    *((StandardObserver, name) for base, name in _declared(Observer, ContinuousObserver, HighGain)),
    *((SampledEuler, name) for base, name in _declared(SampledObserver)),
    *((Contois, name) for base, name in _declared(Plant, Invertible)),
    *((Gauthier, name) for base, name in _declared(TriangularCoordinates)),
    *((Sinusoids, name) for base, name in _declared(Noise, TimeFunction)),
    *((Gaussian, name) for base, name in _declared(RandomNoise)),
]
KINDS = {Observer: "observer", Plant: "plant", Noise: "noise"}
NEEDED: dict[type, Block] = {
    StandardObserver: SHGO,
    SampledEuler: {"type": "x", "eps": 0.1, "poles": -1},
    Sinusoids: {"type": "x", "terms": [{"amplitude": 1, "omega": 1}]},
    Gaussian: {"type": "x", "std": 1},
}


def _with(base: type[Plugin], name: str, attribute: object) -> type[Plugin]:
    """A class that redefines one thing."""
    return cast(type[Plugin], new_class("Mine", (base,), exec_body=lambda space: space.update({name: attribute})))


@pytest.mark.costly
@pytest.mark.parametrize(("base", "name"), HOOKS, ids=lambda v: getattr(v, "__name__", v))
def test_whatever_method_raises_is_named(base: type[Plugin], name: str) -> None:
    def raising(*_: object) -> None:
        raise KeyError("key")

    known = getattr_static(base, name)
    method = type(known)(raising) if isinstance(known, (property, classmethod)) else raising
    kind = next(word for cls, word in KINDS.items() if issubclass(base, cls))
    mine = _with(base, name, method)
    block = mine.model_construct(**{**NEEDED.get(base, {}), "type": "mine"})
    called_as = "Mine" if isinstance(known, classmethod) else "mine"
    with pytest.raises(PluginError, match=f"{kind} '{called_as}': {name} raised KeyError: 'key'"):
        getattr(block, name)()


@pytest.mark.parametrize(
    ("base", "name", "value", "words"),
    [
        (StandardObserver, "fastest_rate", "fast", "fastest_rate returned str 'fast', expected a number"),
        (StandardObserver, "design", None, r"design returned NoneType None, expected Mapping\[str, ndarray\]"),
        (StandardObserver, "design", {"K": "a"}, r"design returned dict {'K': 'a'}, expected Mapping"),
        (StandardObserver, "equations", {}, "equations returned dict {}, expected Flow"),
        (
            StandardObserver,
            "roles",
            ["w"],
            r"roles returned list",
        ),
    ],
)
def test_whatever_method_returns_something_wrong_is_named(
    base: type[Plugin], name: str, value: object, words: str
) -> None:
    def wrong(*_: object) -> object:
        return value

    mine = _with(base, name, wrong)
    with pytest.raises(PluginError, match=f"observer 'mine': {words}"):
        getattr(mine.model_validate({**NEEDED[base], "type": "mine"}), name)()


def test_state_names_in_a_list_are_told() -> None:
    class Mine(VanDerPol):
        @property
        def state_names(self) -> Any:
            return ["x1", "x2"]

    words = r"plant 'mine': state_names returned list .*, expected tuple\[str, ...\]"
    with PLANTS.replaced("mine", Mine), pytest.raises(PluginError, match=words):
        simulated({"type": "mine", "initial": {"x1": 1, "x2": 0}}, {"it": SHGO})


def test_a_validator_that_fails_is_named_and_one_that_refuses_is_not() -> None:
    class Mine(StandardObserver):
        @model_validator(mode="after")
        def _sensible(self) -> Mine:
            if self.theta > 3:
                raise ValueError("theta is larger than 3")
            raise LookupError("nothing here")

    with OBSERVERS.replaced("mine", Mine):
        with pytest.raises(PluginError, match="observer 'mine': a validator raised LookupError: nothing here"):
            simulated(chain(2), {"it": {**SHGO, "type": "mine"}})
        with pytest.raises(ConfigError, match="theta is larger than 3"):
            simulated(chain(2), {"it": {**SHGO, "type": "mine", "theta": 4}})


def test_a_method_of_a_mixin_is_named() -> None:
    class Mixin:
        def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
            raise IndexError("list index out of range")

    class Mine(Mixin, StandardObserver):
        pass

    with OBSERVERS.replaced("mine", Mine), pytest.raises(PluginError, match="observer 'mine': design raised IndexErr"):
        simulated(chain(2), {"it": {**SHGO, "type": "mine"}})


def test_what_a_class_calls_itself_raises_as_it_is() -> None:
    class Mine(StandardObserver):
        def helper(self) -> float:
            raise ValueError("for a validator")

    with pytest.raises(ValueError, match="for a validator"):
        Mine.model_validate({**SHGO, "type": "mine"}).helper()


def test_a_finding_whose_applies_fails() -> None:
    with pytest.raises(PluginError, match="finding 'mine': applies raised ZeroDivisionError"):
        analyze(
            experiment(chain(2), {"it": SHGO}),
            [Finding(name="mine", meaning="none", of=lambda _: 1.0, applies=lambda _: bool(1 / 0))],
        )


def test_a_method_that_returns_something_wrong_is_told_with_its_line_and_its_block() -> None:
    class Mine(StandardObserver):
        def design(self, form: CanonicalForm) -> Any:
            return None

    line = inspect.getsourcelines(Mine)[1] + 1
    with OBSERVERS.replaced("mine", Mine), pytest.raises(PluginError) as caught:
        simulated(chain(2), {"other": SHGO, "it": {**SHGO, "type": "mine"}})
    assert re.match(
        r"test:\d+: observers\.it: observer 'mine': design returned NoneType None, expected ", str(caught.value)
    )
    assert str(caught.value).endswith(f" (test_plugins.py:{line})")


def test_a_class_that_no_block_names_is_told_without_one() -> None:
    """The configuration has other observers."""

    class Mine(StandardObserver):
        def design(self, form: CanonicalForm) -> Any:
            return None

    one = experiment(chain(2), {"it": SHGO})
    with pytest.raises(PluginError, match=r"^observer 'mine': design returned"), one.located():
        Mine.model_validate({**SHGO, "type": "mine"}).design(cast(CanonicalForm, None))


def test_the_key_type_is_that_of_the_kind() -> None:
    """A key of that name would be read from the name of the observer, which is no number."""
    with pytest.raises(
        PluginError, match=r"observer 'Own': `type` is the name of the observer in every block; its own"
    ):
        new_class("Own", (StandardObserver,), exec_body=lambda body: body.update(__annotations__={"type": float}))
    new_class("Named", (StandardObserver,), exec_body=lambda body: body.update(__annotations__={"type": str}))
