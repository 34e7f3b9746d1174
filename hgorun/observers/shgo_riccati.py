"""The standard high-gain observer for plants that are observable under some inputs only."""

from __future__ import annotations

from typing import Literal

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.observers.base import Flow, observer
from hgorun.observers.riccati import RiccatiGain, gain_of, lyapunov, riccati
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols
from hgorun.symbolic.triangular import TriangularCopy, TriangularForm


@observer("shgo_riccati")
class StandardRiccatiObserver(RiccatiGain):
    """Standard high-gain observer with time-varying gain (SHGO), for triangular plants.

    For triangular plants that need not be uniformly observable, with one or several outputs:
    x = (x^(1), ..., x^(q)), y = x^(1) = C x, and F = F(u, xhat) has the blocks d f^(k) / d x^(k+1) on its
    superdiagonal and zeros elsewhere. With e the innovation,

        xhat' = F xhat + phi(u, xhat) - theta Delta^-1(theta) P C^T e
        P'    = theta (P + F P + P F^T - P C^T C P),    P(0) = I

    Delta^-1 = diag(I, theta I, ..., theta^(q-1) I), block by block. The same with S = P^-1 (``equation:
    lyapunov``):

        S'    = -theta (S + F^T S + S F - C^T C),       S(0) = I

    which is linear, but needs S^-1 C^T at every step and is worse conditioned.

    Where F is the constant chain A_n, P C^T tends to the binomial coefficients and the observer to ``shgo`` with its
    poles at -1: choose that one for plants that are uniformly observable. Where F stays zero for a time P grows like
    exp(theta t): the inputs have to excite the plant again within a few 1/theta. A larger theta >= 1 is faster, and
    amplifies the noise in block i by theta^i, times the peaks of P: choose a filtered observer (fhgo1, fhgo2_nuos) if
    that matters.

    (2.7) prints C^T (xhat - y); C xhat - y has the right dimension. (3.89) lacks Delta^-1, without which a
    larger theta makes the error of the last states larger.
    """

    reference = "Robles Magdaleno 2023, (2.7)-(2.9), (3.89)-(3.90)"

    equation: Literal["riccati", "lyapunov"] = Field(
        default="riccati", description="riccati integrates P, lyapunov its inverse S"
    )

    def design(self, form: TriangularForm) -> dict[str, np.ndarray]:
        self.require_fit(self.states(form))
        return {"theta": np.array(self.theta)}

    def states(self, form: TriangularForm) -> dict[str, np.ndarray | Symmetric]:
        return {"P" if self.equation == "riccati" else "S": Symmetric(np.eye(form.n))}

    def equations(self, plant: TriangularCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        F, C = plant.F(s.xhat), plant.C
        if self.equation == "riccati":
            K, derivatives = s.P @ C.T, {"P": k.theta * riccati(s.P, F, C)}
        else:
            K, derivatives = gain_of(s.S, C), {"S": k.theta * lyapunov(s.S, F, C)}
        kappa = k.theta * plant.inv_Delta(k.theta) @ K @ e
        derivatives["xhat"] = plant.copy(s.xhat) - kappa
        return Flow(derivatives, correction=plant.measured(kappa))

    def fastest_rate(self, form: TriangularForm) -> float:
        return (2.5 if self.equation == "lyapunov" else 1.0) * self.rate(max(form.block) + 1)
