"""The contract holds for every plant of ours, and catches what is planted in plants that break it."""

from __future__ import annotations

from typing import ClassVar

import casadi as ca
import pytest

from hgorun.plants.base import PLANTS, Expressions, Input, Parameter, Plant
from hgorun.plants.bioreactor_gauthier import GauthierBioreactor
from hgorun.plants.contois import Contois
from hgorun.plants.phytoplankton import Phytoplankton
from hgorun.plants.van_der_pol import VanDerPol
from hgorun.symbolic.symbols import Symbols
from hgorun.testing import ContractError, check_plant

ALL = PLANTS.all()


@pytest.mark.measured("integrator_chain")
@pytest.mark.costly
@pytest.mark.parametrize("name", ALL)
def test_every_plant_keeps_the_contract(name: str) -> None:
    assert {"finite", "slopes", "documentation"} <= set(check_plant(ALL[name]).kept)


def test_maps_are_looked_at_where_there_are_any() -> None:
    kept = check_plant(GauthierBioreactor, {"initial": {"eta1": 0.05, "eta2": 0.04}}).kept
    assert {"inverse", "triangular coordinates", "order of parameters"} <= set(kept)


class WrongInverse(Contois):
    def inverse(self, z: ca.SX, p: Symbols) -> Expressions:
        return [z[0], p.mu * z[0] * z[1] / (p.mu * z[0] - z[1])]


class WrongWayBack(Phytoplankton):
    def from_triangular(self, z: ca.SX, p: Symbols) -> Expressions:
        return [z[0], 1 / z[1], 1 / z[2]]


class ByPlace(VanDerPol):
    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        mu, stiffness = vars(p).values()
        return [x.x2, stiffness * x.x1 + mu * (1 - x.x1**2) * x.x2], [x.x1]


class NotFinite(VanDerPol):
    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        return [x.x2, p.stiffness * p.mu * ca.log(-x.x1)], [x.x1]


class Kinked(VanDerPol):
    """Its slope is hidden from differentiation."""

    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        steps = ca.floor(1e9 * x.x2) / 1e9
        return [steps, p.stiffness * x.x1 + p.mu], [x.x1]


class OneTooFew(VanDerPol):
    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        return [x.x2], [x.x1]


class Unused(VanDerPol):
    known_parameters = {**VanDerPol.known_parameters, "friction": Parameter(1.0, "1/s", "friction")}


class WrongUnit(VanDerPol):
    units = {"x3": "m"}


class NoMeaning(VanDerPol):
    """Its parameters come without a word."""

    known_parameters = {name: Parameter(q.default, q.unit) for name, q in VanDerPol.known_parameters.items()}


class TwoOfOneName(VanDerPol):
    @property
    def output_names(self) -> tuple[str, ...]:
        return ("y", "y")

    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        return [x.x2, p.stiffness * x.x1 + p.mu * x.x2], [x.x1, x.x2]


class Counting(VanDerPol):
    """What it is depends on how often it has been built."""

    count: ClassVar[list[int]] = [0]

    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        self.count[0] += 1
        return [x.x2, p.stiffness * x.x1 + p.mu * self.count[0] * x.x2], [x.x1]


class OutputIsNoCoordinate(Phytoplankton):
    """Its map leads back, but the output is none of its coordinates."""

    def to_triangular(self, x: Symbols, p: Symbols) -> Expressions:
        return [1 / x.x1, x.x2, x.x3]

    def from_triangular(self, z: ca.SX, p: Symbols) -> Expressions:
        return [1 / z[0], z[1], z[2]]


class UnusedInput(VanDerPol):
    known_inputs = {"force": Input("N", "a push that moves nothing")}


class NoDocstring(VanDerPol):
    pass


class NowhereValid(VanDerPol):
    """Documented."""

    valid = ""


class KeyWithoutAWord(VanDerPol):
    """Documented, but for a key."""

    friction: float = 0.0


@pytest.mark.parametrize(
    ("cls", "law", "words"),
    [
        (TwoOfOneName, "names", "outputs ('y', 'y'); expected one name each"),
        (Counting, "repeatable", "expected the same equations every time"),
        (OutputIsNoCoordinate, "triangular coordinates", "a model that is not triangular in them: output x1 is not"),
        (UnusedInput, "declarations", "the input force, which no equation holds"),
        (NoDocstring, "documentation", "no docstring"),
        (NowhereValid, "documentation", "an empty `valid`"),
        (KeyWithoutAWord, "documentation", "the key friction without description"),
        (WrongInverse, "inverse", "expected x itself"),
        (WrongWayBack, "triangular coordinates", "from_triangular(to_triangular(x)) = "),
        (ByPlace, "order of parameters", "expected numbers that belong to names"),
        (NotFinite, "finite", "nan"),
        (Kinked, "slopes", "the slope 0 of x1 in x2"),
        (OneTooFew, "names", "1 right-hand sides; expected 2"),
        (Unused, "declarations", "the parameter friction, which no equation holds"),
        (WrongUnit, "declarations", "a unit of 'x3'"),
        (NoMeaning, "documentation", "mu without a meaning"),
    ],
)
def test_a_planted_fault_is_caught_by_name(cls: type[Plant], law: str, words: str) -> None:
    with pytest.raises(ContractError) as caught:
        check_plant(cls)
    assert caught.value.law == law, caught.value
    assert words in str(caught.value)


class Tank(Plant):
    """Level h of a tank with an outlet: h' = (q - c sqrt(h))/A, y = h."""

    reference = "Torricelli"
    valid = "h > 0"
    known_parameters = {"A": Parameter(1.0, "m^2", "area"), "c": Parameter(0.4, "m^2.5/s", "outlet")}
    known_inputs = {"q": Input("m^3/s", "inflow")}
    units = {"h": "m"}

    @property
    def state_names(self) -> tuple[str, ...]:
        return ("h",)

    @property
    def output_names(self) -> tuple[str, ...]:
        return ("h",)

    def equations(self, t: ca.SX, x: Symbols, u: Symbols, p: Symbols) -> tuple[Expressions, Expressions]:
        return [(u.q - p.c * ca.sqrt(x.h)) / p.A], [x.h]


def test_a_plant_of_ones_own() -> None:
    assert "slopes" in check_plant(Tank).kept
    assert "slopes" in check_plant(Tank, {"initial": {"h": 2}, "inputs": {"q": "0.1*sin(t)"}}).kept
    with pytest.raises(ContractError, match="'finite'"):
        check_plant(Tank, {"initial": {"h": -2}})


@pytest.mark.parametrize("thing", [VanDerPol(type="van_der_pol", initial={"x1": 1, "x2": 0}), Plant, int])
def test_what_is_no_class_of_plants(thing: object) -> None:
    with pytest.raises(TypeError, match="check_plant takes a concrete class of plants"):
        check_plant(thing)  # type: ignore[arg-type]  # that is the test
