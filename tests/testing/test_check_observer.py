"""The contract holds for every observer of ours, and catches what is planted in observers that break it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import pytest

from hgorun.errors import Problem
from hgorun.observers.base import (
    OBSERVERS,
    AnyObserver,
    ContinuousObserver,
    Flow,
    HybridObserver,
    Sample,
    SampledObserver,
)
from hgorun.observers.capabilities import Differentiator, HighGain
from hgorun.observers.levant import LevantObserver
from hgorun.observers.shgo import StandardObserver
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.matrices import hurwitz_gain
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols
from hgorun.testing import ContractError, check_observer

FAMILIES = OBSERVERS.all()
ALWAYS = {"takes a plant", "finite design", "repeatable", "states", "equations", "refusal", "company", "lanes"}


@pytest.mark.measured_once
@pytest.mark.slow
@pytest.mark.parametrize("name", FAMILIES)
def test_every_observer_keeps_the_contract(name: str) -> None:
    report = check_observer(FAMILIES[name])
    assert ALWAYS | {"documentation"} <= set(report.kept)


def test_the_implicit_differentiator_keeps_it() -> None:
    report = check_observer(LevantObserver, {"discretisation": "implicit"})
    assert report.left_out["correction"] == "it has no flow"


class WrongCorrection(StandardObserver):
    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        flow = super().equations(plant, s, e, k)
        assert flow.correction is not None
        return Flow(flow.derivatives, correction=1.01 * flow.correction)


class CorrectionOfTheWrongShape(StandardObserver):
    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        flow = super().equations(plant, s, e, k)
        return Flow(flow.derivatives, correction=s.xhat)


class NaNDesign(StandardObserver):
    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {**super().design(form), "G": np.full(form.plant.n, np.nan)}


class SlowRate(StandardObserver):
    def fastest_rate(self, form: CanonicalForm) -> float:
        return 0.9 * super().fastest_rate(form)


class InfiniteRate(StandardObserver):
    def fastest_rate(self, form: CanonicalForm) -> float:
        return float("inf")


class DesignOfTheWrongType(StandardObserver):
    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return 3  # type: ignore[return-value]  # it is refused


class WrongCopy(StandardObserver):
    """Without the declared correction, which would show it first."""

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": 1.001 * super().equations(plant, s, e, k).derivatives["xhat"]})


class Counting(StandardObserver):
    """What it does depends on how often it has been asked."""

    count: ClassVar[list[int]] = [0]

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        self.count[0] += 1
        return super().equations(plant, s, self.count[0] * e, k)


class Company(StandardObserver):
    """What it does depends on a global number that every new block changes."""

    blocks: ClassVar[dict[float, int]] = {}

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        start = self.initial.get("x1", 0.0)
        place = self.blocks.setdefault(start, len(self.blocks))
        return {**super().design(form), "theta": np.array(self.theta + 0.01 * len(self.blocks) * (place == 1))}


class MissingDerivative(StandardObserver):
    def states(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"w": np.zeros(1)}


class StateOfTheWrongShape(StandardObserver):
    def states(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"w": np.zeros(1)}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        flow = super().equations(plant, s, e, k)
        return Flow({**flow.derivatives, "w": s.xhat}, correction=flow.correction)


class Singular(StandardObserver):
    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        flow = super().equations(plant, s, e, k)
        return Flow({"xhat": flow.derivatives["xhat"] + ca.log(-1 - s.xhat[0] ** 2)}, correction=flow.correction)


class FreeSymbol(StandardObserver):
    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        flow = super().equations(plant, s, e, k)
        return Flow({"xhat": flow.derivatives["xhat"] + ca.SX.sym("truth")}, correction=flow.correction)


class Traceback(StandardObserver):
    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        if form.plant.states[0] == "a":
            raise IndexError("list index out of range")
        return super().design(form)


class TakenName(StandardObserver):
    def states(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"alpha": np.zeros(1)}


class NoReference(StandardObserver):
    """Documented."""

    reference = ""


class NoDocstring(HighGain, ContinuousObserver):
    reference = "here"

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {
            "theta": np.array(self.theta),
            "G": np.concatenate([hurwitz_gain(length, -1) for length in form.chains]),
        }

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        kappa = k.theta * plant.inv_Delta(k.theta) @ (k.G * plant.along_chains(e))
        return Flow({"xhat": plant.copy(s.xhat) - plant.lift(s.xhat, kappa)})


class WrongSign(StandardObserver):
    """No rate is declared that would show it, and the correction is derived."""

    def fastest_rate(self, form: CanonicalForm) -> float:
        return 0.0

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": super().equations(plant, s, -e, k).derivatives["xhat"]})


class WrongSignAndRate(WrongSign):
    def fastest_rate(self, form: CanonicalForm) -> float:
        return 1.0


class Blind(StandardObserver):
    """It ignores y."""

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": plant.copy(s.xhat)})


class DifferentSlopes(StandardObserver):
    """A kink where the error is zero, with a good gain on either side of it."""

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": super().equations(plant, s, e + 0.2 * ca.fabs(e), k).derivatives["xhat"]})


class WrongOnOneSide(StandardObserver):
    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": super().equations(plant, s, ca.fabs(e), k).derivatives["xhat"]})


class Jumping(SampledObserver):
    """Euler's model with poles at one half."""

    sign: ClassVar[float] = 1.0

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        if form.chains != (1,) * form.plant.n:
            raise Problem(("type",), "states that are all measured")
        return {"K": np.array(0.5)}

    def jump(self, plant: PlantCopy, before: PlantCopy, s: Symbols, sample: Sample, k: Symbols) -> dict[str, ca.SX]:
        return {"xhat": s.xhat - self.sign * k.K * (plant.output(s.xhat) - sample.y)}


