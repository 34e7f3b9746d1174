"""The linear extended-state observer."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Positive
from hgorun.observers.base import Flow, observer
from hgorun.observers.capabilities import Speed
from hgorun.observers.constant_gain import PlacedGain
from hgorun.observers.extended_state import ExtendedState
from hgorun.symbolic.derivatives import DerivativeCopy, DerivativeForm
from hgorun.symbolic.symbols import Symbols


@observer("eso")
class LinearExtendedStateObserver(Speed, PlacedGain, ExtendedState):
    """Gao's linear extended-state observer, for lower triangular plants with one output.

    It knows approximately how the input enters the plant, and treats everything else as a disturbance sigma of the
    n-th derivative of the output. With e = z_1 - y, the innovation,

        z_i'   = z_(i+1) - omega_o^i g_i e,    i < n
        z_n'   = sigma + b_0 u - omega_o^n g_n e
        sigma' = -omega_o^(n+1) g_(n+1) e

    All n + 1 poles are at -omega_o, or at omega_o times ``poles``, and G = (g_i) follows. It is ``extended`` with the
    model phi = b_0 u and theta = omega_o, which is proved: on chains of integrators both are the same. Where sigma' is
    a constant s, z_i is off by -s k_(i-1)/k_(n+1), k_i = omega_o^i g_i, k_0 = 1, so that errors fall like
    omega_o^(i-n-2), and noise grows like omega_o^i.

    Choose it for controllers that cancel sigma, u = (v - sigma)/b_0, and where there is no model; with one,
    ``extended`` has less to estimate, and needs a smaller bandwidth. Samples come through the common innovation. Late
    outputs are refused: without a model nothing brings the estimate to the present; take ``extended``, or
    ``predictor_chain``. The estimate is the state that belongs to the derivatives z, as for ``levant``, and ``initial``
    gives them at the start, with the inputs there; where the output depends on the input itself, b_0 u is not how it
    enters.
    """

    reference = "Gao 2003; Han 2009"

    omega_o: Positive = Field(description="bandwidth, per time, > 0: the poles are omega_o times ``poles``")

    @property
    def speed_key(self) -> str | None:
        return "omega_o"

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"omega_o": 4.0}

    def design(self, form: DerivativeForm) -> dict[str, np.ndarray]:
        order = form.plant.n + 1
        return {"K": self.omega_o ** np.arange(1, order + 1) * self.gain(order), "b_0": self.of_inputs(form)}

    def equations(self, plant: DerivativeCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return self.flow(plant, s, k.K * e, k)

    def characteristics(self, form: DerivativeForm) -> list[np.ndarray]:
        return [np.array([1.0, *self.gain(form.plant.n + 1)])]

    def fastest_rate(self, form: DerivativeForm) -> float:
        return self.omega_o * float(np.max(np.abs(np.roots(*self.characteristics(form)))))
