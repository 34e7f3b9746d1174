"""The filtered high-gain observer FHGO II for uniformly observable plants."""

from __future__ import annotations

import casadi as ca
import numpy as np

from hgorun.observers.base import Flow, observer
from hgorun.observers.chain_speed import ChainSpeed
from hgorun.observers.constant_gain import FilteredGain
from hgorun.observers.nested import NESTED_FROM, NestedSaturation, nested
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.matrices import A, B, C
from hgorun.symbolic.symbols import Symbols


@observer("fhgo2")
class FilteredObserver2(NestedSaturation, ChainSpeed, FilteredGain):
    """Filtered high-gain observer of filter order r (FHGO II) for uniformly observable plants.

    The correction uses the innovation e filtered r times,

        eta'  = theta ((A_r - K_r C_r) eta + B_r e)
        xhat' = A_n xhat + phi^s(u, xhat) - theta Delta_n^-1(theta) K_n eta_1

    or xhat' = f(xhat, u) - theta J^-1(xhat) Delta_n^-1(theta) K_n eta_1 in the plant's own coordinates.
    (K_r; K_n) gives A_(r+n) - K C_(r+n) the r + n poles. Noise of frequency omega reaches component i with
    amplitude theta^(r+i) k_(r+i) / omega^(r+1): each r is one more power of theta/omega, and one more lag.
    r = 0 is the standard observer. With several outputs there is one filter a chain.

    The filters make the peaks of the estimate lower, but they still grow like theta^(i-1). ``nested: {M: [...]}``
    bounds them as for ``shgo``, with eta_1 for e and k_(r+i) for g_i.

    (3.74)-(3.75) of the thesis print a second theta beside eta_1 in the delayed correction; (3.66) is right.
    The observer is the integral observer (3.32) with the filter's state scaled.
    """

    reference = "Robles Magdaleno 2023, (3.33), (3.64)-(3.67), (3.144)-(3.146)"
    key_references = NESTED_FROM

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        numbers = super().design(form)
        return {**numbers, **self.nested_limits(form, self.theta, numbers["K_n"])}

    def driving(self, s: Symbols, e: ca.SX) -> ca.SX:
        return (C(self.r) @ s.eta).T if self.r > 0 else e

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        r, derivatives, filtered = self.r, {}, self.driving(s, e)
        if r > 0:  # one column of eta and of K_r a chain
            derivatives["eta"] = k.theta * (A(r) @ s.eta - k.K_r @ ca.diag(filtered) + B(r) @ e.T)
        kappa = k.theta * plant.inv_Delta(k.theta) @ (k.K_n * nested(plant, filtered, k))
        derivatives["xhat"] = plant.copy(s.xhat) - plant.lift(s.xhat, kappa, k.theta)
        return Flow(derivatives, correction=plant.felt(s.xhat, kappa, k.theta))