class WrongJump(Jumping):
    sign = -1.0


class UnknownRole(MissingDerivative):
    def roles(self, form: CanonicalForm) -> dict[str, Any]:
        return {"w": "integrator"}


class CompiledNumber(StandardObserver):
    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return super().equations(plant, s, e * self.theta / self.theta, k)


class RaisingDesign(StandardObserver):
    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        raise IndexError("list index out of range")


class FloatState(StandardObserver):
    def states(self, form: CanonicalForm) -> dict[str, Any]:
        return {"w": 0.0}


class ForgetfulDesign(StandardObserver):
    """Its gains drift from one call to the next."""

    calls: ClassVar[list[int]] = [0]

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        self.calls[0] += 1
        return {**super().design(form), "theta": np.array(self.theta + self.calls[0])}


class FirstDesign(StandardObserver):
    """The first design of all is another one."""

    calls: ClassVar[list[int]] = [0]

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        self.calls[0] += 1
        return {**super().design(form), "theta": np.array(self.theta + (self.calls[0] == 1))}


class LastDesign(StandardObserver):
    """Its equations use a number that every design leaves behind, whoever it is for."""

    last: ClassVar[dict[str, float]] = {}

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        self.last["theta"] = self.theta
        return super().design(form)

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return super().equations(plant, s, self.last["theta"] * e, k)


class LastPlant(LastDesign):
    """The same with a number of the plant."""

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        self.last["theta"] = form.plant.n
        return StandardObserver.design(self, form)


class CorrectionOfOneOutput(StandardObserver):
    """Only the first output is told what it feels."""

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        flow = super().equations(plant, s, e, k)
        felt = ca.jtimes(plant.output(s.xhat), s.xhat, plant.copy(s.xhat) - flow.derivatives["xhat"])
        return Flow(flow.derivatives, correction=ca.vertcat(felt[0], ca.SX.zeros(felt.numel() - 1)))


class StateFromInfinity(MissingDerivative):
    def states(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"w": np.full(1, np.inf)}


class SkewMatrix(MissingDerivative):
    def states(self, form: CanonicalForm) -> dict[str, Any]:
        return {"S": Symmetric(np.array([[1.0, 2.0], [0.0, 1.0]]))}


