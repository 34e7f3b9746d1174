"""The contract holds for every observer of ours, and catches what is planted in observers that break it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import pytest

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
from hgorun.symbolic.symbols import Symbols
from hgorun.testing import ContractError, check_observer

FAMILIES = OBSERVERS.all()
ALWAYS = {"takes a plant", "finite design", "repeatable", "states", "equations", "refusal", "company", "lanes"}


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


class NoDocumentation(StandardObserver):
    """Documented."""

    reference = ""


@pytest.mark.parametrize(
    ("cls", "law", "words"),
    [
        (WrongCorrection, "correction", "what the output of the estimate feels"),
        (CorrectionOfTheWrongShape, "equations", "a correction of shape (2, 1)"),
        (NaNDesign, "finite design", "G = [nan nan]"),
        (SlowRate, "declared rate", "but eigenvalues up to 2.00001 on integrator_chain"),
        (InfiniteRate, "declared rate", "fastest_rate = inf"),
        (WrongCopy, "fixed point", "after starting at the truth"),
        (Counting, "repeatable", "when they are built again"),
        (Company, "company", "the same bits alone and in company"),
        (MissingDerivative, "equations", "derivatives of ['xhat']; expected all of ['w', 'xhat']"),
        (StateOfTheWrongShape, "equations", "derivatives of w with shape (2, 1); expected (1, 1)"),
        (Singular, "equations", "nan"),
        (FreeSymbol, "equations", "the free symbols truth"),
        (Traceback, "refusal", "IndexError: list index out of range"),
        (TakenName, "states", "a state called alpha"),
        (NoDocumentation, "documentation", "an empty reference"),
    ],
)
def test_a_planted_fault_is_caught_by_name(cls: type[AnyObserver], law: str, words: str) -> None:
    with pytest.raises(ContractError) as caught:
        check_observer(cls)
    assert caught.value.law == law, caught.value
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{cls.__name__} breaks the law {law!r}: found ")
    assert isinstance(caught.value, AssertionError)


def test_a_class_that_no_configuration_knows_can_be_checked_and_is_forgotten() -> None:
    class Mine(StandardObserver):
        """A standard observer."""

    assert "company" in check_observer(Mine, {"theta": 3, "poles": -2}).kept
    assert "Mine" not in OBSERVERS.names()


def test_a_block_and_plants_of_ones_own() -> None:
    plants = [{"type": "integrator_chain", "n": 1, "phi": "-x1", "initial": {"x1": 1}}]
    assert "fixed point" in check_observer(StandardObserver, {"theta": 5}, plants=plants).kept
    with pytest.raises(ContractError, match=r"takes a plant.*refused"):
        check_observer(FAMILIES["low_power"], plants=plants)
    with pytest.raises(ContractError, match=r"the block .* refused at theta"):
        check_observer(StandardObserver, {"theta": -1})


def test_a_law_can_be_skipped() -> None:
    report = check_observer(WrongCorrection, skip=["correction"])
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


def test_observers_that_jump_and_that_do_both() -> None:
    chains = [{"type": "integrator_chain", "n": 2, "phi": "-x1", "initial": {"x1": 1, "x2": 0}}]
    assert "company" in check_observer(Holder, plants=chains).kept
    assert "fixed point" in check_observer(Predictor, plants=chains).kept


class NoCopy(ContinuousObserver):
    """It knows only the output."""

    reference = "an example"

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": -plant.along_chains(e)})


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
