"""The filtered high-gain observer FHGO II for plants that are observable under some inputs only."""

from __future__ import annotations

from typing import Literal

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.errors import Problem
from hgorun.observers.base import Flow, Role, observer
from hgorun.observers.capabilities import FilterOrder
from hgorun.observers.riccati import RiccatiGain, gain_of, lyapunov, riccati, stationary
from hgorun.symbolic.forms import Form
from hgorun.symbolic.matrices import A, B, C, hurwitz_gain
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols
from hgorun.symbolic.triangular import TriangularCopy, TriangularForm


@observer("fhgo2_nuos")
class FilteredObserver2TimeVarying(FilterOrder, RiccatiGain):
    """Filtered high-gain observer of order r with time-varying gain (FHGO II), for triangular plants.

    For triangular plants with one output that need not be uniformly observable (NUOS), the functions
    f_i(u, x_1, ..., x_i) on the superdiagonal of F = F(u, xhat) passing through zero now and then. With e
    the innovation,

        eta'  = theta ((A_r - K_r(t) C_r) eta + B_r e),                           eta(0) = 0
        xhat' = F xhat + phi(u, xhat) - theta Delta_n^-1(theta) K_n(t) C_r eta

    (K_r; K_n) = S^-1 C_c^T belongs to the plant behind r integrators, F_f = [[A_r, B_r C_n], [0, F]] and
    C_c = (C_r, 0) (``gain: full``; (n+r)(n+r+1)/2 equations):

        S'    = -theta (S + S F_f + F_f^T S - C_c^T C_c),                             S(0) = diag(S_1inf, I)

    where S_1inf + S_1inf A_r + A_r^T S_1inf = C_r^T C_r. The block S_1inf does not move, and what is left
    is (``gain: reduced``; r n + n (n+1)/2 equations, better conditioned, the default)

        U'    = theta ((A_r - b C_r) U - U F + B_r C_n),                          U(0) = 0
        P'    = theta (P + F P + P F^T - P U^T C_r^T C_r U P),                    P(0) = I
        K_r   = b + U P U^T C_r^T,    K_n = P U^T C_r^T,    b = S_1inf^-1 C_r^T

    b the binomial coefficients of order r. r = 0 is the standard observer, shgo_riccati; on the chain A_n the gain
    tends to that of fhgo2 with its poles at -1: choose that one for plants that are uniformly observable. A larger
    theta >= 1 is faster. Each r attenuates noise of frequency omega by one more factor theta/omega, and adds one more
    lag. The excitation has to last: where F stays zero P grows like exp(theta t). Choose fhgo1 for several outputs.

    (3.119) prints C_r^T C_r outside theta, against (3.99). (3.133) prints S_1^-1 for S_1inf^-1 in U'. The
    text counts (n+r)(n+r)/2 equations for S, half a diagonal too few.
    """

    reference = "Robles Magdaleno 2023, (3.97)-(3.103), (3.133), (3.134)"

    r: int = Field(default=1, ge=0, le=20, strict=True, description="order of the filter, r >= 0; 0 is shgo_riccati")
    gain: Literal["reduced", "full"] = Field(
        default="reduced", description="reduced integrates U and P of (3.133), full S of (3.99)"
    )

    def design(self, form: TriangularForm) -> dict[str, np.ndarray]:
        if len(form.measured) > 1:
            raise Problem(
                (),
                f"fhgo2_nuos is defined for one output, and the plant has {len(form.measured)}: "
                f"{', '.join(form.plant.outputs)}; fhgo1 and shgo_riccati take several",
            )
        self.require_fit(self.states(form))
        return {"theta": np.array(self.theta), "b": hurwitz_gain(self.r, -1)}

    def states(self, form: TriangularForm) -> dict[str, np.ndarray | Symmetric]:
        r, n = self.r, form.n
        filters = {"eta": np.zeros(r)} if r else {}
        if self.gain == "full":
            S = np.eye(r + n)
            S[:r, :r] = stationary(r)
            return {**filters, "S": Symmetric(S)}
        couplings = {"U": np.zeros((r, n))} if r else {}
        return {**filters, **couplings, "P": Symmetric(np.eye(n))}

    def roles(self, form: TriangularForm) -> dict[str, Role]:
        return {name: "filter" if name == "eta" else "gain" for name in self.states(form)}

    def settled(self, form: Form) -> dict[str, np.ndarray]:
        """S = S_inf of order r + n; of its blocks, U = -S_1^-1 S_2 and P^-1 = S_3 - S_2^T S_1^-1 S_2."""
        r, S = self.r, stationary(self.r + form.plant.n)
        U = -np.linalg.solve(S[:r, :r], S[:r, r:])
        return {"S": S, "U": U, "P": np.linalg.inv(S[r:, r:] + S[r:, :r] @ U)}

    def equations(self, plant: TriangularCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        r, gain = self.r, self._full if self.gain == "full" else self._reduced
        K_r, K_n, derivatives = gain(plant, s, k)
        filtered = s.eta[0] if r else e
        if r:
            derivatives["eta"] = k.theta * (A(r) @ s.eta - K_r * filtered + B(r) * e)
        kappa = k.theta * plant.inv_Delta(k.theta) @ K_n * filtered
        derivatives["xhat"] = plant.copy(s.xhat) - kappa
        return Flow(derivatives, correction=plant.measured(kappa))

    def _reduced(self, plant: TriangularCopy, s: Symbols, k: Symbols) -> tuple[ca.SX, ca.SX, dict[str, ca.SX]]:
        """K_r, K_n and the derivatives of U and P, (3.128), (3.133)."""
        r, F = self.r, plant.F(s.xhat)
        if not r:
            return ca.SX(0, 1), s.P @ plant.C.T, {"P": k.theta * riccati(s.P, F, plant.C)}
        first = C(r) @ s.U
        K_n = s.P @ first.T
        U = (A(r) - k.b @ C(r)) @ s.U - s.U @ F + B(r) @ plant.C
        return k.b + s.U @ K_n, K_n, {"U": k.theta * U, "P": k.theta * riccati(s.P, F, first)}

    def _full(self, plant: TriangularCopy, s: Symbols, k: Symbols) -> tuple[ca.SX, ca.SX, dict[str, ca.SX]]:
        """K_r, K_n and the derivative of S, (3.97), (3.99), (3.102)."""
        r, n, F = self.r, plant.n, plant.F(s.xhat)
        if not r:
            return ca.SX(0, 1), gain_of(s.S, plant.C), {"S": k.theta * lyapunov(s.S, F, plant.C)}
        Ff = ca.blockcat([[A(r), B(r) @ plant.C], [ca.SX(n, r), F]])
        Cc = ca.horzcat(C(r), ca.SX(1, n))
        K = gain_of(s.S, Cc)
        return K[:r], K[r:], {"S": k.theta * lyapunov(s.S, Ff, Cc)}

    def fastest_rate(self, form: TriangularForm) -> float:
        return (2.5 if self.gain == "full" else 1.0) * self.rate(self.r + max(form.block) + 1)