class RoleForgotten(MissingDerivative):
    def roles(self, form: CanonicalForm) -> dict[str, Any]:
        return {}


class GainCalledAFilter(StandardObserver):
    """A gain that fades to theta, without a role of its own."""

    def states(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"th": np.array(3 * self.theta)}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        flow = super().equations(plant, s, e, Symbols(vars(k) | {"theta": s.th}))
        return Flow({**flow.derivatives, "th": k.theta - s.th}, flow.correction)


class Deciding(StandardObserver):
    """Decides on a symbol."""

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        flow = super().equations(plant, s, e, k)
        return Flow({"xhat": -s.xhat}) if e[0] > 0 else flow


class Summing(StandardObserver):
    """Goes through a symbol."""

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": s.xhat * sum(e)})


class OfMath(StandardObserver):
    """Takes a function of numbers for a symbol."""

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": s.xhat * math.tanh(e[0])})


class TextForARate(StandardObserver):
    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": "xhat"})


class ListForARate(StandardObserver):
    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": list(ca.vertsplit(s.xhat))})


class GainsOfAnotherLength(StandardObserver):
    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": plant.copy(s.xhat) - ca.SX.ones(5, 1)})


class LongEstimate(StandardObserver):
    def estimate(self, s: Symbols, k: Symbols) -> ca.SX:
        return ca.vertcat(s.xhat, 0)


class LongStart(StandardObserver):
    def start(self, xhat: np.ndarray, k: Mapping[str, np.ndarray]) -> np.ndarray:
        return np.append(xhat, 0.0)


class TextForAGain(StandardObserver):
    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"K": np.array(["large"])}


class DeepState(StandardObserver):
    def states(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"w": np.zeros((2, 2, 2))}


class KeyWithoutAWord(StandardObserver):
    """Documented, but for a key."""

    leak: float = 0.0


