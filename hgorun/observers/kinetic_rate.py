"""The observer of reaction rates, which needs no kinetic model."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import ExpressionText, Name, Number, Positive
from hgorun.errors import Problem
from hgorun.observers.base import ContinuousObserver, Flow, observer
from hgorun.observers.capabilities import Differentiator, HighGain
from hgorun.observers.constant_gain import PlacedGain
from hgorun.observers.expressions import of_copy, require_known, require_states
from hgorun.symbolic.ranks import is_regular
from hgorun.symbolic.smooth import SmoothCopy, SmoothForm, smooth_form
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols

_SINGULAR = 1e-12  # of the measured species' yields


@observer("kinetic_rate")
class KineticRateObserver(Differentiator, HighGain, PlacedGain, ContinuousObserver[SmoothForm, SmoothCopy]):
    """High-gain observer of unknown reaction rates, for stirred tanks with known yields.

    The mass balances are xi' = K r - D xi + F_in: the rates r (n_r) are unknown functions, the yields K (n_x x n_r),
    the dilution rate D and the feed F_in are known. As many species xi_a as there are rates are measured, and their
    rows K_a of K are invertible. With e = xihat_a - y the innovation,

        xihat_a' = K_a r - D xihat_a + F_in,a - theta g_1 e
        r'       = -theta^2 g_2 K_a^-1 e
        xihat_b' = K_b r - D xihat_b + F_in,b

    G = (g_1, g_2) gives each measured species the two poles (2, 1 by default), so that it is an extended observer of
    order one, whose unknown input is the rate. Nothing of the plant is used but the names of its states, inputs and
    parameters and which of its states are measured: the observer does not know the plant's kinetics. The species that
    are not measured are followed by their balances: their errors decay like exp(-int D) only, and not at all in a
    batch, where what counts is how well ``initial`` is known. Figures leave out states that are not measured and are
    in neither ``yields`` nor ``feed``, since they have no balance here. A state that is only washed out has yields of
    0.

    A rate that grows like s t is followed with the error -(g_1 theta + D) s / (g_2 theta^2). Noise reaches the
    measured species with theta and the rates with theta^2 / K_a. Where the kinetics are known, an observer that
    uses them needs less gain.
    """

    lacks = {"extend": "its rates are the unknown inputs"}

    reference = "Bastin, Dochain 1990; Farza, Busawon, Hammouri 1998"
    form = staticmethod(smooth_form)

    theta: Positive = Field(description="high gain theta > 0: how fast the rates are followed, in 1/time")
    yields: dict[Name, tuple[Number, ...]] = Field(
        description="state: its yield in each reaction, a row of K; states left out have none", min_length=1
    )
    dilution: ExpressionText = Field(default="0", description="D, expression of t, inputs and parameters")
    feed: dict[Name, ExpressionText] = Field(
        default_factory=dict, description="state: expression of t, inputs and parameters, a row of F_in; 0 by default"
    )

    def design(self, form: SmoothForm) -> dict[str, np.ndarray]:
        states, measured = form.plant.states, self._measured(form)
        require_states("yields", self.yields, states)
        require_states("feed", self.feed, states)
        known = ("t", *form.plant.inputs, *form.plant.parameters)
        require_known(("dilution",), self.dilution, known)
        for name, row in self.feed.items():
            require_known(("feed", name), row, known)
        K = np.array([self.yields.get(name, (0.0,) * len(measured)) for name in states])
        K_a = K[measured]
        if not is_regular(K_a, _SINGULAR):
            names = ", ".join(states[i] for i in measured)
            raise Problem(("yields",), f"the rows of what is measured ({names}) must be linearly independent")
        return {"theta": np.array(self.theta), "G": self.gain(2), "K": K, "K_a_inverse": np.linalg.inv(K_a)}

    def _measured(self, form: SmoothForm) -> list[int]:
        """For each output the state that it is."""
        plant = form.plant
        for name in plant.outputs:
            if name not in plant.measures:
                raise Problem(("type",), f"needs outputs that are states of the plant; {name} is not one")
        for name, row in self.yields.items():
            if len(row) != len(plant.outputs):
                raise Problem(
                    ("yields", name),
                    f"expected as many yields as outputs, {len(plant.outputs)}: a rate for each; found {len(row)}",
                )
        return [plant.states.index(plant.measures[name]) for name in plant.outputs]

    def unestimated(self, form: SmoothForm) -> tuple[str, ...]:
        """States without a balance: those that are not measured, and named neither in yields nor in feed."""
        followed = {*self.yields, *self.feed, *form.plant.measures.values()}
        return tuple(name for name in form.plant.states if name not in followed)

    def states(self, form: SmoothForm) -> Mapping[str, np.ndarray | Symmetric]:
        return {"r": np.zeros(len(form.plant.outputs))}

    def equations(self, plant: SmoothCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        model = plant.form.plant
        D = of_copy(plant, self.dilution)
        F_in = ca.vertcat(*[of_copy(plant, self.feed.get(name, "0")) for name in model.states])
        kappa = k.theta * k.G[0] * e
        measured = self._measured(plant.form)
        pulled = ca.vertcat(*[kappa[measured.index(i)] if i in measured else 0 for i in range(model.n)])
        return Flow(
            {
                "xhat": k.K @ s.r - D * s.xhat + F_in - pulled,
                "r": -(k.theta**2) * k.G[1] * (k.K_a_inverse @ e),
            },
            correction=kappa,
        )

    def characteristics(self, form: SmoothForm) -> list[np.ndarray]:
        return [np.array([1.0, *self.gain(2)])]

    def fastest_rate(self, form: SmoothForm) -> float:
        return self.theta * float(np.max(np.abs(np.roots(*self.characteristics(form)))))

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"theta": 2.0, "yields": {states[0]: [1.0]}}
