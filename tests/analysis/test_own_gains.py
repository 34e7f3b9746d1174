"""Theory of an observer of one's own whose gain is a state: it fades to theta, and is the standard observer at rest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import casadi as ca
import numpy as np
import pytest
from examples import Block, chain, experiment

import hgorun
from hgorun.analysis.finding import FINDINGS
from hgorun.analysis.linear.error_system import error_system
from hgorun.analysis.linear.nominal import nominal
from hgorun.analysis.reasons import NoValue
from hgorun.analysis.report import Findings
from hgorun.analysis.stability.critical import chain_system
from hgorun.config.types import Positive
from hgorun.observers.base import OBSERVERS, Flow, Role
from hgorun.observers.capabilities import SettlingGain
from hgorun.observers.shgo import StandardObserver
from hgorun.simulation.simulate import prepare
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.forms import Form
from hgorun.symbolic.symbols import Symbols

ASKED = [one for one in FINDINGS.all().values() if one.name in ("poles", "hurwitz")]
PLANT = chain(2, "-x1 - x2", [1, 0])


class Fading(StandardObserver):
    """th' = -a (th - theta), th(0) = 2 theta."""

    a: Positive = 1.0

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {**super().design(form), "a": np.array(self.a)}

    def states(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        return {"th": np.array(2 * self.theta)}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        own = Symbols(vars(k) | {"theta": s.th})
        flow = super().equations(plant, s, e, own)
        return Flow({**flow.derivatives, "th": k.a * (k.theta - s.th)}, flow.correction)


class Slow(Fading):
    """Its gain takes longer than its error, as it says."""

    @property
    def settling_rate(self) -> float:
        return min(self.theta, self.a)


class Growing(Fading):
    """th' = a |e|^2, which is still where the error is zero."""

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        flow = super().equations(plant, s, e, k)
        return Flow({**flow.derivatives, "th": k.a * ca.sumsqr(e)}, flow.correction)


class Declared(Fading, SettlingGain):
    """The same with all that there is to declare."""

    def roles(self, form: CanonicalForm) -> Mapping[str, Role]:
        return {"th": "gain"}

    def settled(self, form: Form) -> dict[str, np.ndarray]:
        return {"th": np.array(self.theta)}


class RestUnknown(Fading):
    """The same without the rest."""

    def roles(self, form: CanonicalForm) -> Mapping[str, Role]:
        return {"th": "gain"}


@pytest.fixture
def own() -> Iterator[None]:
    with (
        OBSERVERS.replaced("fading", Fading),
        OBSERVERS.replaced("slow", Slow),
        OBSERVERS.replaced("growing", Growing),
        OBSERVERS.replaced("declared", Declared),
        OBSERVERS.replaced("rest_unknown", RestUnknown),
    ):
        yield


def found(observers: Mapping[str, Block]) -> Mapping[str, Findings]:
    return hgorun.analyze(experiment(PLANT, dict(observers), end=0.5), ASKED).observers


@pytest.mark.usefixtures("own")
@pytest.mark.parametrize(("label", "theta"), [("fading", 2), ("growing", 4)])
def test_a_gain_that_is_called_a_filter_is_what_it_is_along_the_run(label: str, theta: float) -> None:
    """The one at rest where it has faded to, the other where it started."""
    blocks = {"own": {"type": label, "theta": 2}, "known": {"type": "shgo", "theta": theta}}
    run = prepare(experiment(PLANT, blocks, end=30.0, output_step=0.1))
    result = nominal(run)
    own, known = (error_system(run, name, result) for name in ("own", "known"))
    np.testing.assert_allclose(own.A[-1], known.A[-1], atol=1e-8)
    own, known = (chain_system(run, name) for name in ("own", "known"))
    np.testing.assert_allclose(own.A, known.A, atol=1e-6)


@pytest.mark.usefixtures("own")
def test_limits_on_chains_are_of_a_gain_at_rest() -> None:
    """Half-way to its rest it is another gain."""
    blocks = {name: {"type": name, "theta": 2, "a": 0.1} for name in ("fading", "slow")}
    run = prepare(experiment(PLANT, blocks, end=0.5))
    with pytest.raises(NoValue, match=r"its gain has not come to rest on chains of integrators by t = 20: its class"):
        chain_system(run, "fading")
    np.testing.assert_allclose(chain_system(run, "slow").A[0], [[-4, 1], [-4, 0]], atol=1e-6)


@pytest.mark.usefixtures("own")
def test_a_gain_that_is_called_a_filter_gives_no_poles() -> None:
    theory = found({"o": {"type": "fading", "theta": 2}})
    assert theory["o"].values["poles"] is None
    assert "its state th does not come to rest at 0" in theory["o"].reasons["hurwitz"]


@pytest.mark.usefixtures("own")
def test_what_is_declared_gives_poles() -> None:
    theory = found({"o": {"type": "declared", "theta": 2}, "rest_unknown": {"type": "rest_unknown", "theta": 2}})
    assert theory["o"].values["poles"] == pytest.approx([-1, -1], abs=1e-6)
    assert "declares no rest of it on chains" in theory["rest_unknown"].reasons["poles"]