@pytest.mark.parametrize(
    ("cls", "law", "words"),
    [
        (WrongCorrection, "correction", "what the output of the estimate feels"),
        (CorrectionOfTheWrongShape, "equations", "the correction, one an output, has the shape (2, 1)"),
        (NaNDesign, "finite design", "G = [nan nan]"),
        (SlowRate, "declared rate", "but eigenvalues up to 2.00001 on integrator_chain"),
        (InfiniteRate, "declared rate", "fastest_rate = inf"),
        (WrongCopy, "fixed point", "after starting at the truth"),
        (Counting, "repeatable", "when they are built again"),
        (Company, "company", "the same bits alone and in company"),
        (MissingDerivative, "equations", "derivative of ['xhat']; expected all of ['w', 'xhat']"),
        (
            StateOfTheWrongShape,
            "equations",
            "derivative of w has the shape (2, 1); expected an expression of the shape (1, 1)",
        ),
        (Singular, "equations", "nan"),
        (FreeSymbol, "equations", "the free symbols truth"),
        (Traceback, "refusal", "IndexError: list index out of range"),
        (TakenName, "states", "a state called alpha"),
        (NoReference, "documentation", "an empty `reference`"),
        pytest.param(
            WrongSign,
            "the error decays",
            "eigenvalues of the linearised error with real parts up to 7.6",
            marks=pytest.mark.costly,
        ),
        (WrongSignAndRate, "the error decays", "look at the sign of the correction"),
        pytest.param(
            Blind, "the error decays", "real parts up to 0 on integrator_chain with 3 states", marks=pytest.mark.costly
        ),
        pytest.param(WrongOnOneSide, "the error decays", "real parts up to 7.6", marks=pytest.mark.costly),
        (UnknownRole, "states", "the roles ['integrator']; expected roles among ['filter', 'gain', 'signal']"),
        (GainCalledAFilter, "roles", "th, a filter, that does not come to rest at 0 while the estimate is right"),
        (CompiledNumber, "numbers are arguments", "equations that read self.theta, a number; expected k.theta"),
        (RaisingDesign, "takes a plant", "found design() raised IndexError: list index out of range; expected no"),
        (DesignOfTheWrongType, "takes a plant", "design returned int 3; expected Mapping[str, ndarray]"),
        (FloatState, "takes a plant", "found states(): w is a float; expected an array"),
        (ForgetfulDesign, "repeatable", "the same design every time"),
        (FirstDesign, "repeatable", "the same design every time"),
        (LastDesign, "repeatable", "when they are built again"),
        (LastPlant, "repeatable", "when they are built again"),
        (CorrectionOfOneOutput, "correction", "on inline with 4 states"),
        (StateFromInfinity, "states", "w starting at [inf]; expected a finite number, vector or matrix"),
        (SkewMatrix, "states", "S starting at [[1.0, 2.0], [0.0, 1.0]]; expected a symmetric matrix"),
        (RoleForgotten, "states", "roles of []; expected one role each of ['w']"),
        (Deciding, "equations", "a symbol: write casadi.if_else(condition, a, b)"),
        (Summing, "equations", "write casadi.vertsplit, casadi.sum1"),
        (OfMath, "equations", "casadi.sin does not"),
        (TextForARate, "equations", "equations(): the derivative of xhat is a str: expressions are SX of casadi"),
        (ListForARate, "equations", "the derivative of xhat is a list: casadi.vertcat makes a column of its entries"),
        (GainsOfAnotherLength, "equations", "the shapes (2, 1) and (5, 1) do not fit together"),
        (LongEstimate, "equations", "estimate(): the estimate has the shape (3, 1); expected an expression of"),
        (LongStart, "equations", "start(): the first estimate has the shape (3,); expected (2,)"),
        (TextForAGain, "takes a plant", "design(): K holds text; expected numbers"),
        (DeepState, "takes a plant", "states(): w has the shape (2, 2, 2); expected a number, a vector or a matrix"),
        (KeyWithoutAWord, "documentation", "the key leak without description"),
    ],
)
def test_a_planted_fault_is_caught_by_name(cls: type[AnyObserver], law: str, words: str) -> None:
    with pytest.raises(ContractError) as caught:
        check_observer(cls)
    assert caught.value.law == law, caught.value
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{cls.__name__} breaks the law {law!r}: found ")
    assert isinstance(caught.value, AssertionError)


def test_a_class_of_a_documented_base_needs_a_docstring_of_its_own() -> None:
    with pytest.raises(ContractError, match="'documentation': found no docstring"):
        check_observer(NoDocstring, {"theta": 2})


@pytest.mark.costly
def test_the_wrong_sign_is_not_answered_by_a_faster_rate() -> None:
    with pytest.raises(ContractError) as caught:
        check_observer(WrongSignAndRate)
    assert "rate" not in caught.value.expected


@pytest.mark.costly
def test_a_kink_at_no_error_is_judged_by_the_slopes_beside_it() -> None:
    report = check_observer(DifferentSlopes, skip=["documentation"])
    assert "the error decays" in report.kept


PLANT = {"type": "integrator_chain", "n": 1, "initial": {"x1": 0.5}}


def test_the_wrong_sign_in_a_jump_is_found() -> None:
    skip = ["documentation", "fixed point"]
    assert "the error decays" in check_observer(Jumping, plants=[PLANT], skip=skip).kept
    with pytest.raises(ContractError, match=r"a period of 0.1 multiplies by up to 1.5 on integrator_chain") as caught:
        check_observer(WrongJump, plants=[PLANT], skip=skip)
    assert caught.value.law == "the error decays"


def test_no_plants_are_not_enough() -> None:
    with pytest.raises(ContractError, match=r"found plants=.*; expected at least one entry"):
        check_observer(StandardObserver, plants=[])


@pytest.mark.costly
def test_a_class_that_no_configuration_knows_can_be_checked_and_is_forgotten() -> None:
    class Mine(StandardObserver):
        """A standard observer."""

    assert "company" in check_observer(Mine, {"theta": 3, "poles": -2}).kept
    assert "Mine" not in OBSERVERS.names()


