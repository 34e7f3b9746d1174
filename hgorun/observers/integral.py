"""The high-gain observer of the output integrated r times."""

from __future__ import annotations

import casadi as ca
from pydantic import Field

from hgorun.observers.base import Flow, observer
from hgorun.observers.constant_gain import FilteredGain
from hgorun.symbolic.canonical import PlantCopy
from hgorun.symbolic.matrices import A, B, C, inv_Delta
from hgorun.symbolic.symbols import Symbols


@observer("integral")
class IntegralObserver(FilteredGain):
    """High-gain observer of the output's r-fold integral, for uniformly observable plants.

    The innovation e drives r integrators, and the standard observer of the chain of r + n corrects all,

        eta'  = A_r eta + B_r e - theta Delta_r^-1(theta) K_r eta_1
        xhat' = A_n xhat + phi^s(u, xhat) - theta^(r+1) Delta_n^-1(theta) K_n eta_1

    or xhat' = f(xhat, u) - theta^(r+1) J^-1(xhat) Delta_n^-1(theta) K_n eta_1 in the plant's own coordinates.
    (K_r; K_n) gives A_(r+n) - K C_(r+n) the r + n poles; the error decays at theta times their value. Noise
    of high frequency omega reaches component i with amplitude theta^(r+i) k_(r+i) / omega^(r+1). r = 0 is the
    standard observer. With several outputs there is one chain of integrators a chain.

    It is fhgo2 with eta_j divided by theta^(r+1-j): from eta(0) = 0 both give the same estimate. Choose
    fhgo2 unless the published form is wanted; here eta is the smaller, the larger theta. The powers of
    theta up to r + n, for which the thesis expects more peaking, scale eta and do not reach xhat.
    """

    reference = "Farza, Ragoubi, Hadj Saïd, M'Saad 2021; Robles Magdaleno 2023, (3.32)"

    r: int = Field(default=1, ge=0, le=20, strict=True, description="number of integrators, r >= 0; 0 is the SHGO")

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        r, derivatives, eta_1 = self.r, {}, e
        if r > 0:  # one column of eta and of K_r a chain
            eta_1 = (C(r) @ s.eta).T
            correction = k.theta * inv_Delta(k.theta, r) @ (k.K_r @ ca.diag(eta_1))
            derivatives["eta"] = A(r) @ s.eta + B(r) @ e.T - correction
        kappa = k.theta ** (r + 1) * plant.inv_Delta(k.theta) @ (k.K_n * plant.along_chains(eta_1))
        derivatives["xhat"] = plant.copy(s.xhat) - plant.lift(s.xhat, kappa, k.theta)
        return Flow(derivatives, correction=plant.felt(s.xhat, kappa, k.theta))