@pytest.mark.costly
def test_a_block_and_plants_of_ones_own() -> None:
    plants = [{"type": "integrator_chain", "n": 1, "phi": "-x1", "initial": {"x1": 1}}]
    assert "fixed point" in check_observer(StandardObserver, {"theta": 5}, plants=plants).kept
    with pytest.raises(ContractError, match=r"takes a plant.*refused"):
        check_observer(FAMILIES["low_power"], plants=plants)
    with pytest.raises(ContractError, match=r"the block .* refused at theta"):
        check_observer(StandardObserver, {"theta": -1})


def test_a_law_can_be_skipped() -> None:
    report = check_observer(WrongCorrection, skip=["correction", "documentation"])
    assert report.left_out["correction"] == "skipped"
    assert "not checked: correction: skipped" in str(report)
    with pytest.raises(ValueError, match="no law is called 'corection'; the laws are takes a plant, "):
        check_observer(WrongCorrection, skip=["corection"])


class Holder(Differentiator, SampledObserver):
    """The latest sample, and its difference quotient: for two integrators."""

    reference = "an example"

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {}

    def jump(self, plant: PlantCopy, before: PlantCopy, s: Symbols, sample: Sample, k: Symbols) -> Mapping[str, ca.SX]:
        slope = (sample.y - sample.previous) / sample.interval
        return {"xhat": ca.vertcat(sample.y, *[slope] * (s.xhat.numel() - 1))}


class Predictor(HighGain, HybridObserver):
    """A flow along the plant's copy between samples, and a correction at each of them."""

    reference = "an example"

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, Any]:
        return {"theta": 2.0}

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"theta": np.array(self.theta)}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": plant.copy(s.xhat)})

    def jump(self, plant: PlantCopy, before: PlantCopy, s: Symbols, sample: Sample, k: Symbols) -> Mapping[str, ca.SX]:
        kappa = (1 - ca.exp(-k.theta * sample.interval)) * plant.along_chains(plant.output(s.xhat) - sample.y)
        return {"xhat": s.xhat - plant.lift(s.xhat, kappa)}


@pytest.mark.costly
def test_observers_that_jump_and_that_do_both() -> None:
    chains = [{"type": "integrator_chain", "n": 2, "phi": "-x1", "initial": {"x1": 1, "x2": 0}}]
    assert "company" in check_observer(Holder, plants=chains).kept
    assert "fixed point" in check_observer(Predictor, plants=chains).kept


class JumpToNowhere(Jumping):
    def jump(self, plant: PlantCopy, before: PlantCopy, s: Symbols, sample: Sample, k: Symbols) -> dict[str, ca.SX]:
        return {"xbar": s.xhat}


def test_a_jump_may_leave_states_out_but_not_invent_them() -> None:
    with pytest.raises(ContractError, match=r"jump\(\): the value of \['xbar'\]; expected some of \['xhat'\]"):
        check_observer(JumpToNowhere, plants=[PLANT])


class NoCopy(ContinuousObserver):
    """It knows only the output."""

    reference = "an example"

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": -plant.along_chains(e)})


@pytest.mark.costly
def test_an_observer_without_the_plants_equations_does_not_stay_and_may_say_so() -> None:
    with pytest.raises(ContractError, match="breaks the law 'fixed point'"):
        check_observer(NoCopy)

    class Honest(Differentiator, NoCopy):
        """It knows only the output, and gives its correction."""

        def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
            return Flow({"xhat": -plant.along_chains(e)}, correction=e)

    assert check_observer(Honest).left_out["fixed point"] == "it does without the plant's equations"


@pytest.mark.parametrize("thing", [StandardObserver(type="shgo", theta=2), ContinuousObserver, int])
def test_what_is_no_class_of_observers(thing: object) -> None:
    with pytest.raises(TypeError, match="expected a class derived from ContinuousObserver, SampledObserver or Hybrid"):
        check_observer(thing)  # type: ignore[arg-type]  # that is the test
